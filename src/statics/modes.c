/* modes - the lowest natural frequencies and their shapes (msim_sim_modes)
 *
 * K u = w^2 M u, by a block Krylov method with thick restarts (Wu and Simon 2000) on the operator
 *   B = M^1/2 (M + h^2 K)^-1 M^1/2,
 * which is symmetric, and whose largest eigenvalues theta = 1/(1 + h^2 w^2), with the eigenvectors
 * M^1/2 u, belong to the lowest frequencies (shift and invert, Ericsson and Ruhe 1980). The block
 * is larger than the number of wanted modes, so that equal frequencies, as of a square membrane or
 * the rigid motions of a free body, are all found, whatever their multiplicity. The basis V grows
 * by the images B v of its vectors, orthonormalized, until it is full; it then shrinks to the best
 * vectors in it, the eigenvectors of H = V'B V (Rayleigh and Ritz), whose images are known, and
 * grows on from the residuals B u - theta u of wanted modes that have not converged.
 *
 * h follows from the highest wanted frequency: h w = 100, unless it is within 2 and 1000 at first.
 * A larger h separates the wanted theta better from the rest, but beside a theta of 1, of rigid
 * motions, rounding errors of theta are eps h^2 w^2 of w^2. Where the matrix is not positive
 * definite, as the state is unstable, h is halved until it is. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "physics/bounds.h"
#include "statics/static_sim.h"
#include "statics/symmetric_eigen.h"

enum { EXTRA = 6, BLOCKS = 3, SIDES = 3 };

typedef struct subspace {
  msim_sim *of;  /* whose modes are wanted */
  msim_sim *sim; /* static_sim.h */
  ms_shape shape;
  double h, longest;     /* s: h must not exceed this, or the matrix is not positive definite */
  int32_t wanted, block; /* modes; vectors that a restart keeps */
  int32_t n, most;       /* vectors of the basis, and the room for them */
  int32_t images;        /* vectors of the basis whose images are known: the first ones */
  double **v, **w;       /* most: the basis, and its images B v */
  double **u[2];         /* block: Ritz vectors and their images */
  double *ritz;          /* most x most: column j has the components of Ritz vector j */
  double *projected;     /* most x most: H */
  double *theta;         /* block: Ritz values, descending */
  double *weight;        /* most: of the vectors in a sum */
  double *root;          /* M^1/2 */
  double *scratch;
  double **side; /* SIDES: right-hand sides that are solved together */
  double *room;  /* for 2 SIDES vectors */
  double omega;  /* 1/s: a bound of the highest frequency */
} subspace;

static double norm(const subspace *s, const double *v) {
  return sqrt(ms_vector_dot(s->shape, v, v));
}

/* w = B v, for n vectors, with the factor that is there */
static msim_status apply_operator(const subspace *s, int32_t n, double *const *v, double *const *w,
                                  msim_error *err) {
  for (int32_t i = 0; i < n; i++) ms_vector_scale_rows(s->shape, s->root, v[i], s->side[i]);
  const msim_status status = ms_static_sim_solve_several(s->sim, n, s->side, w, s->room, err);
  for (int32_t i = 0; i < n && !status; i++) ms_vector_scale_rows(s->shape, s->root, w[i], w[i]);
  return status;
}

/* to = from + sum_i weight_i v_i. Nullable: from */
static void add_basis(const subspace *s, const double *from, double *const *v, double *to) {
  ms_vector_linear_combination(s->shape, from, s->n, s->weight, (const double *const *)v, to);
}

/* Append `from`, made orthonormal to the basis by Gram and Schmidt, twice, unless it is in its
 * span. */
static void append_vector(subspace *s, const double *from) {
  double *v = s->v[s->n], before = norm(s, from);
  ms_vector_copy(s->shape, from, v);
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t i = 0; i < s->n; i++) s->weight[i] = -ms_vector_dot(s->shape, v, s->v[i]);
    add_basis(s, v, s->v, v);
    const double after = norm(s, v);
    if (!(after > 1e-10 * before)) return;
    ms_vector_scale(s->shape, 1 / after, v);
    before = 1;
  }
  s->n++;
}

