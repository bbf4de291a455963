#include "linear/rank_modes.h"

#include <math.h>
#include <string.h>

#include "linear/coarse_overlap.h"
#include "linear/modes.h"
#include "linear/rank_modes_kernels.h"
#include "physics/angle_springs.h"
#include "physics/rank_model.h"

enum { PRODUCTS = 2 };

MS_TABLES(ms_rank_modes_kernels);

static const ms_rank_modes_kernels *kernels_of(const ms_rank_modes *q) {
  return ms_rank_modes_kernels_of[q->model->isa];
}

/*------------------------------------- creation -------------------------------------------------*/

/* The weights of own unknowns: affine functions in terms of coarse modes, or where there are none,
 * these functions themselves; orthonormal. Unknowns that belong to no aggregate have 0. */
static void set_own_weights(ms_rank_modes *q, const ms_coarse *coarse) {
  const int32_t n = q->model->unknowns.nfree;
  double(*w)[MS_MODES] = q->weight;
  if (coarse->overlap) {
    for (int32_t r = 0; r < n; r++) ms_coarse_overlap_weights(coarse, r, w[r]);
    return;
  }
  for (int32_t r = 0; r < n; r++) ms_modes_affine_functions(q->model, r, w[r]);
  const int known = n > 0 ? ms_modes_orthonormalise_coordinates(n, w) : 0;
  for (int32_t r = 0; r < n; r++)
    for (int k = known; k < MS_MODES; k++) w[r][k] = 0;
}

/* Ghosts have the weights of their owners. vec: 4 components; collective */
static void share_weights(ms_rank_modes *q, double *vec) {
  const ms_unknowns *rows = &q->model->unknowns;
  for (int32_t r = 0; r < rows->nfree; r++)
    for (int k = 0; k < MS_MODES; k++) vec[k * rows->stride + r] = q->weight[r][k];
  ms_rank_model_refresh_components(q->model, MS_MODES, vec);
  for (int32_t r = rows->first_pinned; r < rows->first_fixed; r++) {
    q->rank[r] = q->model->rank_model->part->owner[rows->particle[r]];
    for (int k = 0; k < MS_MODES; k++) q->weight[r][k] = vec[k * rows->stride + r];
  }
}

/* The unknowns that springs join with ghosts */
static void list_border(ms_rank_modes *q) {
  const ms_model *model = q->model;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, r);
    int joins = 0;
    q->rank[r] = model->shape.ranks->rank;
    for (int32_t at = span.begin; at < span.end && !joins; at += span.step) {
      const int32_t neighbour = ms_half_edges_neighbour(&model->half_edges, at);
      joins = model->half_edges.spring[at] >= 0 && neighbour >= model->unknowns.first_pinned &&
              neighbour < model->unknowns.first_fixed;
    }
    if (joins) q->border[q->nborder++] = r;
  }
}

/*------------------------------------- pattern --------------------------------------------------*/

/* Room for the list of neighbours of each rank */
static int create_graph(const ms_rank_modes *q, const int64_t *count, ms_sparse_graph *graph) {
  const msim_allocator *alloc = &q->model->scene->alloc;
  const int32_t n = graph->n = q->model->shape.ranks->n;
  if (!MS_NEW(alloc, graph->ptr, (size_t)n + 1)) return 0;
  for (int32_t r = 0; r < n; r++) {
    q->bytes[r] = count[r] * (int64_t)sizeof *graph->ind;
    graph->ptr[r + 1] = graph->ptr[r] + (int32_t)count[r];
  }
  return MS_NEW(alloc, graph->ind, graph->ptr[n]) != NULL;
}

static void gather_graph(const ms_rank_modes *q, int32_t *own, const ms_sparse_graph *graph) {
  const ms_halo *halo = q->model->rank_model->halo;
  for (int32_t k = 0; k < halo->n; k++) own[k] = halo->messages[k].rank;
  ms_ranks_gather_parts(halo->ranks, q->bytes, own, graph->ind);
}

