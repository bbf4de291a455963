/* modes - the lowest natural frequencies and their shapes (msim_sim_modes)
 *
 * K u = w^2 M u, by a restarted block Krylov method on the operator (M + h^2 K)^-1 M, the matrix of
 * an implicit step: it is symmetric in the inner product u.M v, and its largest eigenvalues
 * theta = 1/(1 + h^2 w^2) belong to the lowest frequencies (shift and invert, Ericsson and Ruhe
 * 1980). The block is larger than the number of wanted modes, so that equal frequencies, as of a
 * square membrane or the rigid motions of a free body, are all found, whatever their multiplicity.
 * Each cycle builds a basis V of a few blocks, orthonormal in the inner product, and restarts from
 * the best vectors in it: the eigenvectors of H = V.M (M + h^2 K)^-1 M V (Rayleigh and Ritz).
 *
 * h follows from the highest wanted frequency: h w = 100. A larger h separates the wanted theta
 * better from the rest, but beside a theta of 1, of rigid motions, rounding errors of theta are
 * eps h^2 w^2 of w^2. Where the matrix is not positive definite, as the state is unstable, h is
 * halved until it is. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "physics/bounds.h"
#include "statics/static_sim.h"
#include "statics/symmetric_eigen.h"

enum { BLOCKS = 3, EXTRA = 6 };

typedef struct subspace {
  msim_sim *of;  /* whose modes are wanted */
  msim_sim *sim; /* static_sim.h */
  ms_shape shape;
  double h, longest;     /* s: h must not exceed this, or the matrix is not positive definite */
  int32_t wanted, block; /* modes; vectors of a block */
  int32_t n, most;       /* vectors of the basis, and the room for them */
  double **v, **w, **u;  /* most: the basis; (M + h^2 K)^-1 M v of each. block: Ritz vectors */
  double *ritz;      /* most x most: column j has the components of Ritz vector j in the basis */
  double *projected; /* most x most: H */
  double *theta;     /* block: Ritz values, descending */
  double *scratch[2];
  double zero; /* 1/s^2: w^2 up to here are rounding errors of K */
} subspace;

static const double *masses(const subspace *s) { return s->sim->islands->model.mass; }

static double inner_product(const subspace *s, const double *u, const double *v) {
  ms_vector_scale_rows(s->shape, masses(s), u, s->scratch[0]);
  return ms_vector_dot(s->shape, s->scratch[0], v);
}

/* w = (M + h^2 K)^-1 M v with the factor that is there */
static msim_status apply_operator(const subspace *s, const double *v, double *w, msim_error *err) {
  ms_vector_scale_rows(s->shape, masses(s), v, s->scratch[0]);
  return ms_static_sim_solve_again(s->sim, s->scratch[0], w, err);
}

/* Append `from`, made orthonormal to the basis by Gram and Schmidt, twice, unless it is in its
 * span. */
static void append_vector(subspace *s, const double *from) {
  double *v = s->v[s->n], before = sqrt(inner_product(s, from, from));
  ms_vector_copy(s->shape, from, v);
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t i = 0; i < s->n; i++)
      ms_vector_axpy(s->shape, -inner_product(s, v, s->v[i]), s->v[i], v);
    const double after = sqrt(inner_product(s, v, v));
    if (!(after > 1e-10 * before)) return;
    ms_vector_scale(s->shape, 1 / after, v);
    before = 1;
  }
  s->n++;
}

static void start_block(subspace *s) {
  const int32_t rows = s->shape.dims * s->shape.stride;
  s->n = 0;
  for (int32_t j = 0; j < s->block; j++) {
    for (int32_t i = 0; i < rows; i++)
      s->u[0][i] = i % s->shape.stride < s->shape.n
                       ? ms_vector_random_entry((uint32_t)j * (uint32_t)rows + (uint32_t)i)
                       : 0;
    append_vector(s, s->u[0]);
  }
}

/* Factor the matrix, with h halved until it is positive definite. */
static msim_status factor_operator(subspace *s, msim_error *err) {
  const double wanted = s->h;
  const msim_status status = ms_static_sim_solve_definite(s->sim, &s->h, s->v[0], s->w[0], err);
  if (s->h < wanted) s->longest = s->h;
  return status;
}

