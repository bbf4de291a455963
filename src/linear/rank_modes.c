#include "linear/rank_modes.h"

#include <math.h>
#include <string.h>

#include "linear/coarse_overlap.h"
#include "linear/modes.h"
#include "linear/rank_modes_kernels.h"
#include "linear/rank_patches.h"
#include "physics/angle_springs.h"
#include "physics/rank_model.h"

enum { PRODUCTS = 2 };

MS_TABLES(ms_rank_modes_kernels);

static const ms_rank_modes_kernels *kernels_of(const ms_rank_modes *q) {
  return ms_rank_modes_kernels_of[q->model->isa];
}

/*------------------------------------- rows -----------------------------------------------------*/

/* The weights of own unknowns: affine functions in terms of coarse modes, or where there are none,
 * these functions themselves; orthonormal in each patch. Unknowns that belong to no aggregate, or
 * to no patch, have 0. vec: room for 4 components */
static void set_own_weights(ms_rank_modes *q, const ms_coarse *coarse, double *vec) {
  const int32_t n = q->model->unknowns.nfree;
  double(*w)[MS_MODES] = q->weight;
  for (int32_t r = 0; r < n; r++)
    if (coarse->overlap) ms_coarse_overlap_weights(coarse, r, w[r]);
    else ms_modes_affine_functions(q->model, r, w[r]);
  if (!coarse->overlap)
    ms_rank_patches_orthonormalise(ms_rank_modes_count(q), q->patch, 1, n, w,
                                   (double(*)[MS_MODES])vec);
}

/* Ghosts have the weights of their owners. vec: 4 components; collective */
static void share_weights(ms_rank_modes *q, double *vec) {
  const ms_unknowns *rows = &q->model->unknowns;
  for (int32_t r = 0; r < rows->nfree; r++)
    for (int k = 0; k < MS_MODES; k++) vec[k * rows->stride + r] = q->weight[r][k];
  ms_rank_model_refresh_components(q->model, MS_MODES, vec);
  for (int32_t r = rows->first_pinned; r < rows->first_fixed; r++)
    for (int k = 0; k < MS_MODES; k++) q->weight[r][k] = vec[k * rows->stride + r];
}

/* Patches are numbered by rank, and ghosts have the numbers of their owners. vec: 1 component;
 * collective */
static void share_patches(ms_rank_modes *q, double *vec) {
  const ms_unknowns *rows = &q->model->unknowns;
  for (int32_t r = 0; r < rows->nfree; r++) {
    if (q->patch[r] >= 0) q->patch[r] += ms_rank_modes_first(q);
    vec[r] = q->patch[r];
  }
  ms_rank_model_refresh_components(q->model, 1, vec);
  for (int32_t r = rows->first_pinned; r < rows->first_fixed; r++) q->patch[r] = (int32_t)vec[r];
}

/*------------------------------------- pattern --------------------------------------------------*/

enum { COUPLED = 0 }; /* of `index`, before blocks are numbered */

static void couple(ms_rank_modes *q, int32_t i, int32_t j) {
  const int32_t n = q->first[q->model->shape.ranks->n];
  if (q->patch[i] >= 0 && q->patch[j] >= 0)
    q->index[(q->patch[i] - ms_rank_modes_first(q)) * n + q->patch[j]] = COUPLED;
}

/* The unknowns that springs join with ghosts, and the patches that springs couple */
static void list_border(ms_rank_modes *q) {
  const ms_model *model = q->model;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, r);
    int joins = 0;
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      const int32_t neighbour = ms_half_edges_neighbour(&model->half_edges, at);
      if (model->half_edges.spring[at] < 0 || neighbour >= model->unknowns.first_fixed) continue;
      joins |= neighbour >= model->unknowns.first_pinned;
      couple(q, r, neighbour);
    }
    if (joins) q->border[q->nborder++] = r;
  }
}

/* The patches that angular springs couple */
static void couple_corners(ms_rank_modes *q) {
  const ms_unknowns *rows = &q->model->unknowns;
  for (int32_t k = 0; k < 9 * q->model->angles.n; k++) {
    const int32_t *row = q->model->angles.row + k / 9 * 3, b = row[k % 9 / 3], c = row[k % 3];
    if (b < rows->nfree && c < rows->first_fixed) couple(q, b, c);
  }
}

