#include "methods/rkc.h"

#include <math.h>

#include "base/archive.h"
#include "methods/methods.h"

/* The method with s stages for y' = f(y), y = (x, v), f = (v, a) (Sommeijer, Shampine and Verwer,
 * J. Comput. Appl. Math. 88 (1998) 315):
 *   Y_0 = y,  Y_1 = Y_0 + m_1 h f_0,
 *   Y_j = Y_0 + mu (Y_(j-1) - Y_0) + nu (Y_(j-2) - Y_0) + m h f_(j-1) + g h f_0,  y' = Y_s,
 * with Chebyshev polynomials T_j at w0 = 1 + (2/13)/s^2, w1 = T_s'/T_s'',
 *   b_j = T_j''/T_j'^2 from j = 2 on, b_0 = b_2, b_1 = 1/w0,
 *   m_1 = b_1 w1,  mu = 2 b_j w0/b_(j-1),  nu = -b_j/b_(j-2),  m = 2 b_j w1/b_(j-1),
 *   g = -(1 - b_(j-1) T_(j-1)) m.
 * Its amplification factor is 1 - b_s T_s(w0) + b_s T_s(w0 + w1 h z). */
#define DAMPING (2. / 13)

/* With more stages their rounding errors accumulate. */
enum { MOST_STAGES = 1000 };

/* With s stages the region of stability contains the real axis down to -AXIS (s^2 - 1). */
static const double AXIS = 0.653;

int32_t ms_rkc_count_stages(double h, ms_bounds bounds) {
  const double stages = ceil(sqrt(1 + h * fmax(bounds.rate, bounds.omega) / AXIS));
  return (int32_t)fmin(fmax(stages, 2), MOST_STAGES);
}

/* The longest step that is stable on the real axis */
static double longest_step(const ms_bounds *b) {
  return AXIS * (MOST_STAGES * MOST_STAGES - 1.) / fmax(b->rate, b->omega);
}

/*------------------------------------- coefficients ---------------------------------------------*/

/* T_j, T_j' and T_j'' at w0, and b_j */
typedef struct chebyshev_term {
  double t, t1, t2, b;
} chebyshev_term;

static chebyshev_term next_chebyshev_term(double w0, chebyshev_term now, chebyshev_term before) {
  chebyshev_term next = {.t = 2 * w0 * now.t - before.t,
                         .t1 = 2 * now.t + 2 * w0 * now.t1 - before.t1,
                         .t2 = 4 * now.t1 + 2 * w0 * now.t2 - before.t2};
  next.b = next.t2 / (next.t1 * next.t1);
  return next;
}

/* The recurrence at stage j of s */
typedef struct chebyshev_recurrence {
  double w0, w1;
  chebyshev_term now, before;
  double mu, nu, m, g; /* of the stage */
} chebyshev_recurrence;

static void advance_recurrence(chebyshev_recurrence *r) {
  const chebyshev_term next = next_chebyshev_term(r->w0, r->now, r->before);
  const double share = 2 * next.b / r->now.b;
  r->mu = share * r->w0;
  r->m = share * r->w1;
  r->nu = -next.b / r->before.b;
  r->g = -(1 - r->now.b * r->now.t) * r->m;
  r->before = r->now;
  r->now = next;
}

/* The recurrence at stage 1 */
static chebyshev_recurrence begin_recurrence(int32_t stages) {
  const double s = stages, w0 = 1 + DAMPING / (s * s);
  const chebyshev_term zeroth = {.t = 1}, first = {.t = w0, .t1 = 1, .b = 1 / w0};
  const chebyshev_term second = next_chebyshev_term(w0, first, zeroth);
  chebyshev_term now = second, before = first;
  for (int32_t j = 2; j < stages; j++) {
    const chebyshev_term next = next_chebyshev_term(w0, now, before);
    before = now, now = next;
  }
  chebyshev_recurrence r = {.w0 = w0, .w1 = now.t1 / now.t2, .now = first, .before = zeroth};
  r.before.b = second.b;
  r.m = r.w1 / w0;
  return r;
}

/*------------------------------------- steps ----------------------------------------------------*/

