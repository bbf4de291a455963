/* modes - the smoothest modes of each aggregate: eigenvectors of its stiffness-weighted graph */
#ifndef MS_MODES_H
#define MS_MODES_H

#include "linear/aggregates.h"

/* The graph in compressed rows: springs between two unknowns, at both ends, in scene order. */
typedef struct ms_neighbours {
  int32_t *first; /* nfree + 1 */
  int32_t *row;   /* first[nfree]: the unknown at the other end */
  double *k;      /* first[nfree]: the stiffness, N/m */
} ms_neighbours;

msim_status ms_neighbours_create(const ms_model *model, ms_neighbours *graph, msim_error *err);
void ms_neighbours_destroy(const ms_model *model, ms_neighbours *graph);

/* Compute aggregates->weight: of each aggregate an orthonormal basis of the 4 lowest eigenvectors
 * of its Laplacian, the first of which is the translation, by 6 inverse iterations, which determine
 * their energies within a tenth. */
msim_status ms_modes_compute(const ms_model *model, const ms_neighbours *graph,
                             ms_aggregates *aggregates, msim_error *err);

#endif
