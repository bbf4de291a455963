/* aggregates - rows in connected clusters, and the smoothest motions of each: a coarse space
 *
 * Clusters grow over the graph of the springs, without any geometry. The modes of one are the
 * lowest eigenvectors of its own graph Laplacian, with stiffnesses as weights: the translation, and
 * about what is affine where the cluster is a piece of a regular mesh (as in spectral algebraic
 * multigrid; Chartier et al. 2003). They depend on springs alone: one set serves every state. */
#ifndef MS_AGGREGATES_H
#define MS_AGGREGATES_H

#include "physics/model.h"

enum { MS_MODES = 4 }; /* of each component; one register of doubles */

typedef struct ms_aggregates {
  int32_t n;
  int32_t *of;    /* first_pinned: the aggregate of each row; -1: none */
  int32_t *first; /* n + 1 */
  int32_t *row;   /* first[n]: the rows of each aggregate */
  float *weight;  /* 4 first_pinned: the modes at each row, orthonormal in an aggregate */
} ms_aggregates;

/* Clusters of about `size` rows, from 4 to 256. Rows without springs, and what is left over beside
 * hubs, belong to none. */
msim_status ms_aggregates_create(const ms_model *model, int32_t size, ms_aggregates *aggregates,
                                 msim_error *err);
void ms_aggregates_destroy(const ms_model *model, ms_aggregates *aggregates);

#endif
