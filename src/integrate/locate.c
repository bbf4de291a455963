#include "integrate/locate.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"

/* A step in parts */
typedef struct substeps {
  const ms_integrator *method;
  ms_stepper *s;
  ms_events *e;
  double h, done;   /* the step, and how much of it lies behind */
  ms_bounds bounds; /* on frequencies and rates of damping */
  int may_cut;      /* paths of particles, of order 2, would be worse than the method */
  int cuts;
  int warm;       /* for the part to come; 0: without what was carried over */
  int ends_known; /* a and a_end are those of the part just made */
} substeps;

/* The first impact of a part */
typedef struct impact {
  double share;
  int32_t row;
  const msim_plane *plane;
  double depth; /* how far behind planes the paths of all rows may lead */
} impact;

/*------------------------------------- paths of particles ---------------------------------------*/

/* Error of v that a path leaves, of third order: what its acceleration being linear in time adds to
 * a constant one, times how much that acceleration changes; and of its neighbours, which felt the
 * particle where the step had it, not where the path ends, h (omega^2 |dx|/3 + rate |dv|/2).
 * Shallow impacts have been judged before (is_shallow). */
static void note_error(const substeps *j, int32_t row, const ms_path *p) {
  ms_stepper *s = j->s;
  const ms_bounds *b = &j->bounds;
  double bend[3], da[3], dx[3], dv[3];
  ms_row_get(&s->model->rows, s->x_next, row, dx);
  ms_row_get(&s->model->rows, s->v_next, row, dv);
  for (int c = 0; c < 3; c++) {
    bend[c] = p->w[c] - p->v[c], da[c] = p->b1[c] - p->b0[c];
    dx[c] -= p->x[c], dv[c] -= p->w[c];
  }
  const double size = fmax(ms_norm3(p->b0), ms_norm3(p->b1));
  const double own = size > 0 ? ms_norm3(bend) * ms_norm3(da) / size : 0;
  const double error =
      fmax(own, s->h * (b->omega * b->omega * ms_norm3(dx) / 3 + b->rate * ms_norm3(dv) / 2));
  if (!(error <= s->path_error)) s->path_error = error, s->path_row = row;
}

/* Its end of the part is that of its own path: bounces are summed, something changes, or the method
 * knows no forces of velocities, as friction is one. */
static int needs_path(const substeps *j, const ms_contact *c) {
  const int rubs = c->rubs && !c->sticks && j->method->separable;
  return c->bounces || rubs || c->change <= 1;
}

/*------------------------------------- the first impact -----------------------------------------*/

static void know_ends(substeps *j) {
  if (j->ends_known) return;
  if (!j->e->known) ms_contacts_free(j->s, j->s->x, j->s->v, j->e->a);
  if (!j->e->ncontacts) ms_contacts_free(j->s, j->s->x_next, j->s->v_next, j->e->a_end);
  j->e->known = 1;
  j->ends_known = 1;
}

/* May a row come to a plane in the part just made? By Hermite's cubic, whose error is at most
 * h^4/384 |x''''|, with |x''''| <= omega^2 |x''|, of which the ends show some: 4 times that is
 * allowed for. */
static int may_meet(const substeps *j, int32_t row, const msim_plane *p) {
  const ms_stepper *s = j->s;
  const ms_rows *rows = &s->model->rows;
  double x[2][3], v[2][3];
  ms_row_get(rows, s->x, row, x[0]);
  ms_row_get(rows, s->v, row, v[0]);
  ms_row_get(rows, s->x_next, row, x[1]);
  ms_row_get(rows, s->v_next, row, v[1]);
  const double u0 = s->h * ms_dot3(p->normal, v[0]), u1 = s->h * ms_dot3(p->normal, v[1]);
  const double s0 = ms_distance(p, x[0]), s1 = ms_distance(p, x[1]), z = s->h * j->bounds.omega;
  const double bend =
      fmax(fabs(6 * (s1 - s0) - 4 * u0 - 2 * u1), fabs(6 * (s0 - s1) + 2 * u0 + 4 * u1));
  const ms_bernstein cubic = ms_bernstein_cubic(s0, u0, s1, u1);
  return ms_bernstein_least(&cubic) <= z * z / 96 * bend;
}

