#include "integrate/interpolate.h"

#include "physics/force_function.h"

void ms_interpolate_hermite(ms_shape shape, double h, double theta, const double *const ends[4],
                            double *y) {
  const double t = theta, rise = t * t * (3 - 2 * t);
  const double w[] = {-rise, rise, h * t * (1 - t) * (1 - t), h * t * t * (t - 1)};
  ms_vector_linear_combination(shape, ends[0], 4, w, ends, y);
}

/* The accelerations at both ends are computed by the first call, and stay in the second spare
 * pair. */
void ms_interpolate_cubic(ms_stepper *s, double theta, double *x, double *v) {
  const ms_shape shape = s->model->shape;
  double *a0 = s->x_spare[1], *a1 = s->v_spare[1];
  if (!s->dense_output) {
    s->c = 0;
    ms_stepper_acceleration(s, s->x_next, s->v_next, a0);
    s->c = 1;
    ms_stepper_acceleration(s, s->x, s->v, a1);
    s->dense_output = 1;
  }
  const double *const x_ends[] = {s->x_next, s->x, s->v_next, s->v};
  const double *const v_ends[] = {s->v_next, s->v, a0, a1};
  ms_interpolate_hermite(shape, s->h, theta, x_ends, x);
  ms_interpolate_hermite(shape, s->h, theta, v_ends, v);
}

/* Where the force function fails: the cubic interpolant of x, and the linear one of v. */
static void interpolate_without_forces(const ms_stepper *s, double theta, double *x, double *v) {
  const ms_shape shape = s->model->shape;
  const double *const x_ends[] = {s->x_next, s->x, s->v_next, s->v};
  ms_interpolate_hermite(shape, s->h, theta, x_ends, x);
  ms_vector_copy(shape, s->v_next, v);
  ms_vector_scale(shape, 1 - theta, v);
  ms_vector_axpy(shape, theta, s->v, v);
}

void ms_interpolate(const ms_integrator *integrator, ms_stepper *s, double theta, double *x,
                    double *v) {
  if (integrator->interpolate) integrator->interpolate(s, theta, x, v);
  else ms_interpolate_cubic(s, theta, x, v);
  if (s->model->function && s->model->function->status) interpolate_without_forces(s, theta, x, v);
}
