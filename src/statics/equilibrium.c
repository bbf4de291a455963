/* equilibrium - the state of rest near the present one (msim_sim_equilibrium)
 *
 * Pseudo-transient continuation (Kelley and Keyes 1998): each iteration is a step of
 * static_step.h, which reduces the elastic and potential energy U. Short steps follow the steepest
 * descent of U in the norm of M, so that the minimum nearby is found; long ones are those of
 * Newton's method on U, with a rest of inertia that bounds motions which meet no stiffness, as of
 * slack cables.
 *
 * Newton's method also converges to equilibria that are no minimum, as a straight column under its
 * buckling load. So M + h^2 K, with the contacts and the curvature of obstacles, is factored at the
 * end: if it is not positive definite, the search continues from a small displacement along the
 * motion with the most negative stiffness. */
#include <math.h>
#include <string.h>

#include "base/sized.h"
#include "base/vec3.h"
#include "contact/contact_curvature.h"
#include "physics/bounds.h"
#include "physics/law.h"
#include "statics/static_step.h"
#include "statics/static_sim.h"
#include "statics/support.h"

typedef struct search {
  msim_sim *of;     /* whose equilibrium is wanted */
  msim_sim *sim;    /* static_sim.h */
  double *x;        /* 3n: the present positions */
  double *force;    /* 3n: that nothing balances there */
  double h, radius; /* of the next step (static_step.h) */
  double length;    /* m: mean_length() at the start */
  double omega;     /* 1/s: a bound of the highest frequency */
  double accepted;  /* N: the largest force at the end of the search */
  int32_t most;     /* iterations of Newton's method */
  msim_equilibrium result;
} search;

/* The largest force; those on pinned particles are 0. */
static void measure_forces(search *s) {
  const ms_scene *scene = s->sim->scene;
  s->result.force = 0;
  for (int32_t p = 0; p < scene->nparticles; p++) {
    const double force = ms_vec3_norm(s->force + 3 * (size_t)p);
    if (force > s->result.force) s->result.force = force, s->result.particle = p;
  }
}

/* The force on each particle in x: the sum of all forces, less what reactions and friction of
 * contacts balance at rest. */
static msim_status find_forces(search *s, msim_error *err) {
  const ms_scene *scene = s->sim->scene;
  ms_stepper *stepper = &s->sim->islands->stepper;
  if (!ms_scene_has_obstacles(scene)) msim_sim_force(s->sim, s->x, scene->v, s->force);
  else {
    const msim_status status = ms_static_sim_start(s->sim, s->x, s->h, err);
    if (status) return status;
    ms_contact_set_find_acceleration(stepper, stepper->work[0]);
    ms_unknowns_scatter(&s->sim->islands->model.unknowns, stepper->work[0], s->force);
    for (size_t i = 0; i < 3 * (size_t)scene->nparticles; i++)
      s->force[i] = scene->pinned[i / 3] ? 0 : scene->mass[i / 3] * s->force[i];
  }
  measure_forces(s);
  return MSIM_OK;
}

static double distance(const double *x, const double *y) {
  double d[3];
  memcpy(d, y, sizeof d);
  ms_vec3_axpy(-1, x, d);
  return ms_vec3_norm(d);
}

/* The mean length of springs, at present or at rest, and of the edges of angular springs; without
 * any, 1 m */
static double mean_length(const search *s) {
  const ms_scene *scene = s->sim->scene;
  const int64_t edges = (int64_t)scene->nsprings + 2 * (int64_t)scene->angles.n;
  double sum = 0;
  for (size_t e = 0; e < (size_t)scene->nsprings; e++) {
    const int32_t *ij = scene->ij + 2 * e;
    const double present = distance(s->x + 3 * (size_t)ij[0], s->x + 3 * (size_t)ij[1]);
    sum += fmax(present, scene->rest[e]);
  }
  for (size_t e = 0; e < (size_t)scene->angles.n; e++) {
    const int32_t *ijk = scene->angles.ijk + 3 * e;
    const double *middle = s->x + 3 * (size_t)ijk[1];
    sum +=
        distance(s->x + 3 * (size_t)ijk[0], middle) + distance(middle, s->x + 3 * (size_t)ijk[2]);
  }
  return sum > 0 ? sum / (double)edges : 1;
}

