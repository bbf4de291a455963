#include "base/clock.h"
#include "integrate/integrator.h"
#include "physics/planes.h"

void ms_acceleration(ms_stepper *s, const double *x, const double *v, double *a) {
  double start = ms_clock();
  ms_force(s->model, x, v, a);
  ms_scale_rows(s->model->shape, s->model->inv_mass, a, a);
  s->stats->force_evaluations++;
  s->stats->force_s += ms_clock() - start;
}

int64_t ms_reflect(ms_stepper *s, double *x, double *v) {
  if (!(s->model->passes & MSIM_SKIP_PLANES)) return 0;
  double start = ms_clock();
  int64_t reflected = ms_planes_reflect(s->model, x, v);
  s->stats->contacts += reflected;
  s->stats->collide_s += ms_clock() - start;
  return reflected;
}
