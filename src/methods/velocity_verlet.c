/* velocity_verlet - the velocity Verlet method */
#include <math.h>

#include "methods/methods.h"
#include "contact/verlet_contact.h"

/* x' = x + h v + h^2/2 a,  v' = v + h/2 (a + a(x', v + h a))
 *
 * If no force depends on v and no particle was reflected, the next step uses a(x') as its a, which
 * is the same number: one evaluation a step is sufficient. */
static msim_status velocity_verlet_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_shape shape = s->model->state_shape;
  const double h = s->h;
  const int at = s->cached_stage == 2,
            next = 1 - at; /* cached_stage: 1 + index of the work vector with a(x) */
  double *a = s->work[at], *a_next = s->work[next], *v_predicted = s->work[2];
  const int separable = ms_stepper_is_separable(s);
  if (!s->cached_stage) ms_stepper_acceleration(s, s->x, s->v, a);
  ms_vector_add_two_scaled(shape, s->x, h, s->v, h * h / 2, a, s->x_next);
  if (!separable) ms_vector_add_scaled(shape, s->v, h, a, v_predicted);
  ms_verlet_contact_correct_positions(s, a, v_predicted);
  s->c = 1;
  ms_stepper_evaluate(s, &(ms_fused_step){.x = s->x_next,
                                          .v = v_predicted,
                                          .a = a_next,
                                          .v_to = s->v_next,
                                          .v_from = s->v,
                                          .a_before = a,
                                          .h_before = h / 2,
                                          .h = h / 2});
  ms_verlet_contact_correct_velocities(s, a, a_next);
  int64_t reflected = ms_stepper_reflect(s, s->x_next, s->v_next);
  s->cached_stage_next = separable && !reflected ? 1 + next : 0;
  return MSIM_OK;
}

/* With p = h g, q = h^2 w^2 the matrix of a step has trace 2 - p - q + p^2/2 + p q/4, determinant
 * 1 - p + p^2/2 - p q/4, and is stable if  p <= 2  and  q < 4 - 2 p + p^2.  The right-hand side is
 * least, 3, at p = 1, which some mode may have if the largest p exceeds 1. This holds for modes
 * that damping and stiffness have in common; without such modes it held in each of 6000 random
 * systems. */
static double velocity_verlet_limit(const ms_bounds *b) {
  const double w = b->omega, g = b->rate;
  if (3 * g * g <= w * w) return 4 / (g + sqrt(4 * w * w - 3 * g * g));
  return fmin(sqrt(3) / w, 2 / g);
}

const ms_integrator ms_velocity_verlet = {
    .entry =
        {.name = "velocity-verlet",
         .doc =
             "x' = x + h v + h^2/2 a, v' = v + h/2 (a + a'); stable below h omega = 2 (Swope 1982)",
         .order = 2},
    .one_step = 1,
    .nwork = 3,
    .carried = 1,
    .handles_contact = 1,
    .step = velocity_verlet_step,
    .limit = velocity_verlet_limit};