/* Work vectors: of stages; and twice, for the present state and the next one, its acceleration and
 * an image, B w/|w| (improve_image), which is 0 where none is known */
enum { X, V, CARRIED, NWORK = CARRIED + 4 };
enum { A0, IMAGE };

static double *const *present_vectors(const ms_stepper *s) {
  return s->work + CARRIED + 2 * (s->cached_stage == 2);
}

static double *const *next_vectors(const ms_stepper *s) {
  return s->work + CARRIED + 2 * (s->cached_stage != 2);
}

/*------------------------------------- damping in the present state -----------------------------*/

static double find_length(ms_shape shape, const double *vec) {
  return sqrt(ms_vector_dot(shape, vec, vec));
}

/* Random numbers that follow from positions alone, so that any number of ranks has the same */
static void fill_image(ms_stepper *s) {
  const size_t n = (size_t)s->model->shape.n, stride = (size_t)s->model->shape.stride;
  const size_t end = (size_t)s->model->shape.dims * stride;
  double *image = present_vectors(s)[IMAGE];
  for (size_t r = 0; r < n; r++) {
    uint64_t key = 0;
    for (size_t i = r; i < end; i += stride) key = ms_archive_hash(key, &s->x[i], sizeof *s->x);
    for (size_t i = r; i < end; i += stride) image[i] = ms_vector_random_entry((uint32_t)key++);
  }
}

/* One step of the power method on B = M^-1 C, the damping in the present state, with
 *   B w = a(x, v) - a(x, v + w).
 * w has the direction of IMAGE, whose length is given. IMAGE becomes B w/|w|, so that its length,
 * which is returned, tends to the largest eigenvalue of B. w is as long as v, or as a/rate if that
 * is more, so that rounding does not count. */
static double improve_image(ms_stepper *s, double length) {
  const ms_shape shape = s->model->state_shape;
  double *const *now = present_vectors(s), *v = s->v_next, *a = s->work[V];
  const double speed = fmax(find_length(shape, s->v), find_length(shape, now[A0]) / s->bounds.rate);
  const double w = speed > 0 ? speed : 1;
  ms_vector_add_scaled(shape, s->v, w / length, now[IMAGE], v);
  ms_stepper_acceleration(s, s->x, v, a);
  const double weights[2] = {1 / w, -1 / w};
  ms_vector_linear_combination(shape, NULL, 2, weights, (const double *const[]){now[A0], a},
                               now[IMAGE]);
  return find_length(shape, now[IMAGE]);
}

/* The bounds; under error control with the damping rate of the present state. That is a half or a
 * third of the one that holds in every state, as springs in different directions do not add up.
 * It is followed at one evaluation a step, and counts where it grows by less than 5 %. As it is
 * approached from below, 1.2 times as much is assumed (Sommeijer, Shampine and Verwer); if that is
 * too little, the step is rejected. Fixed steps are stable in every state. */
static ms_bounds find_bounds(ms_stepper *s) {
  enum { LEAST_STAGES = 16 };
  const double SAFETY = 1.2, SETTLED = 1.05;
  const ms_shape shape = s->model->state_shape;
  double *image = present_vectors(s)[IMAGE];
  ms_bounds b = s->bounds;
  if (!s->one_substep) return b;
  if (!s->cached_stage) ms_vector_clear_all(shape, image); /* none is known */
  if (ms_rkc_count_stages(s->h, b) < LEAST_STAGES) return b;
  const double before = find_length(shape, image);
  if (SAFETY * before >= b.rate) return b;
  if (before == 0) fill_image(s);
  const double rate = improve_image(s, before > 0 ? before : find_length(shape, image));
  if (!(rate < INFINITY)) ms_vector_clear_all(shape, image);
  else if (rate < SETTLED * before) b.rate = fmin(b.rate, SAFETY * rate);
  return b;
}

static void rkc_start(ms_stepper *s) { ms_stepper_init_stage(s, s->work[X], s->work[V]); }

