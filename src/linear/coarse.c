#include "linear/coarse.h"

#include <math.h>
#include <string.h>

#include "linear/coarse_angles.h"
#include "linear/coarse_kernels.h"
#include "linear/coarse_overlap.h"

MS_TABLES(ms_coarse_kernels);

/*------------------------------------- pattern --------------------------------------------------*/

/* List the aggregates that springs connect with aggregate k, from `next` on. Returns the end of the
 * list. mark: of each aggregate, the last k in whose list it is. */
static int32_t *list_links(const ms_model *model, const ms_aggregates *a, int32_t k, int32_t *mark,
                           int32_t *next) {
  const ms_half_edges *half_edges = &model->half_edges;
  mark[k] = k;
  for (int32_t i = a->first[k]; i < a->first[k + 1]; i++) {
    const ms_half_edge_span span = ms_half_edges_of_row(half_edges, a->unknown[i]);
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      if (half_edges->spring[at] < 0) continue;
      const int32_t other = ms_aggregates_find(model, a, ms_half_edges_neighbour(half_edges, at));
      if (other >= 0 && mark[other] != k) mark[other] = k, *next++ = other;
    }
  }
  return ms_coarse_angles_list_links(model, a, k, mark, next);
}

/* Where there are planes, prepare constraints: copy the modes, and allocate `held`. */
static msim_status keep_modes(const ms_model *model, ms_coarse *coarse, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = MS_MODES * (size_t)model->unknowns.first_pinned;
  if (!(model->features & MS_HAS_PLANES)) return MSIM_OK;
  if (!MS_NEW(alloc, coarse->modes, n) ||
      !MS_NEW(alloc, coarse->constrained, model->unknowns.nfree))
    return ms_error_set_memory(err, "the coarse matrix");
  memcpy(coarse->modes, coarse->aggregates.weight, n * sizeof *coarse->modes);
  return MSIM_OK;
}

/* List the aggregates that springs connect with each one. ind NULL: write ptr only. mark, list:
 * scratch, n */
static void list_graph(const ms_model *model, const ms_aggregates *a, int32_t *mark, int32_t *list,
                       ms_sparse_graph *graph) {
  for (int32_t k = 0; k < a->n; k++) mark[k] = -1;
  for (int32_t k = 0; k < a->n; k++) {
    int32_t *to = graph->ind ? graph->ind + graph->ptr[k] : list;
    graph->ptr[k + 1] = graph->ptr[k] + (int32_t)(list_links(model, a, k, mark, to) - to);
  }
}

static msim_status allocate_values(const ms_model *model, ms_coarse *coarse, msim_error *err) {
  const size_t vectors = 4 * (size_t)model->unknowns.dims * (size_t)model->unknowns.stride;
  const size_t cycle = ms_coarse_cycle_size(&coarse->cycle);
  ms_block_cholesky *chol = cycle ? &coarse->cycle.chol : &coarse->chol;
  const size_t all = cycle + ms_block_cholesky_size(chol);
  coarse->value_size = all > vectors ? all : vectors;
  if (!MS_NEW(&model->scene->alloc, coarse->value, coarse->value_size))
    return ms_error_set_memory(err, "the coarse matrix");
  coarse->cycle.value = coarse->value;
  chol->value = coarse->value + cycle;
  return MSIM_OK;
}

/* The numbers up to which a factor is used: a share of those of the matrix, or LITTLE beside the
 * cost of all else in an iteration */
static double most_numbers(const ms_model *model, double share) {
  const double LITTLE = 3e5;
  return fmax(LITTLE, share * 4.0 * MS_SLICE * model->half_edges.nentries);
}

/* Clusters get larger where their factor, which one thread applies, would have over 0.15 times as
 * many numbers as the matrix: that costs more iterations but less time. */
static msim_status create_cycle(const ms_model *model, const ms_sparse_graph *graph, int32_t size,
                                ms_coarse *coarse, msim_error *err) {
  const double most = most_numbers(model, 0.15);
  for (;; size *= 2) {
    const msim_status status =
        ms_coarse_cycle_create(model, &coarse->aggregates, graph, size, &coarse->cycle, err);
    if (status || (double)ms_block_cholesky_size(&coarse->cycle.chol) <= most) return status;
    ms_coarse_cycle_destroy(&model->scene->alloc, &coarse->cycle);
  }
}

/* A factor grows faster than the mesh, soonest in solids. Where it would have more than half as
 * many numbers as the matrix, a cycle takes its place. Angular springs, which act on up to three
 * aggregates, could make a cycle indefinite: where there are any, there is no inverse then. */
static msim_status create_inverse(const ms_model *model, const ms_sparse_graph *graph,
                                  int32_t cluster, ms_coarse *coarse, msim_error *err) {
  enum { CLUSTER = 8 };
  msim_status status = MSIM_OK;
  if (!cluster)
    status = ms_block_cholesky_create(&model->scene->alloc, graph, MS_MODES * model->unknowns.dims,
                                      model->isa, most_numbers(model, 0.5), &coarse->chol, err);
  if (!status && !coarse->chol.n && !model->angles.n)
    status = create_cycle(model, graph, cluster ? cluster : CLUSTER, coarse, err);
  coarse->position = coarse->cycle.n ? coarse->cycle.position : coarse->chol.position;
  return status;
}

