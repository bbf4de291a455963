/* implicit - the nonlinear implicit methods, each given by its coefficients
 *
 * A method has one or two stages of the form
 *   Y = known + a h f(Y),   y = (x, v), f = (v, a(x, v)),
 * where the known part combines the present y, h f(y), the y of the step before, and the first
 * stage. */
#include "methods/methods.h"
#include "integrate/newton.h"
#include "integrate/rigid_guess.h"
#include "physics/force_function.h"

typedef struct stage_coefficients {
  double a;
  double slope, before, first; /* weights in the known part of h f(y), the y of the step before and
                                  the first stage; the weight of y is 1 - before - first */
} stage_coefficients;

typedef struct tableau {
  int nstages;
  stage_coefficients stage[2];
  int is_middle; /* 1: the stage is the mean of y and the result; 0: the last stage is the result */
} tableau;

/* Work vectors: those of Newton's method, the known parts of x and v, then the method's own */
enum { NEWTON, X0 = 4, W, OWN_WORK };

/* Vectors that a stage may combine beside y; NULL: not used by the method */
typedef struct stage_inputs {
  const double *a, *x_before, *v_before, *x_first, *v_first;
} stage_inputs;

/* known += weight (other - y), which is exactly 0 at rest */
static void add_difference(const ms_stepper *s, double weight, const double *other, const double *y,
                           double *known) {
  if (weight == 0) return;
  ms_vector_add_scaled(s->model->shape, other, -1, y, s->scratch);
  ms_vector_axpy(s->model->shape, weight, s->scratch, known);
}

/* The known parts x0 and w of a stage */
static void form_known_parts(const ms_stepper *s, const stage_coefficients *g,
                             const stage_inputs *from) {
  const ms_shape shape = s->model->shape;
  double *x0 = s->work[X0], *w = s->work[W];
  ms_vector_copy(shape, s->x, x0);
  ms_vector_copy(shape, s->v, w);
  if (g->slope != 0) {
    ms_vector_axpy(shape, g->slope * s->h, s->v, x0);
    ms_vector_axpy(shape, g->slope * s->h, from->a, w);
  }
  add_difference(s, g->before, from->x_before, s->x, x0);
  add_difference(s, g->before, from->v_before, s->v, w);
  add_difference(s, g->first, from->x_first, s->x, x0);
  add_difference(s, g->first, from->v_first, s->v, w);
}

/* The acceleration at the last stage, a' = (v' - w)/(a h) */
static void find_stage_acceleration(const ms_stepper *s, double a, double *slope) {
  ms_vector_add_scaled(s->model->shape, s->v_next, -1, s->work[W], slope);
  ms_vector_scale(s->model->shape, 1 / (a * s->h), slope);
}

/* The time of a stage as a share of the step: the same combination of the known times; the first
 * stage is at `first`, the step before began at -1/r */
static double find_stage_time(const ms_stepper *s, const stage_coefficients *g, double first) {
  const double before = g->before != 0 ? -g->before * s->h_before / s->h : 0;
  return g->a + g->slope + before + g->first * first;
}

/* Solves the stages; writes the result to x_next and v_next, not yet reflected. The initial guess
 * of a stage is the velocity of the one before, as a rigid body would go on. */
static msim_status solve_stages(ms_stepper *s, const tableau *t, stage_inputs *from,
                                double *keep_first[2], msim_error *err) {
  const ms_shape shape = s->model->shape;
  double time = 0; /* of v_next, as a share of the step */
  ms_vector_copy(shape, s->v, s->v_next);
  for (int i = 0; i < t->nstages; i++) {
    ms_newton_stage stage = {.ah = t->stage[i].a * s->h,
                             .x0 = s->work[X0],
                             .w = s->work[W],
                             .x = s->x_next,
                             .v = s->v_next};
    for (int k = 0; k < 4; k++) stage.work[k] = s->work[NEWTON + k];
    form_known_parts(s, &t->stage[i], from);
    s->c = find_stage_time(s, &t->stage[i], time);
    ms_rigid_guess_advance(s, (s->c - time) * s->h, &stage);
    time = s->c;
    const msim_status status = ms_newton_solve(s, &stage, err);
    if (status) return status;
    if (i + 1 == t->nstages) break;
    ms_vector_copy(shape, s->x_next, keep_first[0]);
    ms_vector_copy(shape, s->v_next, keep_first[1]);
    from->x_first = keep_first[0], from->v_first = keep_first[1];
  }
  if (t->is_middle) {
    ms_vector_add_scaled(shape, s->x, s->h, s->v_next, s->x_next);
    ms_vector_scale(shape, 2, s->v_next);
    ms_vector_axpy(shape, -1, s->v, s->v_next);
  }
  return MSIM_OK;
}