/* The neighbours of each own patch, to `list`, and their numbers, to `count` */
static void list_neighbours(const ms_rank_modes *q, int64_t *count, int32_t *list) {
  const int32_t n = q->first[q->model->shape.ranks->n], first = ms_rank_modes_first(q);
  for (int32_t p = 0; p < ms_rank_modes_count(q); p++) {
    count[p] = 0;
    for (int32_t c = 0; c < n; c++)
      if (q->index[p * n + c] == COUPLED && c != first + p) count[p]++, *list++ = c;
  }
}

/* Room for the neighbours of each patch. count: of each rank's patches, in turn */
static int create_graph(const ms_rank_modes *q, const int64_t *count, ms_sparse_graph *graph) {
  const msim_allocator *alloc = &q->model->scene->alloc;
  const int32_t nranks = q->model->shape.ranks->n, n = graph->n = q->first[nranks];
  if (!MS_NEW(alloc, graph->ptr, (size_t)n + 1)) return 0;
  for (int32_t p = 0; p < n; p++) graph->ptr[p + 1] = graph->ptr[p] + (int32_t)count[p];
  for (int32_t r = 0; r < nranks; r++)
    q->bytes[r] =
        (graph->ptr[q->first[r + 1]] - graph->ptr[q->first[r]]) * (int64_t)sizeof *graph->ind;
  return MS_NEW(alloc, graph->ind, graph->ptr[n]) != NULL;
}

/* Block (r, c) is sent by the rank whose row it is in the lower triangle. */
static void list_blocks(const ms_sparse_graph *graph, ms_rank_modes *q) {
  const ms_ranks *ranks = q->model->shape.ranks;
  const int32_t *position = q->chol.position, first = ms_rank_modes_first(q);
  int32_t next = 0;
  for (int32_t i = 0; i < ms_rank_modes_count(q) * graph->n; i++) q->index[i] = MS_RANK_NO_BLOCK;
  for (int32_t rank = 0; rank < ranks->n; rank++) {
    const int32_t begin = next;
    for (int32_t r = q->first[rank]; r < q->first[rank + 1]; r++)
      for (int32_t at = graph->ptr[r] - 1; at < graph->ptr[r + 1]; at++) {
        const int32_t c = at < graph->ptr[r] ? r : graph->ind[at];
        if (position[r] < position[c]) continue;
        if (rank == ranks->rank) q->index[(r - first) * graph->n + c] = next - begin;
        q->place[next++] = ms_block_cholesky_find(&q->chol, r, c);
      }
    q->bytes[rank] = (next - begin) * q->chol.block * q->chol.block * (int64_t)sizeof *q->own;
  }
}

/* Each pair of neighbours has one block in the messages, and each patch one on the diagonal. */
static int create_matrix(const ms_sparse_graph *graph, ms_rank_modes *q) {
  const msim_allocator *alloc = &q->model->scene->alloc;
  const size_t block = MS_MODES * (size_t)q->model->unknowns.dims, n = (size_t)graph->n,
               blocks = n + (size_t)graph->ptr[n] / 2, nranks = (size_t)q->model->shape.ranks->n,
               own = (size_t)ms_rank_modes_count(q), first = (size_t)ms_rank_modes_first(q),
               links = (size_t)(graph->ptr[first + own] - graph->ptr[first]),
               message = PRODUCTS + block * (size_t)q->most;
  const int fits =
      !ms_block_cholesky_create(alloc, graph, (int32_t)block, q->model->isa, INFINITY, &q->chol,
                                NULL) &&
      MS_NEW(alloc, q->chol.value, ms_block_cholesky_size(&q->chol)) &&
      MS_NEW(alloc, q->place, blocks) && MS_NEW(alloc, q->own, (own + links) * block * block) &&
      MS_NEW(alloc, q->all, blocks * block * block) && MS_NEW(alloc, q->message, message) &&
      MS_NEW(alloc, q->messages, nranks * message) && MS_NEW(alloc, q->z, n * block) &&
      (nranks <= MS_RANK_MODES_FACTOR || MS_NEW(alloc, q->inverse, own * n * block * block));
  if (fits) list_blocks(graph, q);
  return fits;
}

/*------------------------------------- creation -------------------------------------------------*/

/* Set q->patch, before the patches of all ranks are numbered. Returns how many this rank has; 0 if
 * memory is exhausted. */