/* One component of a row over the part just made: the dense output of the method, or Hermite's
 * quintic. */
static ms_bernstein component_of(substeps *j, int32_t row, int32_t c) {
  const ms_stepper *s = j->s;
  const size_t at = (size_t)c * (size_t)s->model->rows.stride + (size_t)row;
  ms_bernstein of;
  if (j->method->path) {
    j->method->path(j->s, at, &of);
    return of;
  }
  know_ends(j);
  const double h = s->h, h2 = h * h;
  return ms_bernstein_quintic(s->x[at], h * s->v[at], h2 * j->e->a[at], s->x_next[at],
                              h * s->v_next[at], h2 * j->e->a_end[at]);
}

static ms_bernstein distance_of(substeps *j, int32_t row, const msim_plane *p) {
  const ms_rows *rows = &j->s->model->rows;
  ms_bernstein sum = component_of(j, row, 0);
  for (int32_t c = 0; c < rows->dims; c++) {
    const ms_bernstein of = component_of(j, row, c);
    const double n = p->normal[rows->axis[c]];
    for (int i = 0; i <= of.degree; i++) sum.c[i] = (c ? sum.c[i] : -p->offset) + n * of.c[i];
  }
  return sum;
}

/* Nowhere, or where; *depth: no deeper than that does the path lead behind the plane. What touches
 * it and neither leaves it nor runs into it, up to rounding, stays off it for a share LEAST. */
static double share_of_impact(substeps *j, int32_t row, const msim_plane *p, double *depth) {
  const double LEAST = 1. / 16;
  const ms_walls walls = ms_walls_of(j->s);
  double x[3];
  if (!may_meet(j, row, p)) return MS_NOWHERE;
  ms_row_get(&j->s->model->rows, j->s->x, row, x);
  const ms_bernstein path = distance_of(j, row, p);
  const double noise = ms_distance_noise(&walls, x), q = ms_bernstein_first_fall(&path, noise);
  const int leaves = path.c[1] - path.c[0] > noise;
  *depth = -ms_bernstein_least(&path);
  return q <= 1 && path.c[0] <= noise && !leaves ? fmax(q, LEAST) : q;
}

/* Of one row, where it is earlier than *first */
static void find_impact_of(substeps *j, int32_t row, const ms_contact *c, impact *first) {
  const ms_scene *scene = j->s->model->scene;
  for (const msim_plane *p = scene->planes; p < scene->planes + scene->nplanes; p++) {
    double depth = 0;
    if (c && ms_touch_holds(&c->on, p)) continue;
    const double share = share_of_impact(j, row, p, &depth);
    if (share > 1) continue;
    if (share < first->share) first->share = share, first->row = row, first->plane = p;
    first->depth = fmax(depth, first->depth);
  }
}

/* Of all rows but those that follow paths of their own */
static impact find_impact(substeps *j) {
  const ms_events *e = j->e;
  impact first = {.share = MS_NOWHERE};
  int32_t next = 0;
  for (int32_t r = 0; r < j->s->model->rows.nfree; r++) {
    const ms_contact *c = ms_contact_of(e, r, &next);
    if (!c || !needs_path(j, c)) find_impact_of(j, r, c, &first);
  }
  return first;
}

/*------------------------------------- parts ----------------------------------------------------*/

/* A part of that length, from s->x, s->v. */
static msim_status make(substeps *j, double length, msim_error *err) {
  j->s->warm = j->warm;
  j->s->h = length;
  j->s->looked = 0;
  const msim_status status = j->method->step(j->s, err);
  if (!status) ms_contacts_finish(j->s);
  j->ends_known = j->e->ncontacts > 0;
  return status;
}

/* By what the length of the part is to be multiplied so that it ends at the impact (Newton). */
static double stretch(const substeps *j, const impact *i) {
  double x[3], v[3];
  ms_row_get(&j->s->model->rows, j->s->x_next, i->row, x);
  ms_row_get(&j->s->model->rows, j->s->v_next, i->row, v);
  const double speed = -ms_dot3(i->plane->normal, v), s = ms_distance(i->plane, x);
  const double rounding = 8 * DBL_EPSILON * fmax(j->e->reach, ms_norm3(x));
  if (fabs(s) <= rounding || !(speed > 0)) return 1;
  return fmin(fmax(1 + s / (speed * j->s->h), 0.5), 2);
}