static msim_status reflect_result(ms_stepper *s, msim_status status) {
  if (!status) ms_stepper_reflect(s, s->x_next, s->v_next);
  return status;
}

/*------------------------------------- one stage ------------------------------------------------*/

static const tableau implicit_euler = {1, {{.a = 1}}, 0};
static const tableau implicit_midpoint = {1, {{.a = 0.5}}, 1};
static const tableau trapezoidal = {1, {{.a = 0.5, .slope = 0.5}}, 0};

static msim_status step_implicit_euler(ms_stepper *s, msim_error *err) {
  return reflect_result(s, solve_stages(s, &implicit_euler, &(stage_inputs){0}, NULL, err));
}

static msim_status step_implicit_midpoint(ms_stepper *s, msim_error *err) {
  return reflect_result(s, solve_stages(s, &implicit_midpoint, &(stage_inputs){0}, NULL, err));
}

static msim_status step_trapezoidal(ms_stepper *s, msim_error *err) {
  double *a = s->work[OWN_WORK];
  ms_stepper_acceleration(s, s->x, s->v, a);
  return reflect_result(s, solve_stages(s, &trapezoidal, &(stage_inputs){.a = a}, NULL, err));
}

/* Compute a anew, to be carried; where the force function fails, it is none to be carried. */
static void renew_acceleration(ms_stepper *s, double *a) {
  ms_stepper_acceleration(s, s->x, s->v, a);
  if (s->model->function && s->model->function->status) s->cached_stage = 0;
}

/* beta = 1/4, gamma = 1/2: the trapezoidal rule with a carried from step to step, not computed
 * anew. cached_stage: 1 + the index, from OWN_WORK on, of the work vector that holds a. */
static msim_status step_newmark(ms_stepper *s, msim_error *err) {
  const int at = s->cached_stage == 2;
  double *a = s->work[OWN_WORK + at], *next = s->work[OWN_WORK + 1 - at];
  if (!s->cached_stage || s->h != s->h_before) renew_acceleration(s, a);
  msim_status status = solve_stages(s, &trapezoidal, &(stage_inputs){.a = a}, NULL, err);
  if (status) return status;
  find_stage_acceleration(s, trapezoidal.stage[0].a, next);
  s->cached_stage_next = ms_stepper_reflect(s, s->x_next, s->v_next) ? 0 : 2 - at;
  return MSIM_OK;
}

/*------------------------------------- two steps ------------------------------------------------*/

/* gamma = 2 - sqrt 2: the trapezoidal rule to t + gamma h, then the backward differentiation
 * formula of order 2 over both parts of the step (Bank et al. 1985; Hosea and Shampine 1996) */
#define TR_BDF2_GAMMA 0.58578643762690495
static const tableau tr_bdf2 = {
    2,
    {{.a = TR_BDF2_GAMMA / 2, .slope = TR_BDF2_GAMMA / 2},
     {.a = TR_BDF2_GAMMA / 2, .first = 1 / (TR_BDF2_GAMMA * (2 - TR_BDF2_GAMMA))}},
    0};

/* r = h/h_before: of order 2 for any r, stable for r < 1 + sqrt 2 (Grigorieff 1983).
 * r = 1: y' = 4/3 y - 1/3 y_before + 2/3 h f(y') */
static tableau bdf2_tableau(double r) {
  return (tableau){1, {{.a = (1 + r) / (1 + 2 * r), .before = -(r * r) / (1 + 2 * r)}}, 0};
}

