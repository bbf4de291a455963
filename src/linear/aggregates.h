/* aggregates - the coarse space of a two-level preconditioner: connected clusters of unknowns, and
 * modes of each
 *
 * Clusters grow over the graph of the springs, without geometry. The modes of one are the
 * translation and the coordinates of its unknowns in the scene; where these are fewer than 4
 * independent functions, as in cloth and ropes, the smoothest ones of the graph, weighted by
 * stiffness, complete them (as in spectral algebraic multigrid; Chartier et al. 2003).
 * They depend on the scene only, not on the state. */
#ifndef MS_AGGREGATES_H
#define MS_AGGREGATES_H

#include "physics/model.h"

enum { MS_MODES = 4 }; /* per aggregate and component; one register of doubles */

typedef struct ms_aggregates {
  int32_t n;
  int32_t *of;      /* first_pinned: the aggregate of each unknown; -1: none */
  int32_t *first;   /* n + 1: the range of each aggregate in `row` */
  int32_t *unknown; /* first[n]: the unknowns of each aggregate */
  float *weight;    /* 4 first_pinned: the modes at each unknown, orthonormal in an aggregate */
} ms_aggregates;

/* size: unknowns per aggregate, approximately, 4 to 256. Unknowns without springs, and fewer than 4
 * isolated by hubs (unknowns with very many springs), belong to none. */
msim_status ms_aggregates_create(const ms_model *model, int32_t size, ms_aggregates *aggregates,
                                 msim_error *err);
void ms_aggregates_destroy(const ms_model *model, ms_aggregates *aggregates);

/* The aggregate of a row; -1: none, as it is pinned, of another rank, or without springs */
static inline int32_t ms_aggregates_find(const ms_model *model, const ms_aggregates *aggregates,
                                         int32_t row) {
  return row < model->unknowns.nfree ? aggregates->of[row] : -1;
}

#endif