static int32_t iterations_left(const search *s) { return s->most - s->result.iterations; }

/* MSIM_NOT_CONVERGED: the search follows a body past all obstacles, or a particle that nothing
 * holds, as a spring that only pushes lets it go: it is FAR from its start. */
static msim_status check_distance(const search *s, msim_error *err) {
  const double FAR = 1e8 * s->length;
  const ms_scene *scene = s->sim->scene;
  if (ms_scene_has_obstacles(scene)) {
    const msim_status status = ms_support_check(scene, s->x, s->accepted, err);
    if (status) return status;
  }
  for (int32_t p = 0; p < scene->nparticles; p++) {
    const double moved = distance(s->sim->scene->x + 3 * (size_t)p, s->x + 3 * (size_t)p);
    if (moved > FAR)
      return ms_error_set(
          err, MSIM_NOT_CONVERGED,
          "there is no equilibrium near the start: particle %d moves away, by %.3g m "
          "so far, and %.3g N are left on particle %d",
          p, moved, s->result.force, s->result.particle);
  }
  return MSIM_OK;
}

/* MSIM_NOT_CONVERGED: there a spring breaks. */
static msim_status check_springs(const search *s, msim_error *err) {
  const ms_scene *scene = s->sim->scene;
  for (int32_t e = 0; e < scene->nsprings; e++) {
    const int32_t *ij = scene->ij + 2 * (size_t)e;
    const ms_law *law = ms_scene_law(scene, e);
    if (!law || ms_scene_is_broken(scene, e) || (scene->pinned[ij[0]] && scene->pinned[ij[1]]))
      continue;
    const double length = distance(s->x + 3 * (size_t)ij[0], s->x + 3 * (size_t)ij[1]);
    const double stretch = length - scene->rest[e], force = ms_law_value_of(scene, e, length).force;
    if (ms_law_exceeds_threshold(law, stretch, force, scene->rest[e]))
      return ms_error_set(err, MSIM_NOT_CONVERGED,
                          "there is no equilibrium near the start: spring %d would break, as it is "
                          "stretched by %.3g m and pulls with %.3g N where forces balance; break "
                          "it, or raise break_strain or break_force of its law",
                          e, stretch, force);
  }
  return MSIM_OK;
}

/*------------------------------------- minima ---------------------------------------------------*/

/* h of the test of a minimum. With h = 1e5/omega, negative eigenvalues of K above -1e-10 of the
 * largest one are not distinguished from 0, as those of mechanisms are up to the forces that are
 * left. Conjugate gradients have the matrix in single precision. */
static double longest_step(const search *s) {
  const ms_linear *linear = s->sim->islands->stepper.solver->linear;
  return (linear->factorizes ? 1e5 : 1e3) / s->omega;
}

/* v = the motion with the most negative stiffness, by the power method on (M + h^2 K)^-1 M, whose
 * largest eigenvalue 1/(1 + h^2 w^2) belongs to it, with the first h of longest_step()/2, /4,
 * ... for which that matrix is positive definite. b: the first vector, scratch afterwards */
static msim_status find_unstable_motion(search *s, double *b, double *v, msim_error *err) {
  enum { ITERATIONS = 30 };
  const ms_model *model = s->sim->islands->stepper.model;
  s->h = longest_step(s) / 2;
  msim_status status = ms_static_sim_solve_definite(s->sim, &s->h, b, v, err);
  for (int i = 0; i < ITERATIONS && !status; i++) {
    ms_vector_scale(model->shape, 1 / sqrt(ms_vector_dot(model->shape, v, v)), v);
    ms_vector_scale_rows(model->shape, model->mass, v, b);
    status = ms_static_sim_solve_again(s->sim, b, v, err);
  }
  return status;
}