/* Block (r, c) is sent by the one of both ranks whose row it is in the lower triangle. */
static void list_blocks(const ms_sparse_graph *graph, ms_rank_modes *q) {
  const int32_t own = q->model->shape.ranks->rank, *position = q->chol.position;
  int32_t next = 0;
  for (int32_t r = 0; r < graph->n; r++) {
    const int32_t first = next;
    q->index[r] = MS_RANK_NO_BLOCK;
    for (int32_t at = graph->ptr[r] - 1; at < graph->ptr[r + 1]; at++) {
      const int32_t c = at < graph->ptr[r] ? r : graph->ind[at];
      if (position[r] < position[c]) continue;
      q->place[next++] = ms_block_cholesky_find(&q->chol, r, c);
    }
    q->bytes[r] = (next - first) * q->chol.block * q->chol.block * (int64_t)sizeof *q->own;
  }
  for (int32_t at = graph->ptr[own] - 1, k = 0; at < graph->ptr[own + 1]; at++) {
    const int32_t c = at < graph->ptr[own] ? own : graph->ind[at];
    if (position[own] >= position[c]) q->index[c] = k++;
  }
}

/* Each pair of neighbours has one block in the messages, and each rank one on the diagonal. */
static int create_matrix(const ms_sparse_graph *graph, ms_rank_modes *q) {
  const msim_allocator *alloc = &q->model->scene->alloc;
  const size_t block = MS_MODES * (size_t)q->model->unknowns.dims, n = (size_t)graph->n,
               blocks = n + (size_t)graph->ptr[n] / 2,
               own = 1 + (size_t)q->model->rank_model->halo->n;
  const int fits =
      !ms_block_cholesky_create(alloc, graph, (int32_t)block, q->model->isa, &q->chol, NULL) &&
      MS_NEW(alloc, q->chol.value, ms_block_cholesky_size(&q->chol)) &&
      MS_NEW(alloc, q->index, n) && MS_NEW(alloc, q->place, blocks) &&
      MS_NEW(alloc, q->own, own * block * block) && MS_NEW(alloc, q->all, blocks * block * block) &&
      MS_NEW(alloc, q->message, PRODUCTS + block) &&
      MS_NEW(alloc, q->messages, n * (PRODUCTS + block)) && MS_NEW(alloc, q->z, n * block) &&
      (graph->n <= MS_RANK_MODES_FACTOR || MS_NEW(alloc, q->inverse, n * block * block));
  if (fits) list_blocks(graph, q);
  return fits;
}

/* Room for the number of ranks that springs join with each one, and for those of this rank */
static int create_rows(ms_rank_modes *q, int64_t **count, int32_t **own) {
  const msim_allocator *alloc = &q->model->scene->alloc;
  const ms_halo *halo = q->model->rank_model->halo;
  const size_t rows = (size_t)q->model->unknowns.first_fixed, n = (size_t)halo->ranks->n;
  return MS_NEW(alloc, q->rank, rows) && MS_NEW(alloc, q->weight, rows) &&
         MS_NEW(alloc, q->border, halo->first_out[halo->n]) && MS_NEW(alloc, q->bytes, n) &&
         MS_NEW(alloc, *count, n) && MS_NEW(alloc, *own, halo->n);
}