static int32_t find_patches(const ms_rank_modes *q, const ms_coarse *coarse) {
  if (!coarse->overlap) return ms_rank_patches_find(q->model, q->patch);
  for (int32_t r = 0; r < q->model->unknowns.nfree; r++) {
    const int32_t of = coarse->aggregates.of[r];
    q->patch[r] = of < 0 ? -1 : coarse->overlap->patch[of];
  }
  return coarse->overlap->n;
}

/* Returns the number of own patches; 0 if memory is exhausted. */
static int32_t create_rows(ms_rank_modes *q, const ms_coarse *coarse) {
  const msim_allocator *alloc = &q->model->scene->alloc;
  const ms_halo *halo = q->model->rank_model->halo;
  const size_t rows = (size_t)q->model->unknowns.first_fixed, n = (size_t)halo->ranks->n;
  const int fits = MS_NEW(alloc, q->patch, rows) && MS_NEW(alloc, q->weight, rows) &&
                   MS_NEW(alloc, q->border, halo->first_out[halo->n]) &&
                   MS_NEW(alloc, q->bytes, n) && MS_NEW(alloc, q->first, n + 1);
  return fits ? find_patches(q, coarse) : 0;
}

/* What creation needs for a while */
typedef struct creation {
  ms_sparse_graph graph;
  int64_t *count; /* neighbours of each patch */
  int64_t own[MS_MOST_PATCHES];
  int32_t *list; /* those of own patches */
} creation;

static int create_pattern(ms_rank_modes *q, creation *c) {
  const msim_allocator *alloc = &q->model->scene->alloc;
  const size_t n = (size_t)q->first[q->model->shape.ranks->n],
               pairs = n * (size_t)ms_rank_modes_count(q);
  const int fits =
      MS_NEW(alloc, q->index, pairs) && MS_NEW(alloc, c->count, n) && MS_NEW(alloc, c->list, pairs);
  for (size_t i = 0; fits && i < pairs; i++) q->index[i] = MS_RANK_NO_BLOCK;
  return fits;
}

/* q->first and q->most, from the numbers of patches of all ranks */
static void number_patches(ms_rank_modes *q, int32_t own) {
  ms_ranks *ranks = q->model->shape.ranks;
  const int64_t number = own;
  ms_ranks_gather(ranks, sizeof number, &number, q->bytes);
  for (int32_t r = 0; r < ranks->n && !ranks->failed; r++) {
    q->first[r + 1] = q->first[r] + (int32_t)q->bytes[r];
    if (q->bytes[r] > q->most) q->most = (int32_t)q->bytes[r];
  }
}

msim_status ms_rank_modes_create(const ms_coarse *coarse, const ms_model *model, double *vec,
                                 ms_rank_modes **modes, msim_error *err) {
  static const char WHAT[] = "the modes of the ranks";
  const msim_allocator *alloc = &model->scene->alloc;
  ms_ranks *ranks = model->shape.ranks;
  creation c = {0};
  int32_t own = 0;
  ms_rank_modes *q = *modes = ms_memory_allocate(alloc, 1, sizeof *q);
  if (q) q->model = model, own = create_rows(q, coarse);
  msim_status status = ms_ranks_agree_on_memory(ranks, own > 0, WHAT, err);
  if (!status) {
    number_patches(q, own);
    status = ms_ranks_agree_on_memory(ranks, ranks->failed || create_pattern(q, &c), WHAT, err);
  }
  if (!status) {
    set_own_weights(q, coarse, vec);
    share_patches(q, vec);
    share_weights(q, vec);
    if (!ranks->failed) list_border(q), couple_corners(q);
    list_neighbours(q, c.own, c.list);
    for (int32_t r = 0; r < ranks->n; r++)
      q->bytes[r] = (q->first[r + 1] - q->first[r]) * (int64_t)sizeof *c.own;
    ms_ranks_gather_parts(ranks, q->bytes, c.own, c.count);
    status = ms_ranks_agree_on_memory(ranks, ranks->failed || create_graph(q, c.count, &c.graph),
                                      WHAT, err);
  }
  if (!status) {
    ms_ranks_gather_parts(ranks, q->bytes, c.list, c.graph.ind);
    status =
        ms_ranks_agree_on_memory(ranks, ranks->failed || create_matrix(&c.graph, q), WHAT, err);
  }
  MS_FREE(alloc, c.graph.ptr, c.graph.ind, c.count, c.list);
  return status;
}