/* Extend the first block of the basis by what the operator makes of it, block by block. */
static msim_status build_basis(subspace *s, msim_error *err) {
  msim_status status = factor_operator(s, err);
  for (int32_t b = 0, begin = 0; b < BLOCKS && !status; b++) {
    const int32_t end = s->n;
    for (int32_t i = begin; i < end && !status; i++)
      status = apply_operator(s, s->v[i], s->w[i], err);
    for (int32_t i = begin; i < end && s->n < s->most && b + 1 < BLOCKS && !status; i++)
      append_vector(s, s->w[i]);
    begin = end;
  }
  return status;
}

/* u = sum_i y_ij v_i */
static void combine(const subspace *s, double *const *v, int32_t j, double *u) {
  ms_vector_scale(s->shape, 0, u);
  for (int32_t i = 0; i < s->n; i++)
    ms_vector_axpy(s->shape, s->ritz[(size_t)i * (size_t)s->n + (size_t)j], v[i], u);
}

/* The Ritz vectors u and values theta; returns the largest residual of the wanted ones,
 * |(M + h^2 K)^-1 M u - theta u|_M over theta. */
static double find_ritz_vectors(subspace *s) {
  const size_t n = (size_t)s->n;
  double largest = 0;
  for (size_t i = 0; i < n; i++)
    for (size_t j = 0; j <= i; j++)
      s->projected[i * n + j] = s->projected[j * n + i] = inner_product(s, s->v[i], s->w[j]);
  ms_symmetric_eigen_solve(s->n, s->projected, s->ritz);
  for (int32_t j = 0; j < s->block; j++) {
    s->theta[j] = s->projected[(size_t)j * (n + 1)];
    combine(s, s->v, j, s->u[j]);
    if (j >= s->wanted) continue;
    combine(s, s->w, j, s->scratch[1]);
    ms_vector_axpy(s->shape, -s->theta[j], s->u[j], s->scratch[1]);
    largest = fmax(largest, sqrt(inner_product(s, s->scratch[1], s->scratch[1])) / s->theta[j]);
  }
  return largest;
}

/* w^2 of the j-th Ritz vector */
static double squared_frequency(const subspace *s, int32_t j) {
  return (1 / s->theta[j] - 1) / (s->h * s->h);
}

/* Choose the h of the next cycle. Returns 1 if it stays. */
static int choose_step(subspace *s) {
  const double WANTED = 100, NEAR = 10, w2 = squared_frequency(s, s->wanted - 1);
  if (!(w2 > s->zero)) return 1;
  const double h = fmin(WANTED / sqrt(w2), s->longest);
  if (h < NEAR * s->h && s->h < NEAR * h) return 1;
  s->h = h;
  return 0;
}

static msim_status find_modes(subspace *s, msim_error *err) {
  enum { CYCLES = 100 };
  const double SMALL = 1e-8;
  start_block(s);
  for (int i = 0; i < CYCLES; i++) {
    msim_status status = ms_static_sim_check_stop(s->of, err);
    if (!status) status = build_basis(s, err);
    if (status) return status;
    const double residual = find_ritz_vectors(s);
    const int spans_all = s->n == s->shape.n * s->shape.dims;
    if (choose_step(s) && (residual <= SMALL || spans_all)) return MSIM_OK;
    s->n = 0;
    for (int32_t j = 0; j < s->block; j++) append_vector(s, s->u[j]);
  }
  return ms_error_set(err, MSIM_NOT_CONVERGED,
                      "the modes did not converge in %d cycles; compute fewer", CYCLES);
}

static void write_modes(const subspace *s, double *frequency, double *shape) {
  const double TWO_PI = 6.28318530717958647692;
  const size_t n = 3 * (size_t)s->sim->scene->nparticles;
  for (int32_t j = 0; j < s->wanted; j++) {
    const double w2 = squared_frequency(s, j);
    frequency[j] = fabs(w2) <= s->zero ? 0 : copysign(sqrt(fabs(w2)), w2) / TWO_PI;
    if (!shape) continue;
    memset(shape + (size_t)j * n, 0, n * sizeof *shape);
    ms_unknowns_scatter(&s->sim->islands->model.unknowns, s->u[j], shape + (size_t)j * n);
  }
}