msim_status ms_rank_modes_create(const ms_coarse *coarse, const ms_model *model, double *vec,
                                 ms_rank_modes **modes, msim_error *err) {
  static const char WHAT[] = "the modes of the ranks";
  const msim_allocator *alloc = &model->scene->alloc;
  ms_ranks *ranks = model->shape.ranks;
  ms_sparse_graph graph = {0};
  int64_t *count = NULL;
  int32_t *own = NULL;
  ms_rank_modes *q = *modes = ms_memory_allocate(alloc, 1, sizeof *q);
  if (q) q->model = model;
  msim_status status =
      ms_ranks_agree_on_memory(ranks, q && create_rows(q, &count, &own), WHAT, err);
  if (!status) {
    const int64_t nneighbours = model->rank_model->halo->n;
    list_border(q);
    set_own_weights(q, coarse);
    share_weights(q, vec);
    ms_ranks_gather(ranks, sizeof nneighbours, &nneighbours, count);
    status =
        ms_ranks_agree_on_memory(ranks, ranks->failed || create_graph(q, count, &graph), WHAT, err);
  }
  if (!status) {
    gather_graph(q, own, &graph);
    status = ms_ranks_agree_on_memory(ranks, ranks->failed || create_matrix(&graph, q), WHAT, err);
  }
  MS_FREE(alloc, graph.ptr, graph.ind, count, own);
  return status;
}

void ms_rank_modes_destroy(const msim_allocator *alloc, ms_rank_modes *q) {
  if (!q) return;
  MS_FREE(alloc, q->chol.value, q->rank, q->weight, q->border, q->index, q->own, q->all, q->bytes,
          q->place, q->message, q->messages, q->z, q->inverse);
  ms_block_cholesky_destroy(alloc, &q->chol);
  ms_memory_free(alloc, q);
}

/*------------------------------------- the matrix -----------------------------------------------*/

/* Off-diagonal blocks of angular springs between corners, the first at an own unknown */
static void add_angle(ms_rank_modes *q, const ms_coefficients *a, double by, int with_own,
                      int32_t e) {
  const int32_t *row = q->model->angles.row + 3 * (size_t)e;
  double block[3][3], element[MS_ANGLE_ELEMENT];
  ms_angle_springs_get_element(a, e, element);
  for (int32_t b = 0; b < 3; b++)
    for (int32_t c = 0; c < 3; c++) {
      if (b == c || row[b] >= q->model->unknowns.nfree) continue;
      if (row[c] >= q->model->unknowns.first_fixed) continue;
      if (!with_own && row[c] < q->model->unknowns.nfree) continue;
      ms_angle_block(element, b, c, block);
      for (int k = 0; k < 9; k++) block[k / 3][k % 3] *= by;
      ms_rank_modes_add_block(q, row[b], row[c], block);
    }
}

/* Modes that depend on others, as in a straight row of particles, and padding make the diagonal
 * blocks singular: a shift far below the single precision of the factor makes them definite. */
static void shift_diagonal(ms_rank_modes *q) {
  const double SHIFT = 1e-7;
  const size_t n = (size_t)q->chol.block;
  for (int32_t r = 0; r < q->chol.n; r++) {
    double *block = q->chol.value + n * n * (size_t)ms_block_cholesky_find(&q->chol, r, r);
    for (size_t i = 0; i < n; i++)
      block[n * i + i] += block[n * i + i] > 0 ? SHIFT * block[n * i + i] : 1;
  }
}

/* By symmetry the columns are the rows. */
static void compute_inverse(ms_rank_modes *q) {
  const size_t block = (size_t)q->chol.block, n = block * (size_t)q->chol.n;
  const size_t first = block * (size_t)q->model->shape.ranks->rank;
  for (size_t i = 0; i < block; i++) {
    double *row = q->inverse + n * i;
    memset(row, 0, n * sizeof *row);
    row[first + i] = 1;
    ms_block_cholesky_solve(&q->chol, row);
  }
}

