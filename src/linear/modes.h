/* modes - the smoothest modes of each aggregate: eigenvectors of its stiffness-weighted graph */
#ifndef MS_MODES_H
#define MS_MODES_H

#include "layout/incidence.h"
#include "linear/aggregates.h"

/* Arrays for one Laplacian at a time, of n nodes. Where these are numbered along the mesh, its
 * factor is a band: u_ki = 0 for i >= end[k]. */
typedef struct ms_modes_workspace {
  double *u;             /* n x n by rows: the upper triangle, then the Cholesky factor */
  double (*v)[MS_MODES]; /* the modes */
  int32_t *end;          /* n, ascending: the end of each row of u, > k */
} ms_modes_workspace;

/* w: all 0 before. Returns 0 if memory is exhausted; what there is is destroyed likewise. */
int ms_modes_create_workspace(const msim_allocator *alloc, int32_t n, ms_modes_workspace *w);
void ms_modes_destroy_workspace(const msim_allocator *alloc, ms_modes_workspace *w);

/* w->v = an orthonormal basis of the lowest eigenvectors of the Laplacian w->u, whose diagonal has
 * this mean. v[.][0]: that of eigenvalue 0, of any length */
void ms_modes_iterate(int32_t n, double mean, ms_modes_workspace *w);

/* Compute aggregates->weight: of each aggregate an orthonormal basis of the 4 lowest eigenvectors
 * of its Laplacian, the first of which is the translation, by 6 inverse iterations, which determine
 * their energies within a tenth. graph: the springs between unknowns */
msim_status ms_modes_compute(const ms_model *model, const ms_incidence *graph,
                             ms_aggregates *aggregates, msim_error *err);

#endif
