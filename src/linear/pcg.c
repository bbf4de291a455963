/* Conjugate gradients (Hestenes and Stiefel 1952), preconditioned by block Jacobi plus a coarse
 * space: B = D^-1 + P (P^T A P)^-1 P^T (two-level additive Schwarz; Dryja and Widlund 1987). */
#include "linear/pcg.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "linear/coarse_overlap.h"
#include "linear/residual.h"
#include "physics/angle_springs.h"
#include "physics/particle_blocks.h"
#include "physics/rank_model.h"

MS_TABLES(ms_pcg_kernels);
MS_TABLES(ms_single_pcg_kernels);
MS_TABLES(ms_pcg_pack_kernels);

/* Numbers of a vector */
static size_t vector_length(const ms_model *model) {
  return (size_t)model->shape.dims * (size_t)model->shape.stride;
}

/* The length of r, q and p, which follow each other */
static size_t vector_bytes(const ms_pcg *s) {
  return vector_length(s->base.system->model) * (s->single ? sizeof(float) : sizeof(double));
}

static void place_vectors(ms_pcg *s, int single) {
  const ms_model *model = s->base.system->model;
  s->single = single, s->unit = 1;
  s->kernels = single ? ms_single_pcg_kernels_of[model->isa] : ms_pcg_kernels_of[model->isa];
  const size_t bytes = vector_bytes(s);
  s->q = (char *)s->r + bytes, s->p = (char *)s->q + bytes;
}

/*------------------------------------- sweeps ---------------------------------------------------*/

enum { CHUNK = MS_RESTRICTION_SLICES }; /* slices in a chunk of work */

/* Arguments of one sweep over all slices by all threads */
typedef struct pcg_sweep {
  ms_pcg *s;
  const double *b;
  double alpha, beta;
} pcg_sweep;

static int32_t pcg_run(ms_pool_chunk *work, pcg_sweep *j) {
  const ms_model *model = j->s->base.system->model;
  return ms_pool_run_chunks(model->pool, work, j, model->half_edges.nslices, CHUNK);
}

static void pack_chunk(void *data, int32_t begin, int32_t end) {
  ms_pcg *s = ((pcg_sweep *)data)->s;
  ms_pcg_pack_kernels_of[s->base.system->model->isa]->pack(s, begin, end);
}

static void begin_chunk(void *data, int32_t begin, int32_t end) {
  const pcg_sweep *j = data;
  j->s->kernels->begin(j->s, j->b, begin, end);
}

static void end_chunk(void *data, int32_t begin, int32_t end) {
  const pcg_sweep *j = data;
  j->s->kernels->end(j->s, j->alpha, begin, end);
}

static void pcg_apply_chunk(void *data, int32_t begin, int32_t end) {
  const ms_pcg *s = ((pcg_sweep *)data)->s;
  s->kernels->apply(s, begin, end, s->sums + begin / CHUNK);
}

static void reduce_chunk(void *data, int32_t begin, int32_t end) {
  const pcg_sweep *j = data;
  j->s->kernels->reduce(j->s, j->alpha, begin, end, j->s->sums + begin / CHUNK);
  if (j->s->coarse_is_ready) ms_coarse_restrict(&j->s->coarse, j->s->single, j->s->r, begin, end);
}

static void advance_chunk(void *data, int32_t begin, int32_t end) {
  const pcg_sweep *j = data;
  j->s->kernels->advance(j->s, j->alpha, j->beta, begin, end);
}

/* The share of p.q of angular springs that count on another rank */
static double sum_foreign_angles(const ms_pcg *s, ms_operands pq) {
  const ms_linear_system *system = s->base.system;
  const struct ms_rank_model *shared = system->model->rank_model;
  double sum = 0;
  for (int32_t k = 0; shared && k < shared->nangles; k++)
    sum += ms_angle_springs_product_of(system->model, &system->a, shared->angle[k], pq);
  return sum;
}