/*------------------------------------- memory ---------------------------------------------------*/

static int allocate_vectors(const subspace *s, int32_t n, double ***vectors) {
  const ms_scene *scene = s->sim->scene;
  const ms_unknowns *unknowns = &s->sim->islands->model.unknowns;
  int fits = MS_NEW(&scene->alloc, *vectors, (size_t)n) != NULL;
  for (int32_t i = 0; i < n && fits; i++) fits = MS_NEW_VECTORS(scene, unknowns, (*vectors) + i);
  return fits;
}

static void free_vectors(const msim_allocator *alloc, int32_t n, double **vectors) {
  for (int32_t i = 0; i < n && vectors; i++) ms_memory_free(alloc, vectors[i]);
  ms_memory_free(alloc, vectors);
}

static msim_status allocate_subspace(subspace *s, msim_error *err) {
  const ms_scene *scene = s->sim->scene;
  const ms_model *model = &s->sim->islands->model;
  const int64_t dimension = (int64_t)model->shape.n * model->shape.dims;
  s->shape = model->shape;
  s->block = (int32_t)fmin((double)s->wanted + EXTRA, (double)dimension);
  s->most = (int32_t)fmin(BLOCKS * (double)s->block, (double)dimension);
  const size_t most = (size_t)s->most;
  const int fits = allocate_vectors(s, s->most, &s->v) && allocate_vectors(s, s->most, &s->w) &&
                   allocate_vectors(s, s->block, &s->u) &&
                   MS_NEW(&scene->alloc, s->ritz, most * most) &&
                   MS_NEW(&scene->alloc, s->projected, most * most) &&
                   MS_NEW(&scene->alloc, s->theta, s->block) &&
                   MS_NEW_VECTORS(scene, &model->unknowns, &s->scratch[0], &s->scratch[1]);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the modes");
}

static void free_subspace(const subspace *s) {
  const msim_allocator *alloc = &s->sim->scene->alloc;
  free_vectors(alloc, s->most, s->v);
  free_vectors(alloc, s->most, s->w);
  free_vectors(alloc, s->block, s->u);
  MS_FREE(alloc, s->ritz, s->projected, s->theta, s->scratch[0], s->scratch[1]);
}

static msim_status compute_modes(subspace *s, msim_error *err) {
  ms_bounds bounds;
  msim_status status = allocate_subspace(s, err);
  if (!status) status = ms_bounds_compute(s->sim->scene, 0, &bounds, err);
  if (status) return status;
  s->h = bounds.omega > 0 ? 1e4 / bounds.omega : 1;
  s->zero = 64 * DBL_EPSILON * bounds.omega * bounds.omega;
  return find_modes(s, err);
}

msim_status msim_sim_modes(msim_sim *sim, int32_t n, double *frequency, double *shape,
                           msim_error *err) {
  if (!sim || !frequency) return ms_error_set(err, MSIM_ERR_ARG, "sim or frequency is NULL");
  int64_t free_particles = 0;
  for (int32_t p = 0; p < sim->scene->nparticles; p++) free_particles += !sim->scene->pinned[p];
  if (n < 1 || n > 3 * free_particles)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "n = %d; it must be from 1 to %lld, three times the number of free "
                        "particles",
                        n, (long long)(3 * free_particles));
  subspace s = {.of = sim, .wanted = n, .longest = INFINITY};
  msim_status status = ms_static_sim_check(sim, "msim_sim_modes", err);
  if (!status) status = ms_static_sim_create(sim, MS_STATIC_EXACT, &s.sim, err);
  if (status) return status;
  status = compute_modes(&s, err);
  if (!status) write_modes(&s, frequency, shape);
  free_subspace(&s);
  msim_sim_destroy(s.sim);
  return status ? status : ms_error_clear(err);
}