/* position NULL afterwards: for these aggregates there is no inverse. */
static msim_status analyse(const ms_model *model, ms_coarse_size size, ms_coarse *coarse,
                           msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  msim_status status = ms_aggregates_create(model, size.aggregate, &coarse->aggregates, err);
  if (status) return status;
  const int32_t n = coarse->aggregates.n;
  ms_sparse_graph graph = {.n = n};
  int32_t *mark = NULL, *list = NULL;
  int fits =
      MS_NEW(alloc, graph.ptr, (size_t)n + 1) && MS_NEW(alloc, mark, n) && MS_NEW(alloc, list, n);
  if (fits) list_graph(model, &coarse->aggregates, mark, list, &graph);
  fits = fits && MS_NEW(alloc, graph.ind, graph.ptr[n]);
  if (fits) list_graph(model, &coarse->aggregates, mark, list, &graph);
  status = fits ? create_inverse(model, &graph, size.cluster, coarse, err)
                : ms_error_set_memory(err, "the coarse matrix");
  if (!status && coarse->position && model->rank_model)
    status = ms_coarse_overlap_create(coarse, &graph, &coarse->overlap, err);
  MS_FREE(alloc, graph.ptr, graph.ind, mark, list);
  return status;
}

/* Write the blocks of aggregate k from `to` on; NULL: count them only. Returns their number. */
static int32_t list_blocks(const ms_coarse *coarse, int32_t k, int32_t *to) {
  const ms_half_edges *half_edges = &coarse->model->half_edges;
  const ms_aggregates *a = &coarse->aggregates;
  int32_t n = 0;
  for (int32_t i = a->first[k]; i < a->first[k + 1]; i++) {
    const ms_half_edge_span span = ms_half_edges_of_row(half_edges, a->unknown[i]);
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      const int32_t other =
          ms_aggregates_find(coarse->model, a, ms_half_edges_neighbour(half_edges, at));
      if (half_edges->spring[at] < 0 || !ms_coarse_owns_block(coarse, k, other)) continue;
      if (to) to[n] = ms_coarse_find(coarse, k, other);
      n++;
    }
  }
  return n;
}

static msim_status find_blocks(ms_coarse *coarse, msim_error *err) {
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  const int32_t n = coarse->aggregates.n;
  int32_t *first = coarse->first_block;
  for (int32_t k = 0; k < n; k++) first[k + 1] = first[k] + list_blocks(coarse, k, NULL);
  if (!MS_NEW(alloc, coarse->block, first[n])) return ms_error_set_memory(err, "the coarse matrix");
  for (int32_t k = 0; k < n; k++) {
    list_blocks(coarse, k, coarse->block + first[k]);
    coarse->diagonal[k] = ms_coarse_find(coarse, k, k);
  }
  return MSIM_OK;
}

msim_status ms_coarse_create(const ms_model *model, ms_coarse_size size, ms_coarse *coarse,
                             msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  *coarse = (ms_coarse){.model = model, .kernels = ms_coarse_kernels_of[model->isa]};
  msim_status status = analyse(model, size, coarse, err);
  for (; !status && !coarse->position; size.aggregate *= 2) {
    ms_aggregates_destroy(model, &coarse->aggregates);
    status = analyse(model, (ms_coarse_size){.aggregate = 2 * size.aggregate}, coarse, err);
  }
  if (!status)
    status = ms_restriction_create(model, &coarse->aggregates, &coarse->restriction, err);
  if (!status) status = keep_modes(model, coarse, err);
  if (!status) status = allocate_values(model, coarse, err);
  if (status) return status;
  const size_t n = (size_t)coarse->aggregates.n * MS_MODES * (size_t)model->unknowns.dims;
  if (!MS_NEW(alloc, coarse->first_block, (size_t)coarse->aggregates.n + 1) ||
      !MS_NEW(alloc, coarse->diagonal, coarse->aggregates.n) || !MS_NEW(alloc, coarse->r, n) ||
      !MS_NEW(alloc, coarse->z, n))
    return ms_error_set_memory(err, "the coarse matrix");
  return find_blocks(coarse, err);
}

void ms_coarse_destroy(ms_coarse *coarse) {
  if (!coarse->model) return;
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  ms_aggregates_destroy(coarse->model, &coarse->aggregates);
  ms_restriction_destroy(coarse->model, &coarse->restriction);
  ms_block_cholesky_destroy(alloc, &coarse->chol);
  ms_coarse_cycle_destroy(alloc, &coarse->cycle);
  ms_coarse_overlap_destroy(alloc, coarse->overlap);
  MS_FREE(alloc, coarse->value, coarse->first_block, coarse->block, coarse->diagonal, coarse->r,
          coarse->z, coarse->modes, coarse->constrained);
  *coarse = (ms_coarse){0};
}

/*------------------------------------- values ---------------------------------------------------*/

/* One loop over all aggregates, by all threads; no two write to the same place. */
typedef struct coarse_job {
  ms_coarse *coarse;
  const ms_coarse_matrix *a;
} coarse_job;