/* q = A p. Returns p.q, over all ranks. */
static double pcg_apply(ms_pcg *s) {
  double sum;
  const ms_operands pq = {s->p, s->q, s->single};
  if (s->single) ms_rank_model_refresh_floats(s->base.system->model, s->p);
  else ms_rank_model_refresh(s->base.system->model, s->p, NULL);
  const int32_t n = pcg_run(pcg_apply_chunk, &(pcg_sweep){.s = s});
  s->kernels->apply_split_rows(s, &sum);
  for (int32_t k = 0; k < n; k++) sum += s->sums[k];
  const ms_linear_system *system = s->base.system;
  const double by = 1 / s->jacobi.scale;
  sum += ms_angle_springs_apply(system->model, &system->a, by, pq);
  sum -= by * sum_foreign_angles(s, pq);
  if (system->a.own) sum += ms_particle_blocks_apply(system->model, system->a.own, 1, by, pq);
  sum += ms_coefficients_apply_constraints(system->model, &system->a, 1, by, pq);
  ms_ranks_sum(system->model->shape.ranks, 1, &sum);
  return sum;
}

/* r -= alpha q,  q = z = D^-1 r,  and the sums of P^T r. Returns r.z of this rank. */
static double pcg_reduce(ms_pcg *s, double alpha) {
  double sum = 0;
  const int32_t n = pcg_run(reduce_chunk, &(pcg_sweep){.s = s, .alpha = alpha});
  for (int32_t k = 0; k < n; k++) sum += s->sums[k];
  return sum;
}

/* z = 0, but for what the modes of ranks add */
static void clear_correction(ms_pcg *s) {
  const int32_t modes = s->coarse.aggregates.n * MS_MODES * s->base.system->model->unknowns.dims;
  memset(s->q, 0, vector_bytes(s));
  if (modes) memset(s->coarse.z, 0, (size_t)modes * sizeof *s->coarse.z);
}

/* The coarse correction of r, to coarse.z, with that of the modes of ranks, which goes to q where
 * this rank has no coarse space; at a start, the latter alone. product[0]: r.D^-1 r of this rank.
 * Returns r.B r, and product[0], over all ranks. */
static double pcg_solve_coarse(ms_pcg *s, double product[2]) {
  product[1] = s->coarse_is_ready ? ms_coarse_solve(&s->coarse) : 0;
  if (s->starts) clear_correction(s);
  const ms_operands rz = {s->r, s->q, s->single};
  const ms_coarse *coarse = s->coarse_is_ready ? &s->coarse : NULL;
  double modes = 0;
  if (s->modes && s->modes->is_ready) modes = ms_rank_modes_solve(s->modes, product, coarse, rz);
  else ms_ranks_sum(s->base.system->model->shape.ranks, 2, product);
  return s->starts ? modes : product[0] + (product[1] + modes);
}

static void pcg_advance(ms_pcg *s, double alpha, double beta) {
  pcg_run(advance_chunk, &(pcg_sweep){.s = s, .alpha = alpha, .beta = beta});
}

/*------------------------------------- setup ----------------------------------------------------*/

/* The numbers of D^-1 by which matrices are compared: its diagonal */
static size_t count_compared(const ms_pcg *s) {
  const ms_unknowns *rows = &s->base.system->model->unknowns;
  return (size_t)rows->dims * (size_t)rows->first_pinned;
}

/* 1 if the coarse factor, if there is one, can be reused: the matrix, judged by the diagonal of
 * D^-1, has hardly changed. That is so in solids, but not in moving cloth, where iterations that a
 * lagged factor adds cost more than a new one. Each matrix of Newton's method takes few
 * iterations, so that there a factor serves at least SEVERAL matrices. Changed constraints require
 * a new factor, but not within a step, where the modes of particles that join are set to 0, and
 * those of particles that leave stay 0. */
static int can_keep_coarse_factor(const ms_pcg *s, int32_t kind) {
  enum { SEVERAL = 8 };
  const double HARDLY = 0.05;
  const ms_linear_system *system = s->base.system;
  if (!s->base.aggregates) return 1;
  if (!s->coarse_is_ready || s->factored_scale != s->jacobi.scale) return 0;
  if (system->continues) return 1;
  if (!s->may_reuse_coarse ||
      !ms_coarse_is_constrained_by(&s->coarse, system->a.constraint, system->a.nconstraints))
    return 0;
  if (kind == MSIM_FACTOR_SYMMETRIC && s->coarse_age + 1 < SEVERAL) return 1;
  return ms_jacobi_relative_distance(s->factored_inverse, s->inverse, count_compared(s)) <= HARDLY;
}