void ms_rank_modes_factor(ms_rank_modes *q, const ms_coefficients *a, double by,
                          const double *own) {
  ms_ranks *ranks = q->model->shape.ranks;
  const size_t area = (size_t)(q->chol.block * q->chol.block);
  memset(q->own, 0, (size_t)q->bytes[ranks->rank]);
  if (own) memcpy(q->own + area * (size_t)q->index[ranks->rank], own, area * sizeof *own);
  kernels_of(q)->add_rows(q, a, by, !own);
  for (int32_t e = 0; e < q->model->angles.n; e++) add_angle(q, a, by, !own, e);
  ms_ranks_gather_parts(ranks, q->bytes, q->own, q->all);
  q->is_ready = 0;
  if (ranks->failed) return;
  memset(q->chol.value, 0, ms_block_cholesky_size(&q->chol) * sizeof *q->chol.value);
  const double *from = q->all;
  int32_t next = 0;
  for (int32_t r = 0; r < ranks->n; r++)
    for (int64_t left = q->bytes[r]; left > 0; left -= (int64_t)(area * sizeof *from), from += area)
      memcpy(q->chol.value + area * (size_t)q->place[next++], from, area * sizeof *from);
  shift_diagonal(q);
  q->is_ready = !ms_block_cholesky_factor(&q->chol);
  if (q->is_ready && q->inverse) compute_inverse(q);
}

/*------------------------------------- solving --------------------------------------------------*/

/* message = products and Q^T r */
static void restrict_residual(ms_rank_modes *q, const double product[2], const ms_coarse *coarse,
                              ms_operands rz) {
  memcpy(q->message, product, PRODUCTS * sizeof *product);
  if (coarse)
    memcpy(q->message + PRODUCTS, coarse->overlap->b, (size_t)q->chol.block * sizeof *q->message);
  else kernels_of(q)->restrict_to(q, rz, q->message + PRODUCTS);
}

/* z = b and the sums of both products, of all ranks */
static void take_messages(ms_rank_modes *q, double product[2]) {
  const size_t block = (size_t)q->chol.block;
  product[0] = product[1] = 0;
  for (size_t r = 0; r < (size_t)q->chol.n; r++) {
    const double *from = q->messages + (block + PRODUCTS) * r;
    for (int k = 0; k < PRODUCTS; k++) product[k] += from[k];
    memcpy(q->z + block * r, from + PRODUCTS, block * sizeof *from);
  }
}

/* z = (Q^T A Q)^-1 b by the factor, alike on all ranks. Returns b.z. */
static double solve_by_factor(ms_rank_modes *q, double *solution) {
  const size_t block = (size_t)q->chol.block;
  double sum = 0;
  ms_block_cholesky_solve(&q->chol, q->z);
  for (size_t r = 0; r < (size_t)q->chol.n; r++)
    for (size_t i = 0; i < block; i++)
      sum += q->messages[(block + PRODUCTS) * r + PRODUCTS + i] * q->z[block * r + i];
  memcpy(solution, q->z + block * (size_t)q->model->shape.ranks->rank, block * sizeof *solution);
  return sum;
}

/* The same by the own rows of the inverse. */
static double multiply_by_inverse(const ms_rank_modes *q, double *solution) {
  const size_t block = (size_t)q->chol.block, n = block * (size_t)q->chol.n;
  double sum = 0;
  for (size_t i = 0; i < block; i++) {
    solution[i] = 0;
    for (size_t k = 0; k < n; k++) solution[i] += q->inverse[n * i + k] * q->z[k];
    sum += q->message[PRODUCTS + i] * solution[i];
  }
  ms_ranks_sum(q->model->shape.ranks, 1, &sum);
  return sum;
}

double ms_rank_modes_solve(ms_rank_modes *q, double product[2], const ms_coarse *coarse,
                           ms_operands rz) {
  ms_ranks *ranks = q->model->shape.ranks;
  double solution[MS_BLOCK_CHOLESKY_MAX_BLOCK];
  restrict_residual(q, product, coarse, rz);
  ms_ranks_gather(ranks, (int64_t)((size_t)(PRODUCTS + q->chol.block) * sizeof *q->message),
                  q->message, q->messages);
  if (ranks->failed) return product[0] = product[1] = NAN;
  take_messages(q, product);
  const double sum = q->inverse ? multiply_by_inverse(q, solution) : solve_by_factor(q, solution);
  if (coarse) ms_coarse_overlap_add(coarse, solution);
  else kernels_of(q)->correct(q, solution, rz);
  return sum;
}
