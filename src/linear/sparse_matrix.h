/* sparse_matrix - the matrix A = M - h D - h^2 J in compressed sparse rows, for solvers that factor
 * it, from its coefficients (physics/force.h)
 *
 * Block row K of the value array consists of `block` scalar rows, each with its part of all blocks
 * of K side by side. The offset of each spring's block is computed once. */
#ifndef MS_SPARSE_MATRIX_H
#define MS_SPARSE_MATRIX_H

#include "msim/backend.h"
#include "physics/damping_derivative.h"

/* Which unknowns share a spring, also an angular one: compressed rows of both triangles, no
 * diagonal; ascending in one process. Ghosts are columns from n on, in their order. */
typedef struct ms_sparse_graph {
  int32_t n;
  int32_t *ptr; /* n + 1 */
  int32_t *ind; /* ptr[n] */
} ms_sparse_graph;

msim_status ms_sparse_matrix_create_graph(const ms_model *model, ms_sparse_graph *graph,
                                          msim_error *err);
void ms_sparse_matrix_destroy_graph(const ms_model *model, ms_sparse_graph *graph);

/* A in the order and format that a backend requires. */
typedef struct ms_sparse_matrix {
  int32_t n, format, block;     /* block rows; MSIM_FORMAT_...; scalars in a block row */
  int32_t *order;               /* n: the unknown of the k-th block row */
  int32_t *graphptr, *graphind; /* pattern of the blocks: n + 1; one per block */
  int32_t *rowptr, *colind;     /* pattern of the scalars: block n + 1; block^2 per block */
  double *val;                  /* block^2 per block */
  int32_t *row_offset;          /* n, by unknown: offset of its block row in val */
  int32_t *diagonal_offset;     /* n, by unknown: offset of the diagonal block in val */
  int32_t *row_step;            /* n, by unknown: from one scalar row of a block to the next */
  int32_t *first;               /* n + 1, by unknown: its entries, one per half-edge stored */
  struct ms_sparse_entry {
    int32_t half_edge, neighbour, offset; /* its index; the other end; its block's offset in val */
  } * entry;
  int32_t
      *angle_offset; /* 9 for each angular spring: offsets of the blocks of its pairs of corners;
                            -1: not stored, or diagonal */
} ms_sparse_matrix;

/* How a matrix is stored */
typedef struct ms_sparse_layout {
  int32_t format, block; /* MSIM_FORMAT_...; scalars in a block of the coefficients */
  const int32_t *order;  /* n: the unknown of each block row; NULL: the order of the unknowns */
} ms_sparse_layout;

/* MSIM_ERR_ARG: more numbers than 32-bit indices can address. */
msim_status ms_sparse_matrix_create(const ms_model *model, const ms_sparse_graph *graph,
                                    ms_sparse_layout layout, ms_sparse_matrix *matrix,
                                    msim_error *err);
void ms_sparse_matrix_destroy(const ms_model *model, ms_sparse_matrix *matrix);

/* val = A */
void ms_sparse_matrix_assemble(const ms_model *model, const ms_coefficients *a,
                               ms_sparse_matrix *matrix);

/* val += the damping derivative (physics/damping_derivative.h); MSIM_FORMAT_FULL only */
void ms_sparse_matrix_add_damping_derivative(const ms_model *model, const ms_damping_derivative *t,
                                             ms_sparse_matrix *matrix);

/* Vectors of layout/unknowns.h to the order of the matrix, and back: components interleaved, or,
 * where block = 1, one vector per component, one after the other. */
void ms_sparse_matrix_pack(const ms_model *model, const ms_sparse_matrix *matrix, const double *vec,
                           double *packed);
void ms_sparse_matrix_unpack(const ms_model *model, const ms_sparse_matrix *matrix,
                             const double *packed, double *vec);

#endif
