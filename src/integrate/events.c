#include "integrate/events.h"

#include "integrate/constrain.h"
#include "integrate/locate.h"

msim_status ms_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  if (!s->events) return method->step(s, err);
  s->events->replays = method->replays && !s->one_part;
  if (s->events->replays) return method->step(s, err);
  const int is_stiff = method->entry.implicit && s->h * ms_bounds_of(s->model).omega > 2;
  return is_stiff ? ms_constrain_step(method, s, err) : ms_locate_step(method, s, err);
}