static void keep_coarse_factor(ms_pcg *s) {
  const ms_linear_system *system = s->base.system;
  s->coarse_age++;
  s->base.reused_coarse_factors++;
  if (system->continues)
    ms_coarse_constrain_more(&s->coarse, system->a.constraint, system->a.nconstraints);
  else ms_coarse_constrain(&s->coarse, system->a.constraint, system->a.nconstraints);
}

static msim_status factor_coarse(ms_pcg *s, int32_t kind) {
  const ms_linear_system *system = s->base.system;
  memcpy(s->factored_inverse, s->inverse, count_compared(s) * sizeof *s->factored_inverse);
  s->factored_scale = s->jacobi.scale;
  s->coarse_age = 0;
  s->base.coarse_factors++;
  ms_coarse_constrain(&s->coarse, system->a.constraint, system->a.nconstraints);
  const ms_coarse_matrix a = {.coefficients = s->coefficients,
                              .inertia = s->inertia,
                              .a = &system->a,
                              .by = 1 / s->jacobi.scale,
                              .braced = kind == MSIM_FACTOR_SYMMETRIC};
  s->coarse_is_ready = !ms_coarse_factor(&s->coarse, &a);
  return s->coarse_is_ready || system->clamped || kind == MSIM_FACTOR_SYMMETRIC ? MSIM_OK
                                                                                : MSIM_NOT_SPD;
}

/* In memory that is also used otherwise, let padding be 0 again. */
static void clear_padding(ms_shape s, double *x) {
  for (size_t c = 0; c < (size_t)s.dims; c++)
    memset(x + c * (size_t)s.stride + s.n, 0, (size_t)(s.stride - s.n) * sizeof *x);
}

static msim_status factor_jacobi(ms_pcg *s, int32_t kind) {
  const ms_model *model = s->base.system->model;
  const ms_coefficients *a = &s->base.system->a;
  clear_padding(ms_coefficients_diagonal_shape(&model->unknowns, a), s->jacobi.inverse);
  msim_status status = ms_jacobi_invert(model, a, kind, &s->jacobi);
  if (!status) pcg_run(pack_chunk, &(pcg_sweep){.s = s});
  return status;
}

/* Rounding p to floats changes A p by some u times the largest entry of A. That may not exceed a
 * quarter of the share of inertia, which is all that resists the motions of free bodies: they would
 * come back, and cost more iterations than floats save time, 1.2 times as many at this limit.
 * The weight w of a constraint along an axis does not count: the error u w |p| stays in the unknown
 * whose diagonal has w itself. In the energy norm its square is at most u^2 w |p|^2, 4 u w/t = 2e-3
 * of what springs of stiffness t may have. Along other directions it leaks into motions across. */
static int may_round_vectors(const ms_pcg *s) {
  const double U = FLT_EPSILON / 2;
  const ms_model *model = s->base.system->model;
  double least = INFINITY;
  if (!s->coarse_is_ready) return 0;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) least = fmin(least, model->mass[r]);
  return 4 * U * s->jacobi.coupling_scale <= least;
}

/* The blocks of this rank in the matrix of the modes of ranks are known where the coarse matrix is
 * of this very matrix, and rounding, which they share with no other rank, is harmless. */
static const struct ms_coarse_overlap *find_own_blocks(const ms_pcg *s, int may_round) {
  const ms_coarse *coarse = &s->coarse;
  const int is_this = s->coarse_is_ready && s->coarse_age == 0 && !coarse->drops_negative_t &&
                      coarse->nconstrained == 0 && !coarse->is_constrained_more;
  return is_this && may_round ? coarse->overlap : NULL;
}

