/* surface_pairs - lists the pairs of features of a surface that come close in a step
 *
 * The list serves later steps, too, until a node has moved farther than a margin from the path that
 * it was made for, relative to the mean motion of all nodes: so surfaces that are not near each
 * other cost a loop over the nodes in most steps. Pairs that it has in excess are farther apart,
 * and the order of others does not depend on them, so that results do not depend on when it was
 * made. */
#ifndef MS_SURFACE_PAIRS_H
#define MS_SURFACE_PAIRS_H

#include "base/vec3.h"
#include "contact/proximity.h"
#include "contact/surface_tree.h"

/* Two features */
typedef struct ms_feature_pair {
  int32_t node[4];
  ms_feature_kind kind;
} ms_feature_pair;

/* Two features without a common node, and, where is_active, the plane of their contact */
typedef struct ms_surface_pair {
  int32_t node[4];
  ms_feature_kind kind;
  int is_active;
  int is_pushed;    /* the plane has pushed them apart in this step */
  double thickness; /* m: at most half of their distance in the scene */
  double least;     /* m: the distance below which they collide */
  double stop;      /* m: a gap at the end of the step above which they do not */
  double apart[3];  /* the normal at x0 */
  double target;    /* m: the distance along the normal at the end of the step */
  double unit;      /* m: a small part of it does not matter */
  double normal[3], weight[4];
  /* beta, lambda, tau and slopes of contact_projection.h */
  double stiffness, reaction, friction[3];
  double push_slope, friction_slope;
} ms_surface_pair;

typedef struct ms_surface_pairs {
  double thickness; /* m */
  double slack;     /* m: the largest margin: little against distances of pairs that are not near */
  ms_contact_surface surface;
  ms_surface_tree tree;
  int32_t n, capacity;
  ms_surface_pair *pair;
  double *base[2]; /* 3 nnodes: the path of each node that the list was made for */
  double margin;   /* m: how far it may be from that; < 0: there is no list */
  ms_box *swept;   /* nnodes: the box of each of these paths */
} ms_surface_pairs;

/* On failure the caller destroys what is there. */
msim_status ms_surface_pairs_create(const ms_model *model, double thickness,
                                    ms_surface_pairs *pairs, msim_error *err);
void ms_surface_pairs_destroy(const ms_scene *scene, ms_surface_pairs *pairs);

/* Let the list contain all pairs that come closer than their thickness while the nodes move on
 * straight lines from x0 to x1. *is_new: it was made anew. May allocate. */
msim_status ms_surface_pairs_update(const msim_allocator *alloc, ms_surface_pairs *pairs,
                                    const double *x0, const double *x1, int *is_new,
                                    msim_error *err);

/* The pairs of two elements: the corners and edges that one of them owns; returns their number. */
enum { MS_MOST_FEATURE_PAIRS = 3 + 3 + 9 };
int ms_surface_pairs_list(const ms_contact_surface *surface, int32_t a, int32_t b,
                          ms_feature_pair list[MS_MOST_FEATURE_PAIRS]);

/* Set the boxes of the tree to those of the paths from x0 to x1, enlarged by `reach`. */
void ms_surface_pairs_set_boxes(ms_surface_pairs *pairs, const double *x0, const double *x1,
                                double reach);

/* The positions of the corners of a pair */
static inline void ms_feature_pair_get(const int32_t node[4], const double *x,
                                       double corner[4][3]) {
  for (int c = 0; c < 4; c++)
    for (int i = 0; i < 3; i++) corner[c][i] = x[3 * (size_t)node[c] + (size_t)i];
}

/* sum += by sum_c w_c y_c. y: 3 nnodes */
static inline void ms_surface_pair_combine(const ms_surface_pair *p, double by, const double *y,
                                           double sum[3]) {
  for (int k = 0; k < 4; k++) ms_vec3_axpy(by * p->weight[k], y + 3 * (size_t)p->node[k], sum);
}

/* 1: a corner that is free has a weight that is not small: else moving it has hardly any effect on
 * the distance. */
static inline int ms_surface_pair_is_mobile(const ms_contact_surface *s, const ms_surface_pair *p) {
  const double SMALL = 1e-3;
  for (int k = 0; k < 4; k++)
    if (s->row[p->node[k]] >= 0 && fabs(p->weight[k]) > SMALL) return 1;
  return 0;
}

/* MSIM_ERR_ARG if elements touch or intersect at x; names them. */
msim_status ms_surface_pairs_check(ms_surface_pairs *pairs, const double *x, msim_error *err);

#endif