static void start_basis(subspace *s) {
  const uint32_t size = (uint32_t)(s->shape.dims * s->shape.stride);
  for (int32_t j = 0; j < s->block; j++) {
    ms_vector_fill_random(s->shape, (uint32_t)j * size, s->u[0][j]);
    append_vector(s, s->u[0][j]);
  }
}

/* Factor the matrix, with h halved until it is positive definite. */
static msim_status factor_operator(subspace *s, msim_error *err) {
  const double wanted = s->h;
  const msim_status status = ms_static_sim_solve_definite(s->sim, &s->h, s->v[0], s->scratch, err);
  if (s->h < wanted) s->longest = s->h;
  return status;
}

/* Compute the images that are missing, and append them to the basis while it has room. */
static msim_status extend_basis(subspace *s, msim_error *err) {
  msim_status status = s->images ? MSIM_OK : factor_operator(s, err);
  while (s->images < s->n && !status) {
    const int32_t begin = s->images, end = s->n - begin < SIDES ? s->n : begin + SIDES;
    status = ms_static_sim_check_stop(s->of, err);
    if (!status) status = apply_operator(s, end - begin, s->v + begin, s->w + begin, err);
    for (; s->images < end && !status; s->images++)
      if (s->n < s->most) append_vector(s, s->w[s->images]);
  }
  return status;
}

/* H, whose symmetric part alone counts: errors of the solves make B - B' up to eps h^2 omega^2
 * of the rigid motions, and either triangle would mix that into small theta. */
static void project_operator(subspace *s) {
  const size_t n = (size_t)s->n;
  for (size_t i = 0; i < n; i++)
    for (size_t j = 0; j <= i; j++)
      s->projected[i * n + j] = s->projected[j * n + i] =
          (ms_vector_dot(s->shape, s->v[i], s->w[j]) + ms_vector_dot(s->shape, s->v[j], s->w[i])) /
          2;
}

static void find_ritz_vectors(subspace *s) {
  const size_t n = (size_t)s->n;
  project_operator(s);
  ms_symmetric_eigen_solve(s->n, s->projected, s->ritz);
  for (size_t j = 0; j < (size_t)s->block; j++) {
    s->theta[j] = s->projected[j * (n + 1)];
    for (size_t i = 0; i < n; i++) s->weight[i] = s->ritz[i * n + j];
    add_basis(s, NULL, s->v, s->u[0][j]);
    add_basis(s, NULL, s->w, s->u[1][j]);
  }
}

static void swap_vectors(double **a, double **b) {
  double *between = *a;
  *a = *b, *b = between;
}

/* w^2 of the j-th Ritz vector */
static double squared_frequency(const subspace *s, int32_t j) {
  return (1 / s->theta[j] - 1) / (s->h * s->h);
}

/* w^2 up to here are rounding errors of K and of theta. */
static double rounding_level(const subspace *s) {
  return 64 * DBL_EPSILON * (s->omega * s->omega + 1 / (s->h * s->h));
}

/* The residual of a Ritz vector that has converged: small, or errors of iterative solves, of which
 * the largest theta has most */
static double largest_residual(const subspace *s, double theta) {
  const double SMALL = 1e-8;
  const int is_iterative = !s->sim->islands->stepper.solver->linear->factorizes;
  return SMALL * theta + is_iterative * MS_STATIC_RTOL * s->theta[0];
}

/* The Ritz vectors become the basis, and grow by the residuals B u - theta u of the wanted modes
 * that have not converged. Returns the number of these. */
static int32_t restart(subspace *s) {
  int32_t left = 0;
  for (s->n = 0; s->n < s->block; s->n++) {
    swap_vectors(&s->v[s->n], &s->u[0][s->n]);
    swap_vectors(&s->w[s->n], &s->u[1][s->n]);
  }
  s->images = s->n;
  for (int32_t j = 0; j < s->wanted; j++) {
    ms_vector_add_scaled(s->shape, s->w[j], -s->theta[j], s->v[j], s->scratch);
    if (norm(s, s->scratch) <= largest_residual(s, s->theta[j])) continue;
    left++;
    if (s->n < s->most) append_vector(s, s->scratch);
  }
  return left;
}