/* The coarse factors of all ranks and the factor of their modes are of the same matrix. */
static msim_status pcg_factor(ms_linear *base, int32_t kind, msim_error *err) {
  (void)err;
  ms_pcg *s = (ms_pcg *)base;
  ms_ranks *ranks = base->system->model->shape.ranks;
  msim_status status = factor_jacobi(s, kind);
  ms_agreement keeps = {.all = !status && can_keep_coarse_factor(s, kind)};
  status = ms_ranks_agree_on(ranks, status, &keeps, NULL);
  if (!status && base->aggregates && keeps.all) keep_coarse_factor(s);
  else if (!status && base->aggregates) status = factor_coarse(s, kind);
  const int may_round = may_round_vectors(s);
  enum { ROUNDS = 1, IS_FREE = 2 }; /* any: a coarse space is worthwhile on a rank */
  const uint32_t is_free = base->system->a.nconstraints ? 0 : IS_FREE;
  ms_agreement bits = {.all = is_free | (may_round ? ROUNDS : 0), .any = base->aggregates > 0};
  status = ms_ranks_agree_on(ranks, status, &bits, NULL);
  s->rounds_vectors = (bits.all & ROUNDS) > 0, s->is_free = (bits.all & IS_FREE) > 0;
  if (!s->modes) return status;
  if (status || !keeps.all) s->modes->is_ready = 0;
  if (!status && bits.any && !s->modes->is_ready)
    ms_rank_modes_factor(s->modes, &base->system->a, 1 / s->jacobi.scale,
                         find_own_blocks(s, may_round));
  s->coarse.leaves_overlap = s->coarse_is_ready && s->modes->is_ready;
  return status;
}

/*------------------------------------- iterations -----------------------------------------------*/

/* r = b, the residual of y; p = 0 unless s->rho > 0. */
static void begin_iteration(ms_pcg *s, const double *b) {
  const size_t bytes = vector_bytes(s);
  pcg_run(begin_chunk, &(pcg_sweep){.s = s, .b = b});
  memset(s->q, 0, bytes);
  if (s->rho == 0) memset(s->p, 0, bytes);
}

/* Iterate from the residual b of y until the norm of the recursively updated one is <= goal. */
static msim_status pcg_iterate(ms_pcg *s, const double *b, double goal, int64_t limit,
                               int64_t *iterations) {
  double alpha = 0;
  begin_iteration(s, b);
  goal /= sqrt(s->jacobi.scale) * s->unit;
  for (;; ++*iterations) {
    double product[2] = {pcg_reduce(s, alpha)}, rho = 0;
    if (s->modes) rho = pcg_solve_coarse(s, product); /* one message for both products */
    const int done = product[0] <= goal * goal;
    if (done || *iterations >= limit) {
      pcg_run(end_chunk, &(pcg_sweep){.s = s, .alpha = alpha});
      return done ? MSIM_OK : MSIM_NOT_CONVERGED;
    }
    if (!s->modes) rho = pcg_solve_coarse(s, product);
    pcg_advance(s, alpha, s->rho > 0 ? rho / s->rho : 0);
    s->rho = s->starts ? 0 : rho;
    const double curvature = pcg_apply(s);
    if (!(curvature > 0) && !s->starts) return MSIM_NOT_SPD;
    alpha = curvature > 0 ? rho / curvature : 0;
    s->starts = 0;
  }
}

/* A power of 2 near the size of b in units of jacobi.scale. Powers of it are exact. */
static double find_unit(const ms_pcg *s, double size) {
  int exponent = 0;
  if (s->single) frexp(size, &exponent);
  return ldexp(1, exponent);
}

/* The recursively updated residual drifts from the true one, as the matrix and the vectors of pcg
 * are rounded: by some DRIFT of the largest residual since both were equal. Where the goal is
 * farther away, the true residual replaces that of the recursion each time that it has fallen by
 * DROP, while both are near, and the directions go on (van der Vorst and Ye, SIAM J. Sci. Comput.
 * 22 (2000) 835; in two precisions: Carson and Higham, SIAM J. Sci. Comput. 40 (2018) A817). They
 * start anew where the residuals are apart, as at rounding level, where directions would grow
 * without bound. The true residual decides, until it is no longer halved.
 * On several ranks the first direction is in the space of their modes alone (Nicolaides 1987): free
 * fall, which no coarse space of a rank has, is found at once. Constraints prevent such motions. */