/* The first step, and a step after a reflection, which cannot use the step before. A fixed step is
 * one of implicit Euler, as usual for this method. Under error control its order 1 would determine
 * the length, and with collision = event its error would be the largest: then a step of tr-bdf2
 * takes its place. start: gets the first stage and the slope at the start. */
static msim_status restart_bdf2(ms_stepper *s, double **start, double *last_a, msim_error *err) {
  if (s->opt->tol == 0 && (!s->events || s->opt->collision == MSIM_COLLISION_REFLECT)) {
    *last_a = implicit_euler.stage[0].a;
    return solve_stages(s, &implicit_euler, &(stage_inputs){0}, NULL, err);
  }
  *last_a = tr_bdf2.stage[1].a;
  ms_stepper_acceleration(s, s->x, s->v, start[2]);
  return solve_stages(s, &tr_bdf2, &(stage_inputs){.a = start[2]}, start, err);
}

/* cached_stage: 1 + the index of the set of work vectors with x and v at the start of the last
 * step, and a at its end. */
static msim_status step_bdf2(ms_stepper *s, msim_error *err) {
  const ms_shape shape = s->model->shape;
  const int at = s->cached_stage == 2;
  double **before = s->work + OWN_WORK + 3 * at, **now = s->work + OWN_WORK + 3 * (1 - at);
  const tableau this_tableau = bdf2_tableau(s->cached_stage ? s->h / s->h_before : 1);
  double last_a = this_tableau.stage[0].a;
  msim_status status =
      s->cached_stage
          ? solve_stages(s, &this_tableau,
                         &(stage_inputs){.x_before = before[0], .v_before = before[1]}, NULL, err)
          : restart_bdf2(s, before, &last_a, err);
  if (status) return status;
  ms_vector_copy(shape, s->x, now[0]);
  ms_vector_copy(shape, s->v, now[1]);
  find_stage_acceleration(s, last_a, now[2]);
  s->cached_stage_next = ms_stepper_reflect(s, s->x_next, s->v_next) ? 0 : 2 - at;
  return MSIM_OK;
}

/* error = share (y' - p),  share = (1 + r)/(2 + 3 r),  p = y + (1 + r) h f + r^2 (y_before - y),
 * r = h/h_before */
static void compare_extrapolation(const ms_stepper *s, const double *y, const double *f,
                                  const double *before, const double *y_next, double *error) {
  const double r = s->h / s->h_before;
  const ms_shape shape = s->model->shape;
  ms_vector_add_scaled(shape, y_next, -1, y, error);
  ms_vector_axpy(shape, -(1 + r) * s->h, f, error);
  add_difference(s, -r * r, before, y, error);
  ms_vector_scale(shape, (1 + r) / (2 + 3 * r), error);
}

/* h (e_1 f + e_2 f_1 + e_3 f'), e = ((sqrt 2 - 1)/3, -1/3, (2 - sqrt 2)/3): the difference from the
 * formula of order 3 with the same stages (Hosea and Shampine 1996). start: x and v of the first
 * stage, and a at the start of the step; h a_1 = 2 (v_1 - v)/gamma - h a at the first stage. */
static void estimate_tr_bdf2(const ms_stepper *s, double *const *start, const double *a_next,
                             double *dx, double *dv) {
  const ms_shape shape = s->model->shape;
  const double E1 = 0.13807118745769836, E2 = -1. / 3, E3 = 0.19526214587563498, h = s->h;
  const double of_x[] = {E1 * h, E2 * h, E3 * h};
  const double of_v[] = {(E1 - E2) * h, 2 * E2 / TR_BDF2_GAMMA, -2 * E2 / TR_BDF2_GAMMA, E3 * h};
  const double *const vs[] = {s->v, start[1], s->v_next};
  const double *const as[] = {start[2], start[1], s->v, a_next};
  ms_vector_linear_combination(shape, NULL, 3, of_x, vs, dx);
  ms_vector_linear_combination(shape, NULL, 4, of_v, as, dv);
}

