/* linearly_implicit_euler - implicit Euler with one Newton iteration: one linear system a step */
#include <math.h>

#include "methods/methods.h"
#include "physics/external_force.h"
#include "physics/force_function.h"
#include "physics/rank_model.h"
#include "physics/single.h"

/* The step without springs, by independent equations, with the drag b and the constant force F:
 *   (m + h b) v' = m v + h (m g + F),  x' = x + h v' */
static void step_without_springs(ms_stepper *s) {
  const ms_unknowns *rows = &s->model->unknowns;
  const double *mass = s->model->mass, h = s->h;
  const double drag = ms_external_matrix(&s->model->external, h);
  for (size_t c = 0; c < (size_t)rows->dims; c++) {
    const size_t at = c * (size_t)rows->stride;
    const double *restrict x = s->x + at, *restrict v = s->v + at,
                           *restrict force = s->model->force ? s->model->force + at : NULL,
                           g = s->model->external.gravity[rows->axis[c]];
    double *restrict x_next = s->x_next + at, *restrict v_next = s->v_next + at;
    for (int32_t r = 0; r < rows->nfree; r++) {
      const double kick = h * (force ? g + force[r] / mass[r] : g);
      v_next[r] = drag > 0 ? mass[r] * (v[r] + kick) / (mass[r] + drag) : v[r] + kick;
      x_next[r] = x[r] + h * v_next[r];
    }
  }
  ms_stepper_reflect(s, s->x_next, s->v_next);
}

/* v' = v + dv, where dv may be in v'. In single precision dv is rounded to floats, in `room`, and
 * those of pinned particles and padding in v', which dv may have overwritten, are as in v. */
static void add_change(ms_stepper *s, const double *dv, double *room) {
  const ms_shape shape = s->model->state_shape;
  const void *change = ms_single_round(s->model, dv, room);
  if (s->model->single) ms_vector_copy_all(shape, s->v, s->v_next);
  ms_vector_add_scaled(shape, s->v, 1, change, s->v_next);
}

/* (M - h D - h^2 J) dv = h F(x) + (h D + h^2 J) v,  v' = v + dv,  x' = x + h v'
 * J, D at x; F without the forces that depend on v, which h D v contains; but F at the position and
 * velocity at the end of the step for pinned particles that move; of a force function f, F contains
 * f(t + h, x, v), and h^2 df/dx v is added. This is the first Newton
 * iterate of implicit Euler from v' = 0, (M - h D - h^2 J) v' = M v + h F (Teschner), solved for
 * the change of v (Baraff and Witkin 1998, eq. 6): so the tolerance of the solver is relative to
 * the change in the step, for any common velocity of the particles.
 * In single precision x, v and F are floats, and the system has doubles. dv is in the memory of v',
 * unless contact reads it afterwards (implicit_impulses.h). */
static msim_status linearly_implicit_euler_step(ms_stepper *s, msim_error *err) {
  if (!(s->model->features & MS_HAS_SPRINGS) && !ms_stepper_has_contacts(s) &&
      !s->model->function && !s->model->single) {
    step_without_springs(s);
    return MSIM_OK;
  }
  const ms_shape shape = s->model->state_shape;
  double *dv = s->events ? s->work[0] : s->v_next, *b = s->scratch;
  double *v_pinned = ms_rank_model_may_have_motions(s->model) ? b : NULL;
  if (v_pinned) ms_vector_clear_all(shape, b), s->c = 1;
  if (s->model->function) s->c = 1;
  ms_stepper_evaluate(s, &(ms_fused_step){.x = s->x, .v = v_pinned, .function_v = s->v, .a = dv});
  ms_single_weigh(s->model, s->h, dv, b);
  ms_stepper_linearize(s, s->x, s->v);
  if (s->model->function) ms_force_function_add_gradient(s->model, s->h * s->h, s->v, b);
  ms_linear_system_spec spec = {.x = ms_single_get_x(s->model, s->x),
                                .h = s->h,
                                .clamp = s->opt->jacobian == MSIM_JACOBIAN_CLAMP,
                                .indefinite = s->opt->indefinite,
                                .rtol = s->solve_tolerance > 0
                                            ? fmin(s->opt->solver_rtol, s->solve_tolerance)
                                            : s->opt->solver_rtol,
                                .base = ms_single_get_v(s->model, s->v)};
  ms_stepper_add_constraints(s, &spec);
  msim_status status = ms_solver_solve(s->solver, &spec, b, dv, err);
  s->offender = s->solver->offender;
  if (status) return status;
  s->incomplete |= s->solver->incomplete;
  add_change(s, dv, b);
  ms_vector_add_scaled(shape, s->x, s->h, s->v_next, s->x_next);
  ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

const ms_integrator ms_linearly_implicit_euler = {
    .entry = {.name = "linearly-implicit-euler",
              .doc = "(M - h D - h^2 J) v' = M v + h F, x' = x + h v'; one linear system a step; "
                     "damps vibrations, stable at long steps (Teschner)",
              .order = 1,
              .implicit = 1},
    .one_step = 1,
    .step = linearly_implicit_euler_step};