static void coarse_run(ms_pool_chunk *work, coarse_job *j) {
  enum { CHUNK = 8 }; /* aggregates in a chunk of work */
  ms_pool_run_chunks(j->coarse->model->pool, work, j, j->coarse->aggregates.n, CHUNK);
}

static void assemble_chunk(void *data, int32_t begin, int32_t end) {
  const coarse_job *j = data;
  for (int32_t k = begin; k < end; k++) {
    j->coarse->kernels->assemble(j->coarse, j->a->coefficients, j->a->inertia, k);
    ms_coarse_angles_assemble(j->coarse, j->a, k);
  }
}

static void clear_modes(ms_coarse *coarse, const ms_constraint *constraint, int32_t n) {
  float *weight = coarse->aggregates.weight;
  for (int32_t i = 0; i < n; i++)
    memset(weight + MS_MODES * constraint[i].row, 0, MS_MODES * sizeof *weight);
}

void ms_coarse_constrain(ms_coarse *coarse, const ms_constraint *constraint, int32_t n) {
  const size_t rows = (size_t)coarse->model->unknowns.first_pinned;
  if (coarse->nconstrained || coarse->is_constrained_more)
    memcpy(coarse->aggregates.weight, coarse->modes, MS_MODES * rows * sizeof *coarse->modes);
  coarse->nconstrained = n, coarse->is_constrained_more = 0;
  for (int32_t i = 0; i < n; i++) coarse->constrained[i] = constraint[i].row;
  clear_modes(coarse, constraint, n);
}

void ms_coarse_constrain_more(ms_coarse *coarse, const ms_constraint *constraint, int32_t n) {
  clear_modes(coarse, constraint, n);
  coarse->is_constrained_more = 1;
}

int ms_coarse_is_constrained_by(const ms_coarse *coarse, const ms_constraint *constraint,
                                int32_t n) {
  if (n != coarse->nconstrained) return 0;
  for (int32_t i = 0; i < n; i++)
    if (constraint[i].row != coarse->constrained[i]) return 0;
  return 1;
}

/* Modes of constrained unknowns alone need some inertia, or the coarse matrix would be singular. */
static void add_constrained_inertia(ms_coarse *coarse, const double *inertia) {
  const size_t n = MS_MODES * (size_t)coarse->model->unknowns.dims, area = n * n;
  for (int32_t at = 0; at < coarse->nconstrained; at++) {
    const int32_t row = coarse->constrained[at];
    const float *w = coarse->modes + MS_MODES * row;
    const int32_t of = coarse->aggregates.of[row];
    if (of < 0) continue;
    double *block = coarse->value + area * (size_t)coarse->diagonal[of];
    for (size_t c = 0; c < n; c += MS_MODES)
      for (size_t i = 0; i < MS_MODES; i++)
        for (size_t j = 0; j < MS_MODES; j++)
          block[(c + j) * n + c + i] += inertia[row] * (double)w[i] * (double)w[j];
  }
}

msim_status ms_coarse_factor(ms_coarse *coarse, const ms_coarse_matrix *a) {
  coarse->drops_negative_t = a->braced || coarse->cycle.n;
  memset(coarse->value, 0, coarse->value_size * sizeof *coarse->value);
  coarse_run(assemble_chunk, &(coarse_job){.coarse = coarse, .a = a});
  add_constrained_inertia(coarse, a->inertia);
  if (coarse->overlap) ms_coarse_overlap_factor(coarse);
  return coarse->cycle.n ? ms_coarse_cycle_factor(&coarse->cycle, coarse->model->pool)
                         : ms_block_cholesky_factor(&coarse->chol);
}

/*------------------------------------- solution -------------------------------------------------*/

void ms_coarse_restrict(ms_coarse *coarse, int single, const void *r, int32_t begin, int32_t end) {
  coarse->kernels->restrict_rows(coarse, single, r, MS_SLICE * (size_t)begin,
                                 MS_SLICE * (size_t)end);
}

static void add_parts_chunk(void *data, int32_t begin, int32_t end) {
  const coarse_job *j = data;
  for (int32_t k = begin; k < end; k++) j->coarse->kernels->add_parts(j->coarse, k);
}

double ms_coarse_solve(ms_coarse *coarse) {
  const int32_t n = coarse->aggregates.n * MS_MODES * coarse->model->unknowns.dims;
  coarse_run(add_parts_chunk, &(coarse_job){.coarse = coarse});
  if (coarse->cycle.n) {
    ms_coarse_cycle_solve(&coarse->cycle, coarse->model->pool, coarse->r, coarse->z);
  } else {
    memcpy(coarse->z, coarse->r, (size_t)n * sizeof *coarse->z);
    ms_block_cholesky_solve(&coarse->chol, coarse->z);
  }
  if (coarse->overlap) ms_coarse_overlap_restrict(coarse);
  if (coarse->leaves_overlap) ms_coarse_overlap_subtract(coarse);
  double sum = 0;
  for (int32_t i = 0; i < n; i++) sum += coarse->r[i] * coarse->z[i];
  return sum;
}