static msim_status pcg_solve(ms_linear *base, const ms_linear_target *target, const double *b,
                             double *y, int64_t *iterations, msim_error *err) {
  (void)err;
  const double SAFETY = 0.9, DRIFT = 1e-6, DROP = 1e-3, NEAR = 1.5;
  ms_pcg *s = (ms_pcg *)base;
  const double goal = fmax(target->rtol, DBL_EPSILON / 4) * target->size;
  double last = INFINITY, next = 0;
  int64_t count = 0;
  msim_status status = MSIM_OK;
  const ms_model *model = base->system->model;
  place_vectors(s, model->single || s->rounds_vectors);
  s->y = y;
  s->rho = 0, s->unit = find_unit(s, target->size / sqrt(s->jacobi.scale));
  s->starts = s->modes && s->modes->is_ready && s->is_free;
  base->residual = target->size;
  for (const double *left = b;; left = s->residual) {
    base->is_verified = base->residual <= goal;
    if (base->is_verified || base->residual > 0.5 * last) break;
    if (base->residual > NEAR * next) s->rho = 0;
    last = base->residual;
    next = goal < DRIFT * last ? DROP * last : SAFETY * goal;
    status = pcg_iterate(s, left, next, target->max_iterations, &count);
    if (status) break;
    base->residual = ms_residual_compute(base->system, b, y, s->residual);
  }
  s->starts = 0;
  *iterations += count;
  return status;
}

/* Conjugate gradients from y = 0 until sqrt(r.B r) is rtol times its initial value. Returns 0 at a
 * direction p with p.A p <= 0: y is then the last iterate, or p if there is none. */
static int descend_once(ms_pcg *s, const ms_descent_target *d, const double *b,
                        int64_t *iterations) {
  double alpha = 0, goal = -1, curvature = 1;
  s->rho = 0;
  begin_iteration(s, b);
  ms_vector_clear_all(s->base.system->model->shape, s->y);
  for (int32_t i = 0; curvature > 0; i++, ++*iterations) {
    double product[2] = {pcg_reduce(s, alpha)};
    const double rho = pcg_solve_coarse(s, product);
    if (i == 0) goal = d->rtol * d->rtol * rho;
    if (rho <= goal || i >= d->max_iterations) break;
    pcg_advance(s, alpha, s->rho > 0 ? rho / s->rho : 0);
    s->rho = rho;
    curvature = pcg_apply(s);
    alpha = curvature > 0 ? rho / curvature : i == 0;
  }
  pcg_run(end_chunk, &(pcg_sweep){.s = s, .alpha = alpha});
  return curvature > 0;
}

static msim_status pcg_prepare_descent(ms_linear *base, msim_error *err) {
  if (base->system->a.block == 1) return MSIM_OK; /* no descend() */
  return ms_compression_create(base->system->model, &((ms_pcg *)base)->compression, err);
}

/* Where a direction shows that A is not positive definite, reduce the compression that causes it,
 * and start again from 0, so that b.y > 0. No true residual corrects what floats lose: they serve
 * where less is required than the DRIFT of pcg_solve(). */
static void pcg_descend(ms_linear *base, const ms_descent_target *d, const double *b, double *y,
                        int64_t *iterations) {
  enum { MOST = 16 };
  const double LEAST_OF_FLOATS = 1e-5;
  ms_pcg *s = (ms_pcg *)base;
  place_vectors(s, s->rounds_vectors && d->rtol >= LEAST_OF_FLOATS);
  s->unit = find_unit(s, sqrt(ms_vector_dot(base->system->model->shape, b, b)) / s->jacobi.scale);
  s->y = y;
  if (base->system->clamped) ms_compression_reset(&s->compression);
  else ms_compression_carry_over(&s->compression, s->coefficients);
  const ms_operands direction = {.x = s->p, .single = s->single};
  for (int i = 0; !descend_once(s, d, b, iterations) && i < MOST; i++)
    if (!ms_compression_reduce(&s->compression, direction, s->coefficients)) break;
}

/* z = B r: one iteration with alpha = beta = 0 */
static void pcg_precondition(ms_linear *base, const double *r, double *z) {
  ms_pcg *s = (ms_pcg *)base;
  place_vectors(s, 0);
  s->y = s->residual; /* y += 0 p */
  s->rho = 0;
  begin_iteration(s, r);
  pcg_solve_coarse(s, (double[2]){pcg_reduce(s, 0)});
  pcg_advance(s, 0, 0);
  ms_vector_copy(base->system->model->shape, s->p, z);
}

/*------------------------------------- creation and destruction ---------------------------------*/