/* Displace the particles along v by at most a hundredth of the length of springs. */
static void leave_saddle(search *s, double *v) {
  const ms_scene *scene = s->sim->scene;
  double largest = 0;
  ms_unknowns_scatter(&s->sim->islands->model.unknowns, v, s->force);
  for (int32_t p = 0; p < scene->nparticles; p++)
    if (!scene->pinned[p]) largest = fmax(largest, ms_vec3_norm(s->force + 3 * (size_t)p));
  const double scale = 0.01 * s->length / largest;
  for (size_t i = 0; i < 3 * (size_t)scene->nparticles; i++)
    if (!scene->pinned[i / 3]) s->x[i] += scale * s->force[i];
  s->result.saddles++;
}

/* 1: the matrix of the sim, at rest in x, with the constraints by contacts that are found, is that
 * of all small motions: friction excludes none, and curvature is exact. */
static int find_contacts(const search *s) {
  ms_stepper *stepper = &s->sim->islands->stepper;
  double *const x = stepper->x, *const v = stepper->v;
  if (!ms_scene_has_obstacles(s->sim->scene)) return 1;
  ms_contact_curvature_update(stepper);
  stepper->x = x, stepper->v = v;
  for (int32_t i = 0; i < stepper->events->ncontacts; i++)
    if (stepper->events->contact[i].has_friction) return 0;
  return ms_contact_curvature_constrain(stepper, -INFINITY, &(ms_linear_system_spec){.h = s->h});
}

/* *left: the equilibrium was no minimum, and x has moved away from it. */
static msim_status check_minimum(search *s, int *left, msim_error *err) {
  ms_stepper *stepper = &s->sim->islands->stepper;
  const double longest = longest_step(s);
  double *b = stepper->work[0], *v = stepper->work[1];
  *left = s->result.is_minimum = 0;
  msim_status status = ms_static_sim_start(s->sim, s->x, longest, err);
  if (status || !find_contacts(s)) return status;
  ms_vector_fill_random(stepper->model->shape, 0, b);
  status = ms_static_sim_solve(s->sim, longest, b, v, err);
  s->result.is_minimum = !status;
  if (status == MSIM_NOT_CONVERGED) return MSIM_OK;
  if (status != MSIM_NOT_SPD) return status;
  status = find_unstable_motion(s, b, v, err);
  if (!status) leave_saddle(s, v);
  *left = 1;
  return status;
}

/*------------------------------------- search ---------------------------------------------------*/

/* After MSIM_NOT_CONVERGED the next step is shorter. */
static msim_status make_step(search *s, msim_error *err) {
  ms_static_step step = {
      .h = s->h, .radius = s->radius, .length = s->length, .most = iterations_left(s)};
  const msim_status status = ms_static_step_make(&step, s->sim, s->x, err);
  s->h = step.h, s->radius = step.radius;
  s->result.iterations += step.solves;
  return status;
}

static msim_status fail(const search *s, msim_error *err) {
  return ms_error_set(err, MSIM_NOT_CONVERGED,
                      "no equilibrium was found in %d iterations of Newton's method: %.3g N are "
                      "left on particle %d, and %.3g N are accepted; allow more iterations, or "
                      "check that the particles are supported",
                      s->result.iterations, s->result.force, s->result.particle, s->accepted);
}

static double first_step(const search *s) { return 10 / s->omega; }