static msim_status rkc_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_shape shape = s->model->state_shape;
  double *xs[] = {s->x_next, s->work[X]},
         *vs[] = {s->v_next, s->work[V]}; /* the last stage is in the first pair */
  double *a0 = present_vectors(s)[A0]; /* under error control from the estimate of the last step */
  if (!s->cached_stage) ms_stepper_acceleration(s, s->x, s->v, a0);
  const int32_t stages = ms_rkc_count_stages(s->h, find_bounds(s));
  chebyshev_recurrence r = begin_recurrence(stages);
  int to = (stages - 1) % 2;
  ms_vector_add_scaled(shape, s->x, r.m * s->h, s->v, xs[to]);
  ms_vector_add_scaled(shape, s->v, r.m * s->h, a0, vs[to]);
  const double *x_before = s->x, *v_before = s->v;
  double c_before = 0, c = r.m; /* times of the last two stages, by the same recurrence */
  for (int32_t j = 2; j <= stages; j++) {
    const double *x = xs[to], *v = vs[to];
    to = 1 - to;
    advance_recurrence(&r);
    s->c = c;
    ms_vector_three_term(shape, s->x, r.mu, x, r.nu, x_before, r.g * s->h, s->v, xs[to]);
    ms_vector_three_term(shape, s->v, r.mu, v, r.nu, v_before, r.g * s->h, a0, vs[to]);
    ms_stepper_evaluate(s, &(ms_fused_step){.x = x,
                                            .v = v,
                                            .v_to = vs[to],
                                            .v_from = vs[to],
                                            .h = r.m * s->h,
                                            .x_to = xs[to],
                                            .x_from = xs[to],
                                            .along = v,
                                            .drift = r.m * s->h});
    x_before = x, v_before = v;
    c = r.mu * s->c + r.nu * c_before + r.m + r.g;
    c_before = s->c;
  }
  ms_stepper_reflect(s, s->x_next, s->v_next);
  s->cached_stage_next = 0;
  if (!s->one_substep) return MSIM_OK;
  ms_vector_copy(shape, present_vectors(s)[IMAGE], next_vectors(s)[IMAGE]);
  s->cached_stage_next = s->cached_stage == 2 ? 1 : 2;
  return MSIM_OK;
}

/* The error estimate of Sommeijer, Shampine and Verwer, (12 (y - y') + 6 h (f + f'))/15. That of a
 * step that needs more stages than there may be is NaN, as it amplifies rounding errors. */
static void rkc_estimate(ms_stepper *s, int which, double *dx, double *dv) {
  (void)which;
  const ms_shape shape = s->model->state_shape;
  const double factor = s->h > longest_step(&s->bounds) ? NAN : 0.8;
  s->c = 1;
  const double *a0 = present_vectors(s)[A0];
  double *a = next_vectors(s)[A0];
  ms_stepper_acceleration(s, s->x_next, s->v_next, a);
  ms_vector_add_two_scaled(shape, s->x, -1, s->x_next, s->h / 2, s->v, dx);
  ms_vector_axpy(shape, s->h / 2, s->v_next, dx);
  ms_vector_scale(shape, factor, dx);
  ms_vector_add_two_scaled(shape, s->v, -1, s->v_next, s->h / 2, a0, dv);
  ms_vector_axpy(shape, s->h / 2, a, dv);
  ms_vector_scale(shape, factor, dv);
}

/* h w^2 <= MS_RKC_STRIP g for every mode (rkc.h). */
static double rkc_limit(const ms_bounds *b) {
  return fmin(b->omega > 0 ? MS_RKC_STRIP / b->ratio : INFINITY, longest_step(b));
}

const ms_integrator ms_rkc = {
    .entry = {.name = "rkc",
              .doc = "Runge-Kutta-Chebyshev; the number of stages follows the damping and grows as "
                     "sqrt(h); undamped motion gains energy (Sommeijer, Shampine, Verwer 1998)",
              .order = 2},
    .nwork = NWORK,
    .carried = 2,
    .carried_at = CARRIED,
    .start = rkc_start,
    .step = rkc_step,
    .estimate = rkc_estimate,
    .limit = rkc_limit,
    .needs_bounds = 1,
    .stages = ms_rkc_count_stages};
