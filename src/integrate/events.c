#include "integrate/events.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "integrate/flight.h"
#include "integrate/locate.h"

typedef enum kind { NOTHING, IMPACT, STOP, SLIP, RELEASE } kind;

/* Impacts of a crowd that are nearer to each other than this share of a step are one. */
#define NEAR 1e-3

/* What ends a part of a step. */
typedef struct incident {
  kind kind;
  double share; /* of the part that was made; MS_NOWHERE: it does not happen there */
  int32_t row, contact;
  const msim_plane *plane;
} incident;

/* A step in parts */
typedef struct journey {
  const ms_integrator *method;
  ms_stepper *s;
  ms_events *e;
  double h, done; /* the step, and how much of it lies behind */
  int parts;      /* ended by an incident */
  int carried;    /* what s->warm was */
  int warm;       /* for the next part; 0: without what was carried over */
  int lost;       /* a part was made without */
  int crowd;      /* many incidents among stiff springs: impacts alone are located */
  incident last;  /* where the part to come starts */
} journey;

/* A part of that length, from s->x, s->v. */
static msim_status make(journey *j, double length, msim_error *err) {
  j->s->warm = j->warm;
  j->s->h = length;
  j->lost |= j->warm != j->carried;
  const msim_status status = j->method->step(j->s, err);
  j->warm = 0;
  if (!status) ms_contacts_finish(j->s);
  return status;
}

/*------------------------------------- what comes first -----------------------------------------*/

/* Values of what ends a contact, at the start of the part and at its end, and how much of them may
 * be rounding: below 0 it has happened. */
typedef struct gauge {
  double before, after, noise;
} gauge;

static gauge read(const journey *j, const ms_contact *c, kind end) {
  const ms_rows *rows = &j->s->model->rows;
  double a[2][3], v[2][3];
  ms_row_get(rows, j->e->a, c->row, a[0]);
  ms_row_get(rows, j->e->a_end, c->row, a[1]);
  ms_row_get(rows, j->s->v, c->row, v[0]);
  ms_row_get(rows, j->s->v_next, c->row, v[1]);
  if (end == STOP)
    return (gauge){ms_dot3(v[0], c->slide), ms_dot3(v[1], c->slide), ms_speed_noise(v[0])};
  const double noise = MS_PRESS * fmax(ms_norm3(a[0]), ms_norm3(a[1]));
  if (end == SLIP) return (gauge){ms_contact_grip(c, a[0]), ms_contact_grip(c, a[1]), noise};
  return (gauge){ms_contact_reaction(c, a[0]), ms_contact_reaction(c, a[1]), noise};
}

/* Can it end like this at all? */
static int may_end(const ms_contact *c, kind end) {
  return end == RELEASE || (end == STOP ? c->rubs && !c->sticks : c->sticks && !c->fixed);
}

/* Where a contact ends, by a straight line through its values. */
static incident end_of(const journey *j, int32_t contact) {
  const ms_contact *c = &j->e->contact[contact];
  incident first = {.share = MS_NOWHERE};
  for (kind k = STOP; k <= RELEASE; k++) {
    if (!may_end(c, k)) continue;
    const gauge g = read(j, c, k);
    if (!(g.after < -g.noise)) continue;
    const double share = fmax(0, g.before) / (fmax(0, g.before) - g.after);
    if (share < first.share)
      first = (incident){.kind = k, .share = share, .row = c->row, .contact = contact};
  }
  return first;
}

/* The first incident of the part just made; *count: the particles that have one. */
static incident find_first(const journey *j, int32_t *count) {
  const ms_events *e = j->e;
  const ms_walls walls = ms_walls_of(j->s);
  incident first = {.share = MS_NOWHERE};
  int32_t next = 0;
  *count = 0;
  for (int32_t r = 0; r < j->s->model->rows.nfree; r++) {
    const ms_flight f = ms_flight_of(j->s, r);
    incident i = {.share = MS_NOWHERE};
    const ms_touch *held = NULL;
    if (next < e->ncontacts && e->contact[next].row == r) {
      if (!j->crowd) i = end_of(j, next);
      held = &e->contact[next++].on;
    }
    const msim_plane *plane = NULL;
    const double q = ms_flight_meets(&f, &walls, held, 0, &plane);
    if (q < i.share) i = (incident){.kind = IMPACT, .share = q, .row = r, .plane = plane};
    *count += i.share <= 1;
    if (i.share < first.share) first = i;
  }
  return first;
}

/*------------------------------------- where it is ----------------------------------------------*/

/* A place and the value of what ends a contact there */
typedef struct point {
  double share, value;
} point;

static int is_same(const incident *a, const incident *b) {
  return a->kind == b->kind && a->row == b->row;
}

/* Where the end of a contact lies, by the secant through the last two places; 0: nowhere. share: of
 * the part just made. */