/* Choose the h of the next cycle. Returns 1 if it stays; else all images are to be computed. */
static int choose_step(subspace *s) {
  const double WANTED = 100, LEAST = 2, MOST = 1000;
  const double w2 = squared_frequency(s, s->wanted - 1);
  if (!(w2 > rounding_level(s))) return 1;
  const double w = sqrt(w2), h = fmin(WANTED / w, s->longest);
  if (s->h * w <= MOST && (s->h * w >= LEAST || s->h >= 0.5 * h)) return 1;
  s->h = h;
  s->n = s->block, s->images = 0;
  return 0;
}

static msim_status find_modes(subspace *s, msim_error *err) {
  enum { CYCLES = 1000 };
  start_basis(s);
  for (int i = 0; i < CYCLES; i++) {
    const msim_status status = extend_basis(s, err);
    if (status) return status;
    find_ritz_vectors(s);
    const int32_t left = restart(s);
    if (choose_step(s) && (!left || s->n == s->block)) return MSIM_OK;
  }
  return ms_error_set(err, MSIM_NOT_CONVERGED,
                      "the modes did not converge in %d cycles; compute fewer", CYCLES);
}

static void write_modes(const subspace *s, double *frequency, double *shape) {
  const double TWO_PI = 6.28318530717958647692;
  const size_t n = 3 * (size_t)s->sim->scene->nparticles;
  for (int32_t r = 0; r < s->shape.n; r++) s->scratch[r] = 1 / s->root[r];
  for (int32_t j = 0; j < s->wanted; j++) {
    const double w2 = squared_frequency(s, j);
    frequency[j] = fabs(w2) <= rounding_level(s) ? 0 : copysign(sqrt(fabs(w2)), w2) / TWO_PI;
    if (!shape) continue;
    ms_vector_scale_rows(s->shape, s->scratch, s->v[j], s->v[j]);
    ms_unknowns_scatter(&s->sim->islands->model.unknowns, s->v[j], shape + (size_t)j * n);
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
  const int fits =
      allocate_vectors(s, s->most, &s->v) && allocate_vectors(s, s->most, &s->w) &&
      allocate_vectors(s, s->block, &s->u[0]) && allocate_vectors(s, s->block, &s->u[1]) &&
      allocate_vectors(s, SIDES, &s->side) && MS_NEW(&scene->alloc, s->ritz, most * most) &&
      MS_NEW(&scene->alloc, s->room, 2 * SIDES * dimension) &&
      MS_NEW(&scene->alloc, s->projected, most * most) &&
      MS_NEW(&scene->alloc, s->theta, s->block) && MS_NEW(&scene->alloc, s->weight, most) &&
      MS_NEW_VECTORS(scene, &model->unknowns, &s->root, &s->scratch);
  for (int32_t r = 0; r < s->shape.n && fits; r++) s->root[r] = sqrt(model->mass[r]);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the modes");
}

static void free_subspace(const subspace *s) {
  const msim_allocator *alloc = &s->sim->scene->alloc;
  free_vectors(alloc, s->most, s->v);
  free_vectors(alloc, s->most, s->w);
  free_vectors(alloc, s->block, s->u[0]);
  free_vectors(alloc, s->block, s->u[1]);
  free_vectors(alloc, SIDES, s->side);
  MS_FREE(alloc, s->ritz, s->projected, s->theta, s->weight, s->root, s->scratch, s->room);
}

static msim_status compute_modes(subspace *s, msim_error *err) {
  ms_bounds bounds;
  msim_status status = allocate_subspace(s, err);
  if (!status) status = ms_bounds_compute(s->sim->scene, 0, &bounds, err);
  if (status) return status;
  s->omega = bounds.omega;
  s->h = bounds.omega > 0 ? 1e4 / bounds.omega : 1;
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
