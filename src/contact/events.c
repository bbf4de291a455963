#include "contact/events.h"

#include <math.h>

#include "contact/implicit_contact.h"
#include "contact/impact_location.h"

static void begin_event_step(const ms_integrator *method, ms_stepper *s) {
  ms_contact_set *e = s->events;
  e->a_is_known = s->cached_stage & MS_CONTACTS_CACHED;
  if (!e->a_is_known) e->contact_hash = 0;
  e->implicit = method->entry.implicit;
  e->merge = 1e-11 * e->reach;
  /* A particle that no whole step lets touch a plane would come near enough half way to a later
   * impact, and bounce there: steps of any length would differ from two half steps. */
  if (s->one_substep && s->part > 0) e->merge /= 2;
  e->bounce_time = 0;
  e->bounce_reach = s->one_substep ? s->x_tolerance : INFINITY;
  e->path_tolerance = s->one_substep ? s->path_tolerance : INFINITY;
  e->nfollowed = 0;
  s->cached_stage &= ~MS_CONTACTS_CACHED;
  s->impact = s->change = MS_NOWHERE;
  if (s->part == 0) s->path_error = 0, s->npaths = 0;
}

/* The method's own step, which reflects */
static msim_status step_and_reflect(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  ms_contact_set *e = s->events;
  s->events = NULL;
  const msim_status status = method->step(s, err);
  s->events = e;
  return status;
}

msim_status ms_events_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  if (!s->events) return method->step(s, err);
  const int is_stiff = method->entry.implicit && s->h * s->bounds.omega > 2;
  if (s->opt->collision == MSIM_COLLISION_REFLECT && !is_stiff)
    return step_and_reflect(method, s, err);
  begin_event_step(method, s);
  s->events->method_handles_contact = method->handles_contact && !s->one_substep;
  if (s->events->method_handles_contact)
    s->events->ncontacts = 0; /* left by a step of ms_impact_location_step() */
  if (s->events->method_handles_contact) return method->step(s, err);
  double *x = s->x, *v = s->v;
  const double h = s->h, t = s->t;
  const msim_status status =
      is_stiff ? ms_implicit_contact_step(method, s, err) : ms_impact_location_step(method, s, err);
  s->events->moved = !is_stiff && s->x != x;
  s->x = x, s->v = v, s->h = h, s->t = t;
  return status;
}