static double follow_secant(const journey *j, const incident *i, double share, point *last) {
  const gauge g = read(j, &j->e->contact[i->contact], i->kind);
  if (fabs(g.after) <= g.noise) return share;
  if (last->share == 0) last->value = g.before;
  const double fall = (last->value - g.after) / (share - last->share);
  *last = (point){share, g.after};
  return fall > 0 ? share + g.after / fall : 0;
}

/* By what the length of a part is to be multiplied so that it ends at an impact which it has not
 * reached, by Newton's method; 1: it is there; 0: it will never be. */
static double find_stretch(const journey *j, const incident *i) {
  double x[3], v[3];
  ms_row_get(&j->s->model->rows, j->s->x_next, i->row, x);
  ms_row_get(&j->s->model->rows, j->s->v_next, i->row, v);
  const double s = ms_distance(i->plane, x), speed = -ms_dot3(i->plane->normal, v);
  const ms_walls walls = ms_walls_of(j->s);
  if (s <= ms_distance_noise(&walls, x)) return 1;
  return speed > 0 ? 1 + s / (speed * j->s->h) : 0;
}

/* Makes parts until one ends at the incident, or at an earlier one. Left at NOTHING where it was
 * one of the interpolant alone: the part ends where that was seen. Never longer than the part that
 * showed it. */
static msim_status locate(journey *j, incident *i, msim_error *err) {
  enum { MOST = 60 };
  const double whole = j->h - j->done, near = j->crowd ? NEAR : 0;
  double lo = 0, hi = 1, share = i->share;
  point last = {0};
  for (int tries = 0; tries < MOST; tries++) {
    int32_t count;
    msim_status status = make(j, share * whole, err);
    if (status) return status;
    const incident now = find_first(j, &count);
    const int past = now.share <= 1;
    if (past && !is_same(&now, i)) last.share = 0;
    if (past) *i = now, hi = share;
    else lo = share;
    double next = share * now.share;
    if (i->kind != IMPACT) next = follow_secant(j, i, share, &last);
    else if (!past) next = share * find_stretch(j, i);
    if (!past && next == 0) i->kind = NOTHING;
    if (!past && next <= share) return MSIM_OK;
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    if (fabs(next - share) <= near || hi - lo <= DBL_EPSILON * hi) break;
    share = next;
  }
  return MSIM_OK;
}

/*------------------------------------- crowds ---------------------------------------------------*/

/* Where an explicit method would not be stable, no particle may be moved for itself: that bends
 * springs which are to relax within the step. */
static int is_stiff(const journey *j) {
  return j->method->entry.implicit && j->h * ms_bounds_of(j->s->model).omega > 2;
}

/* Friction pulls as at the start, all through the part: it may stop what slides and is driven on as
 * at the start, and not turn it round. */
static void ease_friction(journey *j) {
  const double left = j->h - j->done;
  for (ms_contact *c = j->e->contact; c < j->e->contact + j->e->ncontacts; c++) {
    double v[3], a[3];
    ms_row_get(&j->s->model->rows, j->s->v, c->row, v);
    ms_row_get(&j->s->model->rows, j->e->a, c->row, a);
    const double pull = ms_norm3(c->rub) * left;
    const double most = ms_norm3(v) + left * fmax(0, ms_dot3(a, c->slide));
    for (int k = 0; k < 3 && pull > most; k++) c->rub[k] *= most / pull;
  }
}

/* Who is as good as at a plane is there, and bounces with the others. */
static void gather(journey *j) {
  ms_stepper *s = j->s;
  const ms_rows *rows = &s->model->rows;
  const ms_walls walls = ms_walls_of(s);
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3], v[3];
    ms_row_get(rows, s->x_next, r, x);
    ms_row_get(rows, s->v_next, r, v);
    for (const msim_plane *p = walls.plane; p < walls.plane + walls.n; p++) {
      const double above = ms_distance(p, x), speed = -ms_dot3(p->normal, v);
      if (above > 0 && above <= NEAR * j->h * speed) ms_put_on(&(ms_touch){1, {p}}, x);
    }
    ms_row_put(rows, x, r, s->x_next);
  }
}

/* What has slid beyond its stop has stopped. */
static void stop_sliders(journey *j) {
  static const double still[3] = {0};
  for (const ms_contact *c = j->e->contact; c < j->e->contact + j->e->ncontacts; c++) {
    if (!may_end(c, STOP)) continue;
    const gauge g = read(j, c, STOP);
    if (g.after < -g.noise) ms_row_put(&j->s->model->rows, still, c->row, j->s->v_next);
  }
}

/* All who run into planes in the part just made are held above them from its start on; 0: nobody
 * does. */
static int hold_crowd(journey *j) {
  const ms_events *e = j->e;
  const ms_walls walls = ms_walls_of(j->s);
  int32_t at = 0;
  int any = 0;
  for (int32_t r = 0; r < j->s->model->rows.nfree; r++) {
    const msim_plane *plane;
    const ms_flight f = ms_flight_of(j->s, r);
    const int is_held = at < e->ncontacts && e->contact[at].row == r;
    const int meets = !is_held && ms_flight_meets(&f, &walls, NULL, 0, &plane) <= 1;
    if (meets) ms_contacts_insert(j->s, at, r, plane);
    at += is_held || meets;
    any |= meets;
  }
  return any;
}

