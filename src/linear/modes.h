/* modes - the smoothest modes of each aggregate: eigenvectors of its stiffness-weighted graph */
#ifndef MS_MODES_H
#define MS_MODES_H

#include "linear/aggregates.h"

/* The graph in compressed rows: springs between two unknowns, at both ends, in scene order. */
typedef struct ms_modes_graph {
  int32_t *first;     /* nfree + 1 */
  int32_t *neighbour; /* first[nfree]: the unknown at the other end */
  double *k;          /* first[nfree]: the stiffness, N/m */
} ms_modes_graph;

msim_status ms_modes_create_graph(const ms_model *model, ms_modes_graph *graph, msim_error *err);
void ms_modes_destroy_graph(const ms_model *model, ms_modes_graph *graph);

/* Compute aggregates->weight: of each aggregate an orthonormal basis of the 4 lowest eigenvectors
 * of its Laplacian, the first of which is the translation, by 6 inverse iterations, which determine
 * their energies within a tenth. */
msim_status ms_modes_compute(const ms_model *model, const ms_modes_graph *graph,
                             ms_aggregates *aggregates, msim_error *err);

#endif
