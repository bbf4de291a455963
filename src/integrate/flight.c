#include "integrate/flight.h"

#include <string.h>

#include "base/vec3.h"

ms_flight ms_flight_of(const ms_stepper *s, int32_t row) {
  const ms_rows *rows = &s->model->rows;
  double x[2][3], v[2][3];
  ms_row_get(rows, s->x, row, x[0]);
  ms_row_get(rows, s->v, row, v[0]);
  ms_row_get(rows, s->x_next, row, x[1]);
  ms_row_get(rows, s->v_next, row, v[1]);
  ms_flight f = {.h = s->h};
  for (int c = 0; c < 3; c++)
    f.path[c] = ms_cubic_between(x[0][c], s->h * v[0][c], x[1][c], s->h * v[1][c]);
  return f;
}

void ms_flight_at(const ms_flight *f, double q, double x[3], double v[3], double a[3]) {
  for (int c = 0; c < 3; c++) {
    const ms_cubic *p = &f->path[c];
    x[c] = ms_cubic_at(p, q);
    v[c] = ms_cubic_slope(p, q) / f->h;
    a[c] = (2 * p->c[2] + 6 * p->c[3] * q) / (f->h * f->h);
  }
}

/* s(q) = n.x(q) - d */
static ms_cubic distance(const ms_flight *f, const msim_plane *p) {
  ms_cubic s = {{-p->offset}};
  for (int k = 0; k < 4; k++)
    for (int c = 0; c < 3; c++) s.c[k] += p->normal[c] * f->path[c].c[k];
  return s;
}

static int holds(const ms_touch *held, const msim_plane *p) {
  for (int i = 0; held && i < held->n; i++)
    if (held->plane[i] == p) return 1;
  return 0;
}

double ms_flight_meets(const ms_flight *f, const ms_walls *walls, const ms_touch *held, double from,
                       const msim_plane **plane) {
  const double LEAST = 1. / 16; /* what touches a plane and does not run into it stays that long */
  double first = MS_NOWHERE, x[3], v[3], a[3];
  ms_flight_at(f, from, x, v, a);
  const double noise = ms_distance_noise(walls, x);
  for (const msim_plane *p = walls->plane; p < walls->plane + walls->n; p++) {
    if (holds(held, p)) continue;
    const ms_cubic s = distance(f, p);
    double q = ms_first_crossing(&s, from, noise);
    if (q <= 1 && ms_cubic_at(&s, from) <= noise) q = fmax(q, from + LEAST * (1 - from));
    if (q < first) first = q, *plane = p;
  }
  return first;
}

/*------------------------------------- many impacts ---------------------------------------------*/

/* From a share q of the step on it rests on the planes: what would drive it through them does not,
 * and rubs. */
static void lay(const ms_flight *f, double q, ms_touch on, double x1[3], double v1[3]) {
  double a[3], least;
  if (on.n > MS_MOST_HOLDING) on.n = MS_MOST_HOLDING;
  ms_flight_at(f, 1, x1, v1, a);
  const double pull = ms_keep_along(&on, v1, &least), speed = ms_norm3(v1);
  const double lost = speed > pull ? pull / speed : 1;
  ms_axpy3(-0.5 * (1 - q) * f->h * lost, v1, x1);
  ms_axpy3(-lost, v1, v1);
  ms_put_on(&on, x1);
}

/* v jumps at q: x moves on by the jump times the time since. */
static void kink(ms_flight *f, double q, const double jump[3]) {
  for (int c = 0; c < 3; c++) {
    f->path[c].c[0] -= q * f->h * jump[c];
    f->path[c].c[1] += f->h * jump[c];
  }
}

/* Bounces of one particle, counted. x1, v1: its state at the end; 0 where that has not changed. */
static int follow(ms_flight *f, const ms_walls *walls, const ms_touch *held, double h, double x1[3],
                  double v1[3], int64_t *bounces) {
  enum { MOST = 8 };
  const msim_plane *plane;
  double a[3], q = 0;
  for (int met = 0;; met++) {
    q = ms_flight_meets(f, walls, held, q, &plane);
    if (!(q <= 1)) {
      ms_flight_at(f, 1, x1, v1, a);
      return met > 0;
    }
    double x[3], v[3], jump[3];
    ms_flight_at(f, q, x, v, a);
    ms_put_on(&(ms_touch){1, {plane}}, x);
    const ms_touch on = ms_touched(walls, x);
    memcpy(jump, v, sizeof v);
    *bounces += ms_bounce(&on, v);
    if (met == MOST || ms_would_rest(plane, v, a, h)) {
      lay(f, q, on, x1, v1);
      return 1;
    }
    for (int c = 0; c < 3; c++) jump[c] = v[c] - jump[c];
    kink(f, q, jump);
  }
}

/* What slides against friction stops where its velocity turns round. */
static int stop(const ms_flight *f, const ms_contact *c, double x1[3], double v1[3]) {
  double x[3], v[3], a[3];
  if (!c || !c->rubs || c->sticks) return 0;
  ms_flight_at(f, 0, x, v, a);
  ms_flight_at(f, 1, x1, v1, a);
  const double before = ms_dot3(v, c->slide), after = ms_dot3(v1, c->slide);
  if (!(after < -ms_speed_noise(v))) return 0;
  ms_flight_at(f, before / (before - after), x1, v1, a);
  memset(v1, 0, 3 * sizeof *v1);
  return 1;
}

void ms_flights_correct(ms_stepper *s, double h) {
  const ms_rows *rows = &s->model->rows;
  const ms_walls walls = ms_walls_of(s);
  const ms_contact *c = s->events->contact, *end = c + s->events->ncontacts;
  for (int32_t r = 0; r < rows->nfree; r++) {
    ms_flight f = ms_flight_of(s, r);
    const ms_contact *own = c < end && c->row == r ? c++ : NULL;
    double x1[3], v1[3];
    const ms_touch *held = own ? &own->on : NULL;
    if (!follow(&f, &walls, held, h, x1, v1, &s->stats->contacts) && !stop(&f, own, x1, v1))
      continue;
    ms_row_put(rows, x1, r, s->x_next);
    ms_row_put(rows, v1, r, s->v_next);
  }
}