/* p extrapolates the parabola through y_before and y that has the slope f in y, as the last step
 * found it. Its error is -(1 + 1/r) e, that of the method (1 + r)^2/(r (1 + 2 r)) e, with
 * e = h^3/6 d3y/dt3: the share (1 + r)/(2 + 3 r) of the difference is the error of the method. */
static void estimate_bdf2(ms_stepper *s, int which, double *dx, double *dv) {
  (void)which;
  double *const *before = s->work + OWN_WORK + 3 * (s->cached_stage == 2);
  if (!s->cached_stage) {
    estimate_tr_bdf2(s, before, s->work[OWN_WORK + 5], dx, dv);
    return;
  }
  compare_extrapolation(s, s->x, s->v, before[0], s->x_next, dx);
  compare_extrapolation(s, s->v, before[2], before[1], s->v_next, dv);
}

/*------------------------------------- two stages -----------------------------------------------*/

/* gamma = 1 - 1/sqrt 2, stiffly accurate (Alexander 1977):
 *   Y1 = y + gamma h f(Y1),  y' = y + (1 - gamma) h f(Y1) + gamma h f(y'),
 *   and h f(Y1) = (Y1 - y)/gamma */
#define SDIRK2_GAMMA 0.29289321881345248
static const tableau sdirk2 = {
    2, {{.a = SDIRK2_GAMMA}, {.a = SDIRK2_GAMMA, .first = (1 - SDIRK2_GAMMA) / SDIRK2_GAMMA}}, 0};

static msim_status step_tr_bdf2(ms_stepper *s, msim_error *err) {
  double *a = s->work[OWN_WORK];
  ms_stepper_acceleration(s, s->x, s->v, a);
  return reflect_result(
      s, solve_stages(s, &tr_bdf2, &(stage_inputs){.a = a}, s->work + OWN_WORK + 1, err));
}

static msim_status step_sdirk2(ms_stepper *s, msim_error *err) {
  return reflect_result(s, solve_stages(s, &sdirk2, &(stage_inputs){0}, s->work + OWN_WORK, err));
}

/*------------------------------------- methods --------------------------------------------------*/

#define METHOD(id, label, text, p, kept, carries)                                                  \
  const ms_integrator ms_##id = {.entry = {.name = label, .doc = text, .order = p, .implicit = 1}, \
                                 .nonlinear = 1,                                                   \
                                 .one_step = 1,                                                    \
                                 .nwork = OWN_WORK + (kept),                                       \
                                 .carried = carries,                                               \
                                 .carried_at = OWN_WORK,                                           \
                                 .step = step_##id}

METHOD(implicit_euler, "implicit-euler",
       "v' = v + h a(x', v'), x' = x + h v'; robust at long steps; damps all vibrations", 1, 0, 0);
METHOD(implicit_midpoint, "implicit-midpoint",
       "one stage at t + h/2, symplectic; conserves angular momentum", 2, 0, 0);
METHOD(trapezoidal, "trapezoidal", "v' = v + h/2 (a + a'), x' = x + h/2 (v + v')", 2, 1, 0);
METHOD(newmark, "newmark",
       "beta 1/4, gamma 1/2: the trapezoidal rule, with the acceleration kept from step to step "
       "(Newmark 1959)",
       2, 2, 1);
const ms_integrator ms_bdf2 = {
    .entry = {.name = "bdf2",
              .doc = "backward differentiation formula over two steps; damps stiff vibrations",
              .order = 2,
              .implicit = 1},
    .nonlinear = 1,
    .nwork = OWN_WORK + 6,
    .carried = 3,
    .carried_at = OWN_WORK,
    .step = step_bdf2,
    .estimate = estimate_bdf2,
    .growth = 2,
    .safety = 0.95};
METHOD(tr_bdf2, "tr-bdf2",
       "trapezoidal rule to t + (2 - sqrt 2) h, then BDF2; damps stiff vibrations (Bank 1985)", 2,
       3, 0);
METHOD(sdirk2, "sdirk2",
       "two implicit stages, gamma = 1 - 1/sqrt 2; damps stiff vibrations (Alexander 1977)", 2, 2,
       0);
