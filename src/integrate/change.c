#include "integrate/change.h"

#include <math.h>

#include "base/vec3.h"
#include "physics/friction.h"

/* When the sliding particle stops (s), with the mean acceleration until then; INFINITY: never. */
static double stop_time(const ms_stepper *s, const ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double a0[3], a1[3], v[3], time = 0;
  ms_row_get(rows, s->events->a, c->row, a0);
  ms_row_get(rows, s->events->a_end, c->row, a1);
  ms_row_get(rows, s->v, c->row, v);
  for (int i = 0; i < 3; i++) {
    const double share = 0.5 * fmin(1, time / s->h);
    double a[3];
    for (int k = 0; k < 3; k++) a[k] = a0[k] + share * (a1[k] - a0[k]);
    const double friction = ms_keep_along(&c->on, a, NULL);
    time = ms_friction_stop(a, friction, v);
  }
  return time;
}

/* What is across v decays at the rate F/|v|. On a line nothing is across. */
static int turns(const ms_stepper *s, const ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double v0[3], v1[3], a[3];
  if (!c->rubs || c->sticks || c->fixed || c->bounces) return 0;
  ms_row_get(rows, s->v, c->row, v0);
  ms_row_get(rows, s->v_next, c->row, v1);
  ms_row_get(rows, s->events->a_end, c->row, a);
  const double slow = s->h * ms_keep_along(&c->on, a, NULL), speed = ms_norm3(v0);
  const double along = ms_dot3(c->slide, a), across2 = ms_dot3(a, a) - along * along;
  const int is_straight = across2 <= 1e-12 * along * along;
  return ((fmin(speed, ms_norm3(v1)) < slow || c->stop < s->h) && !is_straight) ||
         ms_dot3(v0, v1) < sqrt(0.5) * speed * ms_norm3(v1);
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
  if (c->fixed || (c->sticks && ms_contact_grip(c, a1) >= -noise)) return MS_NOWHERE;
  if (c->sticks) return crossing(ms_contact_grip(c, a0), ms_contact_grip(c, a1));
  const double stop = c->rubs ? stop_time(s, c) / s->h : MS_NOWHERE;
  return stop <= 1 ? stop : MS_NOWHERE;
}

void ms_contact_judge(const ms_stepper *s, ms_contact *c) {
  c->change = find_change(s, c);
  c->turns = turns(s, c);
}
