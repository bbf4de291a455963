/* surface_tree - finds the pairs of elements of a surface whose boxes overlap, by a tree of boxes
 *
 * The tree is made once, from the positions of the scene, by halving the elements along the longest
 * axis of the box of their middles: neighbours stay neighbours as a surface folds. Before a search
 * all boxes are computed anew. So a search depends on the boxes alone, and not on earlier ones. */
#ifndef MS_SURFACE_TREE_H
#define MS_SURFACE_TREE_H

#include "contact/contact_surface.h"

typedef struct ms_box {
  double low[3], high[3];
} ms_box;

/* Node k of the tree is followed by its descendants: as a leaf for each element, 2 n - 1 nodes in
 * all, the left child is k + 1. */
typedef struct ms_surface_tree {
  int32_t nnodes;
  int32_t *end;     /* nnodes: the first node that is no descendant */
  int32_t *element; /* nnodes: of a leaf; -1: it has children */
  int32_t *leaf;    /* nelements: the node of each element */
  ms_box *box;      /* nnodes; the caller sets those of leaves */
} ms_surface_tree;

/* On failure the caller destroys what is there. */
msim_status ms_surface_tree_create(const ms_scene *scene, const ms_contact_surface *surface,
                                   ms_surface_tree *tree, msim_error *err);
void ms_surface_tree_destroy(const ms_scene *scene, ms_surface_tree *tree);

/* Set the boxes of all nodes that are no leaves. */
void ms_surface_tree_update(ms_surface_tree *tree);

/* The next element whose box overlaps that of `element`, among those behind its leaf; -1: none.
 * *node: 0 at first. */
int32_t ms_surface_tree_next(const ms_surface_tree *tree, int32_t element, int32_t *node);

#endif
