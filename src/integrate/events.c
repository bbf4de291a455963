#include "integrate/events.h"

#include "integrate/constrain.h"
#include "integrate/locate.h"

static void begin(const ms_integrator *method, ms_stepper *s) {
  ms_events *e = s->events;
  e->known = s->warm & MS_NOTED;
  if (!e->known) e->held = 0;
  e->implicit = method->entry.implicit;
  e->merge = 1e-11 * e->reach;
  e->sums = 0;
  e->nfollowed = 0;
  s->warm &= ~MS_NOTED;
  s->impact = MS_NOWHERE;
  s->path_error = 0, s->npaths = 0;
}

msim_status ms_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  if (!s->events) return method->step(s, err);
  begin(method, s);
  s->events->replays = method->replays && !s->one_part;
  if (s->events->replays) s->events->ncontacts = 0; /* left by a step of ms_locate_step() */
  if (s->events->replays) return method->step(s, err);
  const int is_stiff = method->entry.implicit && s->h * ms_bounds_of(s->model).omega > 2;
  double *x = s->x, *v = s->v;
  const double h = s->h;
  const msim_status status =
      is_stiff ? ms_constrain_step(method, s, err) : ms_locate_step(method, s, err);
  s->events->moved = !is_stiff && s->x != x;
  s->x = x, s->v = v, s->h = h;
  return status;
}
