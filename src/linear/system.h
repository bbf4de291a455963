/* system - the matrix A = M - h D - h^2 J: its coefficients, and its expansion to CSR of blocks
 *
 * The core keeps coefficients. Who factorises gets the matrix: block row K of the value array is
 * `block` scalar rows, each with the blocks of K side by side. Where each spring's block lies is
 * found once. */
#ifndef MS_SYSTEM_H
#define MS_SYSTEM_H

#include "msim/backend.h"
#include "physics/turning.h"

/* Which unknowns share a spring: both triangles, ascending, without the diagonal. */
typedef struct ms_graph {
  int32_t n;
  int32_t *ptr; /* n + 1 */
  int32_t *ind; /* ptr[n] */
} ms_graph;

msim_status ms_graph_create(const ms_model *model, ms_graph *graph, msim_error *err);
void ms_graph_destroy(const ms_model *model, ms_graph *graph);

/* A as a backend sees it, in an order and a format. */
typedef struct ms_matrix {
  int32_t n, format, block;     /* block rows; MSIM_FORMAT_...; scalars in a block row */
  int32_t *order;               /* n: the row that comes k-th */
  int32_t *graphptr, *graphind; /* blocks */
  int32_t *rowptr, *colind;     /* scalars: block n + 1, block^2 a block */
  double *val;                  /* block^2 a block */
  int32_t *diagonal_slot;       /* n, by row: offset of the diagonal block in val */
  int32_t *row_step;            /* n, by row: from one scalar row of a block to the next */
  int32_t *first;               /* n + 1, by row: its entries, one for each half that is stored */
  struct ms_entry {
    int32_t half, slot; /* where its coefficients are, and the offset of its block in val */
  } * entry;
} ms_matrix;

/* block: that of the coefficients to come. Nullable: order (the rows as they are). */
msim_status ms_matrix_create(const ms_model *model, const ms_graph *graph, const int32_t *order,
                             int32_t format, int32_t block, ms_matrix *matrix, msim_error *err);
void ms_matrix_destroy(const ms_model *model, ms_matrix *matrix);

/* val = A */
void ms_matrix_expand(const ms_model *model, const ms_coefficients *a, ms_matrix *matrix);

/* val += what turning dashpots add, by rows; FULL only. */
void ms_matrix_add_turning(const ms_model *model, const ms_turning *t, ms_matrix *matrix);

/* Row vectors to interleaved ones in the matrix' order, and back. Where the matrix has scalars for
 * blocks: to one vector after the other, one for each component. */
void ms_matrix_pack(const ms_model *model, const ms_matrix *matrix, const double *vec,
                    double *packed);
void ms_matrix_unpack(const ms_model *model, const ms_matrix *matrix, const double *packed,
                      double *vec);

#endif