/* h within [LEAST, MOST] of its first value */
static msim_status find_equilibrium(search *s, int is_last, msim_error *err) {
  const double MOST = 1e8, LEAST = 1e-8, first = first_step(s);
  for (;;) {
    int left = 0;
    msim_status status = ms_static_sim_check_stop(s->of, err);
    if (!status) status = find_forces(s, err);
    if (!status) status = check_distance(s, err);
    const int is_small = s->result.force <= s->accepted;
    if (!status && is_small && is_last) status = check_minimum(s, &left, err);
    if (status || (is_small && !left)) return status;
    if (iterations_left(s) == 0 || s->h < LEAST * first) return fail(s, err);
    status = make_step(s, err);
    s->h = fmin(s->h, MOST * first);
    if (status < 0) return status;
  }
}

/* Start at the present state, if bodies are supported. */
static msim_status begin_search(search *s, msim_error *err) {
  const ms_scene *scene = s->sim->scene;
  const size_t n = 3 * (size_t)scene->nparticles;
  ms_bounds bounds;
  if (!MS_NEW(&scene->alloc, s->x, n) || !MS_NEW(&scene->alloc, s->force, n))
    return ms_error_set_memory(err, "the equilibrium");
  const msim_status status = ms_bounds_compute(scene, 0, &bounds, err);
  if (status) return status;
  s->omega = bounds.omega > 0 ? bounds.omega : 1;
  s->h = first_step(s);
  memcpy(s->x, scene->x, n * sizeof *s->x);
  s->length = s->radius = mean_length(s);
  msim_sim_force(s->sim, s->x, scene->v, s->force);
  measure_forces(s);
  return ms_support_check(scene, s->x, s->accepted, err);
}

/* Conjugate gradients find the way in far less time than a direct solver, which is needed for the
 * last digits, and to recognize a minimum. */
static msim_status run_search(search *s, msim_error *err) {
  const double ROUGH = 1e-4, accepted = s->accepted;
  msim_status status = ms_static_sim_create(s->of, MS_STATIC_FAST, &s->sim, err);
  if (!status) status = begin_search(s, err);
  if (status) return status;
  s->accepted = fmax(accepted, ROUGH * s->result.force);
  status = find_equilibrium(s, 0, err);
  if (status < 0 || status == MSIM_STOPPED) return status;
  msim_sim_destroy(s->sim);
  s->accepted = accepted;
  status = ms_static_sim_create(s->of, MS_STATIC_EXACT, &s->sim, err);
  if (!status) status = find_equilibrium(s, 1, err);
  return status ? status : check_springs(s, err);
}

static msim_status check_scene(const msim_sim *sim, msim_error *err) {
  if (ms_scene_has_self_contact(sim->scene))
    return ms_error_set(
        err, MSIM_ERR_UNSUPPORTED,
        "msim_sim_equilibrium does not support self_contact; remove it, or run with "
        "damping until the scene is at rest");
  return ms_static_sim_check(sim, "msim_sim_equilibrium", err);
}

static msim_status take_state(const search *s, msim_error *err) {
  msim_state now = {.size = sizeof now};
  msim_sim_state(s->of, &now);
  now.x = s->x, now.v = s->sim->scene->v, now.v_half = NULL;
  return msim_sim_set_state(s->of, &now, err);
}

msim_status msim_sim_equilibrium(msim_sim *sim, double ftol, int32_t max_iterations,
                                 msim_equilibrium *result, msim_error *err) {
  if (!sim || !(ftol > 0) || max_iterations < 1)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "sim is NULL, or ftol = %g or max_iterations = %d is not > 0", ftol,
                        max_iterations);
  search s = {
      .of = sim, .accepted = ftol, .most = max_iterations, .result = {.size = sizeof s.result}};
  msim_status status = check_scene(sim, err);
  if (!status) status = run_search(&s, err);
  if (!status && result && ms_sized_write(result, &s.result, sizeof s.result))
    status = ms_error_set(err, MSIM_ERR_SIZE, "result.size is %zu; it must be %zu", result->size,
                          sizeof s.result);
  if (!status) status = take_state(&s, err);
  MS_FREE(&sim->alloc, s.x, s.force);
  msim_sim_destroy(s.sim);
  return status ? status : ms_error_clear(err);
}