/* The rest of the step in one part, without bounces. */
static msim_status settle_crowd(journey *j, msim_error *err) {
  enum { ROUNDS = 8 };
  msim_status status = MSIM_OK;
  for (int i = 0; i < ROUNDS && !status && hold_crowd(j); i++)
    status = make(j, j->h - j->done, err);
  return status;
}

/*------------------------------------- parts ----------------------------------------------------*/

/* The end of the part is the start of the next. */
static void go_on(journey *j) {
  ms_stepper *s = j->s;
  ms_events *e = j->e;
  j->done += s->h;
  ms_contacts_own(s);
  ms_copy(s->model->shape, s->x_next, s->x);
  ms_copy(s->model->shape, s->v_next, s->v);
  if (e->ncontacts) ms_contacts_know(e);
}

/* The incident lies at the end of the part or, at_once, at its start. */
static void end_part(journey *j, const incident *i, int at_once) {
  static const double still[3] = {0};
  if (!at_once) go_on(j);
  j->last = *i;
  if (i->kind != STOP) return;
  ms_contacts_own(j->s);
  ms_row_put(&j->s->model->rows, still, i->row, j->s->v);
}

/* The part just made is the last of the step, in which so many more have incidents. */
static msim_status end_step(journey *j, int32_t count, msim_error *err) {
  msim_status status = MSIM_OK;
  if (j->crowd) {
    if (count) status = settle_crowd(j, err);
    if (!status) stop_sliders(j);
  } else if (count) {
    ms_flights_correct(j->s, j->h);
    j->s->finite = 0;
  }
  return status;
}

/* The rest of the step, or the part of it up to the first incident. */
static msim_status make_part(journey *j, int *over, msim_error *err) {
  const double AT_ONCE = 1e-12;
  int32_t count;
  msim_status status = make(j, j->h - j->done, err);
  if (status) return status;
  incident i = find_first(j, &count);
  if (!j->crowd && count > MS_FEW && is_stiff(j)) {
    j->crowd = 1;
    ease_friction(j);
    return make_part(j, over, err);
  }
  j->parts += j->crowd || count;
  *over = !count || (count > MS_FEW && !j->crowd) || j->parts == MS_MOST_PARTS;
  if (*over) return end_step(j, count, err);
  const int at_once = i.kind != IMPACT && i.share < AT_ONCE;
  if (!at_once) status = locate(j, &i, err);
  if (status) return status;
  if (j->crowd) gather(j), stop_sliders(j);
  end_part(j, &i, at_once);
  return MSIM_OK;
}

/* What ended at the very end of the step has been dealt with: there is nothing left to make. */
static int is_done(journey *j) {
  ms_stepper *s = j->s;
  if (j->h - j->done > 8 * DBL_EPSILON * j->h) return 0;
  ms_copy(s->model->shape, s->x, s->x_next);
  ms_copy(s->model->shape, s->v, s->v_next);
  return 1;
}

static msim_status travel(journey *j, msim_error *err) {
  msim_status status = MSIM_OK;
  for (int over = 0; !over && !status;) {
    const incident *i = &j->last;
    ms_contacts_find(j->s, j->h, i->kind == RELEASE ? i->row : -1, i->kind == SLIP ? i->row : -1);
    /* what was carried over is of use if nothing has come between */
    if (j->s->x == j->e->x || ms_contacts_sign(j->s) != j->e->held) j->warm = 0;
    if (j->crowd) ease_friction(j);
    over = is_done(j);
    if (!over) status = make_part(j, &over, err);
  }
  return status;
}

/* What the next step may know. The a of an explicit method is that of x_next before the planes had
 * their say: to rounding the same, but not to the bit. */
static void note(journey *j) {
  ms_stepper *s = j->s;
  if (j->parts || (j->e->ncontacts && !j->method->entry.implicit)) s->warm_next = 0;
  if (j->parts || !j->e->ncontacts) return;
  j->e->held = ms_contacts_sign(s);
  ms_contacts_know(j->e);
  s->warm_next |= MS_NOTED;
}

msim_status ms_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  ms_events *e = s->events;
  if (!e || method->replays) return method->step(s, err);
  if (!method->entry.implicit || s->h * ms_bounds_of(s->model).omega <= 2)
    return ms_locate_step(method, s, err);
  double *x = s->x, *v = s->v;
  const int carried = s->warm & ~MS_NOTED;
  journey j = {.method = method, .s = s, .e = e, .h = s->h, .carried = carried, .warm = carried};
  e->known = s->warm & MS_NOTED;
  if (!e->known) e->held = 0;
  e->stiff = INFINITY;
  const msim_status status = travel(&j, err);
  s->x = x, s->v = v, s->h = j.h;
  s->warm = j.lost ? 0 : carried;
  if (!status) note(&j);
  return status;
}
