#include "integrate/methods.h"

/* (M - h D - h^2 J) v' = M v + h F(x),  x' = x + h v'
 * J, D at x; F without velocities, as h D v' stands on the left. The first Newton iterate of
 * implicit Euler from v' = 0 (Teschner; Baraff and Witkin 1998). */
static msim_status step(ms_stepper *s, msim_error *err) {
  const ms_shape shape = s->model->shape;
  double *b = s->work[0], *momentum = s->work[1];
  ms_acceleration(s, s->x, NULL, b);
  ms_combine(shape, s->v, s->h, b, b);
  ms_scale_rows(shape, s->model->mass, b, momentum);
  ms_copy(shape, s->v, s->v_next);
  msim_status status = ms_solver_solve(s->solver, s->x, s->h, momentum, s->v_next, err);
  s->culprit = s->solver->culprit;
  if (status) return status;
  ms_combine(shape, s->x, s->h, s->v_next, s->x_next);
  ms_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

const ms_integrator ms_linearly_implicit_euler = {
    .entry =
        {.name = "linearly-implicit-euler",
         .doc =
             "(M - h D - h^2 J) v' = M v + h F, x' = x + h v'; damps, takes long steps (Teschner)",
         .order = 1,
         .implicit = 1},
    .nwork = 2,
    .step = step};