/* The part ends at a point of the dense output, which expects a step that was accepted. */
static void cut_dense(substeps *j, double share) {
  ms_stepper *s = j->s;
  double *x = j->e->stage[0], *v = j->e->stage[1];
  ms_swap(&s->x, &s->x_next), ms_swap(&s->v, &s->v_next);
  j->method->interpolate(s, share, x, v);
  ms_swap(&s->x, &s->x_next), ms_swap(&s->v, &s->v_next);
  ms_copy(s->model->shape, x, s->x_next);
  ms_copy(s->model->shape, v, s->v_next);
  s->h *= share;
  ms_contacts_finish(s);
  j->ends_known = j->e->ncontacts > 0;
}

/* The part ends at the impact: it is made anew, until it does. */
static msim_status cut(substeps *j, const impact *i, msim_error *err) {
  enum { MOST = 6 };
  const double longest = j->h - j->done;
  double length = i->share * j->s->h;
  if (j->method->path) {
    cut_dense(j, i->share);
    return MSIM_OK;
  }
  for (int k = 0; k < MOST; k++) {
    const msim_status status = make(j, length, err);
    if (status) return status;
    const double next = fmin(length * stretch(j, i), longest);
    if (fabs(next - length) <= DBL_EPSILON * length) break;
    length = next;
  }
  return MSIM_OK;
}

/* The end of the part is the start of the next. */
static void go_on(substeps *j) {
  ms_stepper *s = j->s;
  ms_contacts_own(s);
  ms_copy(s->model->shape, s->x_next, s->x);
  ms_copy(s->model->shape, s->v_next, s->v);
  if (j->ends_known) ms_contacts_know(j->e);
}

/* x and v after a share of the part, v by the cubic of v and a at both ends */
static void go_along(substeps *j, int32_t row, double share, ms_path *p) {
  const ms_stepper *s = j->s;
  const ms_rows *rows = &s->model->rows;
  double v1[3];
  ms_row_get(rows, s->v_next, row, v1);
  for (int32_t c = 0; c < rows->dims; c++) {
    const int k = rows->axis[c];
    const ms_bernstein x = component_of(j, row, c);
    const ms_bernstein v = ms_bernstein_cubic(p->v[k], s->h * p->b0[k], v1[k], s->h * p->b1[k]);
    p->x[k] = ms_bernstein_at(&x, share);
    p->v[k] = ms_bernstein_at(&v, share);
  }
}

/* From a share of the part on. Its acceleration is linear in time, t of the whole length; x ends
 * where that leads: t^2/2 (2 b0 + b1)/3. */
static void follow_path(substeps *j, int32_t row, double from, const ms_contact *contact) {
  ms_stepper *s = j->s;
  const ms_rows *rows = &s->model->rows;
  ms_path p = ms_contacts_path(s, row, j->e->a, j->e->a_end);
  p.h *= 1 - from;
  if (!(p.h > 0)) return;
  if (from > 0) go_along(j, row, from, &p);
  for (int c = 0; c < 3; c++) {
    p.b0[c] += from * (p.b1[c] - p.b0[c]);
    p.a[c] = (2 * p.b0[c] + p.b1[c]) / 3;
  }
  if (contact && contact->bounces) ms_axpy3(contact->rebound, contact->on.plane[0]->normal, p.v);
  memcpy(p.w, p.v, sizeof p.w);
  ms_path_follow(&p);
  if (from == 0) note_error(j, row, &p);
  ms_row_put(rows, p.x, row, s->x_next);
  ms_row_put(rows, p.w, row, s->v_next);
  s->stats->contacts += p.impacts;
  j->e->followed[j->e->nfollowed++] = row;
}

/* Contacts to which something happens, and, where the step may not be cut any more, what meets
 * planes. */
