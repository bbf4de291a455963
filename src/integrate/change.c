#include "integrate/change.h"

#include <math.h>

#include "base/vec3.h"
#include "physics/friction.h"

/* When the sliding particle stops (s), by the acceleration at the start; INFINITY: never. */
static double stop_time(const ms_stepper *s, const ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double a[3], v[3];
  ms_row_get(rows, s->events->a, c->row, a);
  ms_row_get(rows, s->v, c->row, v);
  const double friction = ms_keep_along(&c->on, a, NULL);
  return ms_friction_stop(a, friction, v);
}

/* By more than 45 degrees in the part, or where its direction is stiff: what is across v decays at
 * the rate F/|v|. On a line nothing is across. */
static int turns(const ms_stepper *s, const ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double v0[3], v1[3], a[3];
  if (!c->rubs || c->sticks || c->fixed || c->bounces) return 0;
  ms_row_get(rows, s->v, c->row, v0);
  ms_row_get(rows, s->v_next, c->row, v1);
  ms_row_get(rows, s->events->a_end, c->row, a);
  ms_keep_along(&c->on, a, NULL);
  const double along = ms_dot3(c->slide, a), across2 = ms_dot3(a, a) - along * along;
  const int is_straight = across2 <= 1e-12 * along * along;
  return (c->stop < s->h && !is_straight) ||
         ms_dot3(v0, v1) < sqrt(0.5) * ms_norm3(v0) * ms_norm3(v1);
}

/* How much more the planes could pull before what sticks slips */
static double grip(const ms_contact *c, const double a[3]) {
  double along[3] = {a[0], a[1], a[2]};
  const double pull = ms_keep_along(&c->on, along, NULL);
  return pull - ms_norm3(along);
}

/* The share of the part after which g, linear in time, is below 0 */
static double crossing(double g0, double g1) { return g0 > 0 ? g0 / (g0 - g1) : 0; }

static double find_change(const ms_stepper *s, const ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double a0[3], a1[3];
  if (c->bounces) return MS_NOWHERE;
  ms_row_get(rows, s->events->a, c->row, a0);
  ms_row_get(rows, s->events->a_end, c->row, a1);
  const double noise = MS_PRESS * ms_norm3(a1), push = ms_contact_reaction(c, a1);
  if (push < -noise) return crossing(ms_contact_reaction(c, a0), push);
  if (c->fixed || (c->sticks && grip(c, a1) >= -noise)) return MS_NOWHERE;
  if (c->sticks) return crossing(grip(c, a0), grip(c, a1));
  const double stop = c->rubs ? stop_time(s, c) / s->h : MS_NOWHERE;
  return stop <= 1 ? stop : MS_NOWHERE;
}

void ms_contact_judge(const ms_stepper *s, ms_contact *c) {
  c->change = fmin(find_change(s, c), turns(s, c) ? 0.5 : MS_NOWHERE);
}
