/* modes - the graph of the unknowns with stiffnesses, and the smoothest motions of its clusters */
#ifndef MS_MODES_H
#define MS_MODES_H

#include "linear/aggregates.h"

/* Springs between two unknowns, from both ends, in the order of the scene. */
typedef struct ms_neighbours {
  int32_t *first; /* nfree + 1 */
  int32_t *row;   /* first[nfree] */
  double *k;      /* first[nfree] */
} ms_neighbours;

msim_status ms_neighbours_create(const ms_model *model, ms_neighbours *graph, msim_error *err);
void ms_neighbours_destroy(const ms_model *model, ms_neighbours *graph);

/* The weights of aggregates: of each, an orthonormal basis of the 4 lowest eigenvectors of its
 * Laplacian (the first is the translation), by inverse iteration, until their energies are right
 * within a tenth. */
msim_status ms_modes_compute(const ms_model *model, const ms_neighbours *graph,
                             ms_aggregates *aggregates, msim_error *err);

#endif