static void follow_paths(substeps *j, int all) {
  ms_events *e = j->e;
  if (all) know_ends(j);
  e->nfollowed = 0;
  int32_t next = 0;
  for (int32_t r = 0; r < j->s->model->rows.nfree && (all || next < e->ncontacts); r++) {
    const ms_contact *c = ms_contact_of(e, r, &next);
    double from = c && needs_path(j, c) ? 0 : MS_NOWHERE;
    if (all && from > 1) {
      impact first = {.share = MS_NOWHERE};
      find_impact_of(j, r, c, &first);
      if (first.share <= 1) from = c || j->method->entry.order == 1 ? 0 : first.share;
    }
    if (from <= 1) follow_path(j, r, from, c);
  }
  if (!e->nfollowed) return;
  j->s->npaths += e->nfollowed;
  j->ends_known = 0;
  j->s->warm_next = 0;
  j->s->finite = 0;
}

static int is_done(substeps *j) {
  ms_stepper *s = j->s;
  if (j->h - j->done > 8 * DBL_EPSILON * j->h) return 0;
  ms_copy(s->model->shape, s->x, s->x_next);
  ms_copy(s->model->shape, s->v, s->v_next);
  return 1;
}

/* The first of all contacts that changes */
static double find_first_change(const substeps *j) {
  double first = MS_NOWHERE;
  for (int32_t i = 0; i < j->e->ncontacts; i++) first = fmin(first, j->e->contact[i].change);
  return first;
}

/* The length of a part that ends before a change, or, from near before it, behind it: so that the
 * path of what changes is short, and its error small. */
static double length_before(const substeps *j, double share) {
  const double NEAR = 1. / 16, near = NEAR * j->h, until = share * j->s->h - near / 2;
  return until > near / 2 ? until : fmin(near, j->s->h);
}

/* Where the step resolves the fastest vibrations: what is faster methods follow to no more than
 * order 2. Then accuracy is worth more steps. */
double ms_locate_longest(const ms_integrator *method, double omega) {
  const int p = method->entry.order;
  return p > 2 ? p * p / (16 * omega) : 0;
}

/* Under error control steps end at impacts, but where paths lead behind planes by so little that
 * the particle may follow its own: its neighbours feel dampers of the velocity before. The error
 * estimates of order 2 are not worth that doubt. */
static int is_shallow(const substeps *j, double depth) {
  const int may_pass = !j->method->estimate || j->method->two_estimates;
  return may_pass && depth <= j->s->x_tolerance && j->bounds.rate * depth <= j->s->v_tolerance;
}

static msim_status make_parts(substeps *j, msim_error *err) {
  ms_stepper *s = j->s;
  for (;;) {
    const double left = j->h - j->done;
    j->e->sums = left;
    ms_contacts_find(s);
    if (s->x == j->e->x || ms_contacts_sign(s) != j->e->held) j->warm = 0;
    if (is_done(j)) return MSIM_OK;
    msim_status status = make(j, left, err);
    if (status) return status;
    const int all = !s->one_part && (!j->may_cut || j->cuts == MS_MAX_CUTS);
    const impact i = all ? (impact){.share = MS_NOWHERE} : find_impact(j);
    if (s->one_part) {
      const int passes = is_shallow(j, i.depth);
      s->impact = passes ? MS_NOWHERE : i.share;
      follow_paths(j, i.share <= 1 && passes);
      return MSIM_OK;
    }
    const double change = j->may_cut && j->cuts < MS_FEW_CUTS ? find_first_change(j) : MS_NOWHERE;
    if (change < i.share) status = make(j, length_before(j, change), err);
    else if (i.share <= 1) status = cut(j, &i, err);
    if (status) return status;
    follow_paths(j, all);
    if (left - s->h <= 8 * DBL_EPSILON * j->h && i.share > 1) return MSIM_OK;
    j->done += s->h;
    go_on(j);
    j->cuts++;
  }
}

msim_status ms_locate_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  ms_events *e = s->events;
  substeps j = {.method = method, .s = s, .e = e, .h = s->h, .warm = s->warm};
  e->jump = s->one_part ? s->x_tolerance : INFINITY;
  j.bounds = ms_bounds_of(s->model);
  j.may_cut = j.h <= ms_locate_longest(method, j.bounds.omega);
  const msim_status status = make_parts(&j, err);
  if (status) return status;
  if (j.cuts || (e->ncontacts && !method->entry.implicit)) s->warm_next = 0;
  if (!j.cuts && j.ends_known) ms_contacts_note(s);
  return MSIM_OK;
}
