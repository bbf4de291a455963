/* modes - the modes of each aggregate: affine functions, and eigenvectors of its weighted graph
 *
 * Where springs keep their lengths, an aggregate moves almost rigidly. In each component its turns
 * are affine functions of the coordinates in the scene, and stay so as it deforms and turns; they
 * stretch no spring, whereas eigenvectors of the Laplacian, which only resemble them, stretch all
 * (rigid body modes; Vanek, Mandel and Brezina 1996). */
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

/* 1, x, y, z: the functions on an unknown at (x, y, z) in the scene; 1, 0, 0, 0 where forces do not
 * depend on directions, as the matrix is then that of the Laplacian. */
void ms_modes_affine_functions(const ms_model *model, int32_t row, double f[MS_MODES]);

/* Lets the translation and the independent coordinates be the first vectors, orthonormal. v: the
 * affine functions on n unknowns (or their parts in n modes). Returns the number of these. */
int ms_modes_orthonormalise_coordinates(int32_t n, double (*v)[MS_MODES]);

/* w->v, the affine functions on n unknowns (or their parts in n modes), becomes an orthonormal
 * basis of those that are independent, completed by the smoothest vectors orthogonal to them: those
 * of the largest v.L^-1 v, within a quarter, L the Laplacian w->u. mean: that of its diagonal */
void ms_modes_complete(int32_t n, double mean, ms_modes_workspace *w);

/* Compute aggregates->weight. graph: the springs between unknowns */
msim_status ms_modes_compute(const ms_model *model, const ms_incidence *graph,
                             ms_aggregates *aggregates, msim_error *err);

#endif