void ms_rank_modes_destroy(const msim_allocator *alloc, ms_rank_modes *q) {
  if (!q) return;
  MS_FREE(alloc, q->chol.value, q->first, q->patch, q->weight, q->border, q->index, q->own, q->all,
          q->bytes, q->place, q->message, q->messages, q->z, q->inverse);
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
  const size_t first = block * (size_t)ms_rank_modes_first(q);
  for (size_t i = 0; i < block * (size_t)ms_rank_modes_count(q); i++) {
    double *row = q->inverse + n * i;
    memset(row, 0, n * sizeof *row);
    row[first + i] = 1;
    ms_block_cholesky_solve(&q->chol, row);
  }
}

/* The blocks of own patches that this rank sends */
static void copy_own_blocks(ms_rank_modes *q, const struct ms_coarse_overlap *own) {
  const size_t area = (size_t)(q->chol.block * q->chol.block);
  for (int32_t p = 0; p < ms_rank_modes_count(q); p++)
    for (int32_t other = 0; other < ms_rank_modes_count(q); other++) {
      const int32_t index = q->index[p * q->chol.n + ms_rank_modes_first(q) + other];
      if (index != MS_RANK_NO_BLOCK)
        ms_coarse_overlap_get_block(own, p, other, q->own + area * (size_t)index);
    }
}

void ms_rank_modes_factor(ms_rank_modes *q, const ms_coefficients *a, double by,
                          const struct ms_coarse_overlap *own) {
  ms_ranks *ranks = q->model->shape.ranks;
  const size_t area = (size_t)(q->chol.block * q->chol.block);
  memset(q->own, 0, (size_t)q->bytes[ranks->rank]);
  if (own) copy_own_blocks(q, own);
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
    memcpy(q->message + PRODUCTS, coarse->overlap->b,
           (size_t)(q->chol.block * ms_rank_modes_count(q)) * sizeof *q->message);
  else kernels_of(q)->restrict_to(q, rz, q->message + PRODUCTS);
}

/* The message of a rank */
static const double *message_of(const ms_rank_modes *q, int32_t rank) {
  return q->messages + (size_t)(PRODUCTS + q->chol.block * q->most) * (size_t)rank;
}

/* z = b and the sums of both products, of all ranks */
static void take_messages(ms_rank_modes *q, double product[2]) {
  const int32_t block = q->chol.block;
  product[0] = product[1] = 0;
  for (int32_t r = 0; r < q->model->shape.ranks->n; r++) {
    const double *from = message_of(q, r);
    for (int k = 0; k < PRODUCTS; k++) product[k] += from[k];
    memcpy(q->z + block * q->first[r], from + PRODUCTS,
           (size_t)(block * (q->first[r + 1] - q->first[r])) * sizeof *from);
  }
}

/* z = (Q^T A Q)^-1 b by the factor, alike on all ranks. Returns b.z. */
static double solve_by_factor(ms_rank_modes *q, double *solution) {
  const int32_t block = q->chol.block;
  double sum = 0;
  ms_block_cholesky_solve(&q->chol, q->z);
  for (int32_t r = 0; r < q->model->shape.ranks->n; r++) {
    const double *b = message_of(q, r) + PRODUCTS;
    for (int32_t i = block * q->first[r]; i < block * q->first[r + 1]; i++) sum += *b++ * q->z[i];
  }
  memcpy(solution, q->z + block * ms_rank_modes_first(q),
         (size_t)(block * ms_rank_modes_count(q)) * sizeof *solution);
  return sum;
}

/* The same by the own rows of the inverse. */
static double multiply_by_inverse(const ms_rank_modes *q, double *solution) {
  const size_t block = (size_t)q->chol.block, n = block * (size_t)q->chol.n;
  double sum = 0;
  for (size_t i = 0; i < block * (size_t)ms_rank_modes_count(q); i++) {
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
  double solution[MS_MOST_PATCHES * MS_BLOCK_CHOLESKY_MAX_BLOCK];
  restrict_residual(q, product, coarse, rz);
  ms_ranks_gather(ranks,
                  (int64_t)((size_t)(PRODUCTS + q->chol.block * q->most) * sizeof *q->message),
                  q->message, q->messages);
  if (ranks->failed) return product[0] = product[1] = NAN;
  take_messages(q, product);
  const double sum = q->inverse ? multiply_by_inverse(q, solution) : solve_by_factor(q, solution);
  if (coarse) ms_coarse_overlap_add(coarse, solution);
  else kernels_of(q)->correct(q, solution, rz);
  return sum;
}