static void pcg_destroy(ms_linear *base) {
  if (!base) return;
  ms_pcg *s = (ms_pcg *)base;
  const msim_allocator *alloc = &base->system->model->scene->alloc;
  ms_coarse_destroy(&s->coarse);
  ms_rank_modes_destroy(alloc, s->modes);
  ms_compression_destroy(&s->compression);
  MS_FREE(alloc, s->coefficients, s->inverse, s->factored_inverse, s->inertia, s->vectors, s->sums);
  ms_memory_free(alloc, s);
}

static msim_status pcg_allocate(ms_pcg *s, msim_error *err) {
  const ms_model *model = s->base.system->model;
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t rows = (size_t)model->unknowns.first_pinned;
  const size_t blocks = ms_coefficients_diagonal_size((size_t)model->unknowns.dims) * rows;
  const size_t entries = (size_t)model->half_edges.nentries;
  const int fits =
      MS_NEW(alloc, s->coefficients, 4 * MS_SLICE * entries) && MS_NEW(alloc, s->inverse, blocks) &&
      MS_NEW(alloc, s->factored_inverse, count_compared(s)) && MS_NEW(alloc, s->inertia, rows) &&
      MS_NEW(alloc, s->sums, ms_pool_count_chunks(model->half_edges.nslices, CHUNK));
  return fits ? MSIM_OK : ms_error_set_memory(err, "conjugate gradients");
}

static msim_status pcg_connect(ms_linear *base, msim_error *err) {
  ms_pcg *s = (ms_pcg *)base;
  return ms_rank_modes_create(&s->coarse, base->system->model, s->r, &s->modes, err);
}

/* The vectors of iterations, whose content factor() may overwrite. They lie in the memory in which
 * the coarse matrix is factored, if there is one. Before that factor() uses the last ones, as long
 * as two vectors of doubles, for the inverse blocks in double precision. */
static msim_status create_vectors(ms_pcg *s, msim_error *err) {
  const ms_model *model = s->base.system->model;
  const size_t n = vector_length(model);
  double *room = s->coarse.value;
  if (!room) room = MS_NEW(&model->scene->alloc, s->vectors, 4 * n);
  if (!room) return ms_error_set_memory(err, "conjugate gradients");
  s->r = room, s->residual = room + 3 * n;
  for (size_t i = 0; i < 3; i++) s->base.work[i] = room + (i + 1) * n;
  s->jacobi = (ms_jacobi){.block = s->base.system->a.block, .scale = 1, .inverse = room + 2 * n};
  place_vectors(s, 0);
  return MSIM_OK;
}

static void set_model(ms_linear *base) {
  ms_pcg *s = (ms_pcg *)base;
  if (s->compression.model) s->compression.model = base->system->model;
  if (base->aggregates) s->coarse.model = base->system->model;
}

static void restart(ms_linear *base) { ((ms_pcg *)base)->coarse_is_ready = 0; }

msim_status ms_pcg_create(const ms_linear_system *system, const msim_options *opt,
                          ms_coarse_size size, ms_linear **linear, msim_error *err) {
  static const ms_linear_ops ops = {.connect = pcg_connect,
                                    .factor = pcg_factor,
                                    .solve = pcg_solve,
                                    .prepare_descent = pcg_prepare_descent,
                                    .descend = pcg_descend,
                                    .precondition = pcg_precondition,
                                    .set_model = set_model,
                                    .restart = restart,
                                    .destroy = pcg_destroy};
  const ms_model *model = system->model;
  *linear = NULL;
  ms_pcg *s = ms_memory_allocate(&model->scene->alloc, 1, sizeof *s);
  if (!s) return ms_error_set_memory(err, "conjugate gradients");
  s->base = (ms_linear){.ops = &ops, .system = system, .name = "pcg"};
  s->may_reuse_coarse = !(opt->skip_off & MSIM_SKIP_KEPT_FACTOR);
  msim_status status = pcg_allocate(s, err);
  if (!status && size.aggregate) status = ms_coarse_create(model, size, &s->coarse, err);
  if (!status) status = create_vectors(s, err);
  s->base.aggregates = s->coarse.aggregates.n;
  if (status) pcg_destroy(&s->base);
  else *linear = &s->base;
  return status;
}
