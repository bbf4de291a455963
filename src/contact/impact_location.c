#include "contact/impact_location.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/contact_change.h"
#include "contact/contact_impulses.h"
#include "contact/moving_obstacles.h"
#include "contact/shortened_step.h"
#include "physics/signed_distance.h"

/* A step in substeps */
typedef struct substeps {
  const ms_integrator *method;
  ms_stepper *s;
  ms_contact_set *e;
  double h, done;   /* s: the length of the step, and of the substeps made */
  double work;      /* J: work_in_step of the substeps made */
  int may_divide;   /* the step is divided: the order of the method exceeds that of paths, 2 */
  int nsubsteps;    /* substeps made, but for the last */
  int cached_stage; /* the cached-stage tag for the next substep */
  int ends_known;   /* a and a_end are those of the substep just made */
  int keeps_end;    /* the second spare pair has the end of the step for dense output */
} substeps;

/* The first impact of a substep */
typedef struct impact {
  double share;
  double speed; /* m/s: towards the plane */
  int32_t row;
  const msim_plane *plane;
  double depth; /* m: a bound on the penetration of all particles in the substep */
} impact;

/*------------------------------------- particle paths -------------------------------------------*/

/* Estimates the error of v that a particle path from the share `from` on leaves, O(h^3): the larger
 * of its own error, from an acceleration that is linear in time, not constant,
 * |w - v| |b1 - b0|/max(|b0|, |b1|), and that of its neighbours, whose forces used the end of the
 * step, not that of the path, h (omega^2 |dx|/3 + rate |dv|/2). Those of a shallow impact inside a
 * step have been accepted before (is_shallow). */
static void estimate_path_error(const substeps *j, int32_t row, double from,
                                const ms_particle_path *p) {
  ms_stepper *s = j->s;
  const ms_bounds *b = &s->bounds;
  double bend[3], da[3], dx[3], dv[3];
  ms_unknowns_get(&s->model->unknowns, s->x_next, row, dx);
  ms_unknowns_get(&s->model->unknowns, s->v_next, row, dv);
  for (int c = 0; c < 3; c++) {
    bend[c] = p->w[c] - p->v[c], da[c] = p->b1[c] - p->b0[c];
    dx[c] -= p->x[c], dv[c] -= p->w[c];
  }
  const double size = fmax(ms_vec3_norm(p->b0), ms_vec3_norm(p->b1));
  double error = size > 0 ? ms_vec3_norm(bend) * ms_vec3_norm(da) / size : 0;
  if (from == 0)
    error = fmax(error, s->h * (b->omega * b->omega * ms_vec3_norm(dx) / 3 +
                                b->rate * ms_vec3_norm(dv) / 2));
  if (!(error <= s->path_error)) s->path_error = error, s->path_row = row;
}

/* 1: the particle follows its own path in the substep: its bounces are summed, its contact changes
 * or is one with a solid, or friction acts, and the method allows no force that depends on v. */
static int needs_path(const substeps *j, const ms_contact *c) {
  const int slides_with_friction = c->has_friction && !c->sticks && j->method->separable;
  return c->bounces || c->has_solid || slides_with_friction || c->change <= 1 || c->turns;
}

/*------------------------------------- the first impact -----------------------------------------*/

/* Computes a and a_end of the substep just made, if necessary. */
static void ensure_end_accelerations(substeps *j) {
  if (j->ends_known) return;
  if (!j->e->a_is_known) ms_contact_set_free_acceleration(j->s, 0, j->s->x, j->s->v, j->e->a);
  if (!j->e->ncontacts)
    ms_contact_set_free_acceleration(j->s, 1, j->s->x_next, j->s->v_next, j->e->a_end);
  j->e->a_is_known = 1;
  j->ends_known = 1;
}

/* 1: the particle may reach the plane in the substep just made, by Hermite's cubic with a margin of
 * 4 times its error, h^4/384 |x''''| <= h^4/384 omega^2 |x''|, |x''| taken from its ends. */
static int may_reach_plane(const substeps *j, int32_t row, const msim_plane *p) {
  const ms_stepper *s = j->s;
  const ms_unknowns *rows = &s->model->unknowns;
  double x[2][3], v[2][3];
  ms_unknowns_get(rows, s->x, row, x[0]);
  ms_unknowns_get(rows, s->v, row, v[0]);
  ms_unknowns_get(rows, s->x_next, row, x[1]);
  ms_unknowns_get(rows, s->v_next, row, v[1]);
  const double u0 = s->h * ms_vec3_dot(p->normal, v[0]), u1 = s->h * ms_vec3_dot(p->normal, v[1]);
  const double s0 = ms_impacts_distance(p, x[0]), s1 = ms_impacts_distance(p, x[1]),
               z = s->h * s->bounds.omega;
  const double bend =
      fmax(fabs(6 * (s1 - s0) - 4 * u0 - 2 * u1), fabs(6 * (s0 - s1) + 2 * u0 + 4 * u1));
  const ms_bernstein cubic = ms_bernstein_cubic(s0, u0, s1, u1);
  return ms_bernstein_lower_bound(&cubic) <= z * z / 96 * bend;
}

/* One component of x over the substep just made: the method's dense output, or Hermite's quintic */
static ms_bernstein find_component_polynomial(substeps *j, int32_t row, int32_t c) {
  const ms_stepper *s = j->s;
  const size_t at = (size_t)c * (size_t)s->model->unknowns.stride + (size_t)row;
  ms_bernstein of;
  if (j->method->path) {
    j->method->path(j->s, at, &of);
    return of;
  }
  ensure_end_accelerations(j);
  const double h = s->h, h2 = h * h;
  return ms_bernstein_quintic(s->x[at], h * s->v[at], h2 * j->e->a[at], s->x_next[at],
                              h * s->v_next[at], h2 * j->e->a_end[at]);
}

/* Most planes are level: components of x normal to n are left out. */
static ms_bernstein find_distance_polynomial(substeps *j, int32_t row, const msim_plane *p) {
  const ms_unknowns *rows = &j->s->model->unknowns;
  ms_bernstein sum = {.degree = -1};
  for (int32_t c = 0; c < rows->dims; c++) {
    const double n = p->normal[rows->axis[c]];
    if (n == 0) continue;
    const ms_bernstein of = find_component_polynomial(j, row, c);
    for (int i = 0; i <= of.degree; i++)
      sum.c[i] = (sum.degree < 0 ? -p->offset : sum.c[i]) + n * of.c[i];
    sum.degree = of.degree;
  }
  return sum;
}

/* The impact of a particle with a plane. If it touches the plane and does not separate from it, the
 * share is at least LEAST. */
static impact locate_impact(substeps *j, int32_t row, const msim_plane *p) {
  const double LEAST = 1. / 16;
  const ms_collision_planes planes = ms_contact_set_planes(j->s);
  impact of = {.share = MS_NOWHERE, .row = row, .plane = p};
  double x[3];
  if (!may_reach_plane(j, row, p)) return of;
  ms_unknowns_get(&j->s->model->unknowns, j->s->x, row, x);
  const ms_bernstein path = find_distance_polynomial(j, row, p);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x),
               q = ms_bernstein_find_crossing(&path, tolerance);
  const int leaves = path.c[1] - path.c[0] > tolerance;
  if (q > 1) return of;
  of.depth = -ms_bernstein_lower_bound(&path);
  of.share = path.c[0] <= tolerance && !leaves ? fmax(q, LEAST) : q;
  of.speed = fabs(ms_bernstein_evaluate_slope(&path, of.share)) / j->s->h;
  return of;
}

/* The largest second derivative of a cubic with values x and slopes u at both ends */
static double find_largest_bend(double x[2][3], double u[2][3]) {
  double start[3], end[3];
  for (int c = 0; c < 3; c++) {
    start[c] = 6 * (x[1][c] - x[0][c]) - 4 * u[0][c] - 2 * u[1][c];
    end[c] = 6 * (x[0][c] - x[1][c]) + 2 * u[0][c] + 4 * u[1][c];
  }
  return fmax(ms_vec3_norm(start), ms_vec3_norm(end));
}

/* 1: the particle may meet a solid in the substep just made, by Hermite's cubic with the margin of
 * may_reach_plane(): the distance from a solid changes at most as fast as the particle moves. */
static int may_meet_solid(const substeps *j, int32_t row) {
  enum { MOST = 64 };
  const ms_stepper *s = j->s;
  const ms_unknowns *rows = &s->model->unknowns;
  const ms_collision_planes planes = ms_contact_set_planes(s);
  double x[2][3], u[2][3], unused[3];
  if (!planes.nsolids) return 0;
  ms_unknowns_get(rows, s->x, row, x[0]);
  ms_unknowns_get(rows, s->v, row, u[0]);
  ms_unknowns_get(rows, s->x_next, row, x[1]);
  ms_unknowns_get(rows, s->v_next, row, u[1]);
  for (int c = 0; c < 3; c++) u[0][c] *= s->h, u[1][c] *= s->h;
  const double bend = find_largest_bend(x, u), z = s->h * s->bounds.omega,
               fastest = fmax(ms_vec3_norm(u[0]), ms_vec3_norm(u[1])) + bend,
               near = z * z / 96 * bend + ms_impacts_distance_tolerance(&planes, x[0]);
  for (int32_t i = 0; i < planes.nsolids; i++) {
    const double moved = ms_moving_obstacles_bound_displacement(&planes, i, x[0], fastest, s->h);
    double q = 0;
    for (int k = 0; q <= 1; k++) {
      double y[3];
      for (int c = 0; c < 3; c++) {
        const ms_bernstein cubic = ms_bernstein_cubic(x[0][c], u[0][c], x[1][c], u[1][c]);
        y[c] = ms_bernstein_evaluate(&cubic, q);
      }
      ms_solid room;
      const ms_instant at = {.t = s->t + q * s->h, .before = 1};
      const ms_solid *solid = ms_moving_obstacles_get(&planes, i, at, &room);
      const double distance =
          ms_obstacles_bound_distance(solid, ms_signed_distance(solid, y, unused));
      if (distance <= near || k == MOST) return 1;
      q += distance / (fastest + moved);
    }
  }
  return 0;
}

static int may_any_meet_solid(const substeps *j) {
  if (!j->e->near.nsolids) return 0;
  for (int32_t r = 0; r < j->s->model->unknowns.nfree; r++)
    if (may_meet_solid(j, r)) return 1;
  return 0;
}

/* Updates *first by the impacts of one particle: the earliest, and the largest depth. */
static void find_particle_impact(substeps *j, int32_t row, const ms_contact *c, impact *first) {
  const ms_collision_planes planes = ms_contact_set_planes(j->s);
  for (const msim_plane *p = planes.plane; p < planes.plane + planes.n - planes.nsolids; p++) {
    if (c && ms_impacts_contains_plane(&c->on, p)) continue;
    const impact i = locate_impact(j, row, p);
    const double depth = fmax(i.depth, first->depth);
    if (i.share < first->share) *first = i;
    first->depth = depth;
  }
}

/* The first impact of all particles but those that follow their own paths */
static impact find_first_impact(substeps *j) {
  const ms_contact_set *e = j->e;
  impact first = {.share = MS_NOWHERE};
  int32_t next = 0;
  for (int32_t r = 0; r < j->s->model->unknowns.nfree; r++) {
    const ms_contact *c = ms_contact_set_lookup(e, r, &next);
    if (!c || !needs_path(j, c)) find_particle_impact(j, r, c, &first);
  }
  return first;
}

/*------------------------------------- substeps -------------------------------------------------*/

/* Makes a substep of that length from s->x, s->v. */
static msim_status make_substep(substeps *j, double length, msim_error *err) {
  j->s->cached_stage = j->cached_stage;
  j->s->h = length, j->s->c = 0;
  j->s->work_in_step = j->work;
  j->s->dense_output = 0, j->s->h_made = 0;
  const msim_status status = j->method->step(j->s, err);
  if (!status) ms_contact_change_finish_substep(j->s);
  j->ends_known = j->e->ncontacts > 0;
  return status;
}

/* The factor by which a Newton iteration changes the length, to end at the impact */
static double newton_length_factor(const substeps *j, const impact *i) {
  double x[3], v[3];
  ms_unknowns_get(&j->s->model->unknowns, j->s->x_next, i->row, x);
  ms_unknowns_get(&j->s->model->unknowns, j->s->v_next, i->row, v);
  const double speed = -ms_vec3_dot(i->plane->normal, v), s = ms_impacts_distance(i->plane, x);
  const double rounding = 8 * DBL_EPSILON * fmax(j->e->reach, ms_vec3_norm(x));
  if (fabs(s) <= rounding || !(speed > 0)) return 1;
  return fmin(fmax(1 + s / (speed * j->s->h), 0.5), 2);
}

/* Ends the substep at a point of the dense output. */
static void end_at_dense_output(substeps *j, double share) {
  ms_stepper *s = j->s;
  ms_shortened_step_interpolate(j->method, s, share);
  s->work_in_step = j->work;
  if (j->method->counts_work) ms_stepper_add_trapezoidal_work(s, s->v);
  ms_contact_change_finish_substep(s);
  j->ends_known = j->e->ncontacts > 0;
}

/* Ends the substep at the impact, by dense output or by making it anew. */
static msim_status end_at_impact(substeps *j, const impact *i, msim_error *err) {
  enum { MOST = 6 };
  const double longest = j->h - j->done;
  double length = i->share * j->s->h;
  if (j->method->path) {
    end_at_dense_output(j, i->share);
    return MSIM_OK;
  }
  for (int k = 0; k < MOST; k++) {
    const msim_status status = make_substep(j, length, err);
    if (status) return status;
    const double next = fmin(length * newton_length_factor(j, i), longest);
    if (fabs(next - length) <= DBL_EPSILON * length) break;
    length = next;
  }
  return MSIM_OK;
}

/* The next substep starts where the last one ended. */
static void advance_substep(substeps *j) {
  ms_stepper *s = j->s;
  ms_contact_set_make_writable(s);
  ms_vector_copy(s->model->shape, s->x_next, s->x);
  ms_vector_copy(s->model->shape, s->v_next, s->v);
  s->t += s->h;
  j->work = s->work_in_step;
  if (j->ends_known) ms_contact_set_shift_acceleration(j->e);
}

/* x and v after a share of the substep, v by the cubic of v and a at both ends */
static void go_along(substeps *j, int32_t row, double share, ms_particle_path *p) {
  const ms_stepper *s = j->s;
  const ms_unknowns *rows = &s->model->unknowns;
  double v1[3];
  ms_unknowns_get(rows, s->v_next, row, v1);
  for (int32_t c = 0; c < rows->dims; c++) {
    const int k = rows->axis[c];
    const ms_bernstein x = find_component_polynomial(j, row, c);
    const ms_bernstein v = ms_bernstein_cubic(p->v[k], s->h * p->b0[k], v1[k], s->h * p->b1[k]);
    p->x[k] = ms_bernstein_evaluate(&x, share);
    p->v[k] = ms_bernstein_evaluate(&v, share);
  }
}

/* Follows a particle's own path from the share `from` on. A linear acceleration moves x by
 * t^2/2 (2 b0 + b1)/3, as the constant one of the path does. */
static void follow_path(substeps *j, int32_t row, double from, const ms_contact *contact) {
  ms_stepper *s = j->s;
  const ms_unknowns *rows = &s->model->unknowns;
  ms_particle_path p = ms_contact_set_make_path(s, row, j->e->a, j->e->a_end);
  p.t += from * p.h;
  p.h *= 1 - from;
  if (!(p.h > 0)) return;
  if (from > 0) go_along(j, row, from, &p);
  for (int c = 0; c < 3; c++) {
    p.b0[c] += from * (p.b1[c] - p.b0[c]);
    p.a[c] = (2 * p.b0[c] + p.b1[c]) / 3;
  }
  const double start[3] = {p.v[0], p.v[1], p.v[2]};
  if (contact && contact->bounces)
    ms_vec3_axpy(contact->rebound, contact->on.plane[0]->normal, p.v);
  memcpy(p.w, p.v, sizeof p.w);
  ms_particle_path_compute(&p);
  s->paths++;
  ms_contact_impulses_add_path(s, row, &p, start);
  estimate_path_error(j, row, from, &p);
  if (!p.is_complete) s->path_error = INFINITY, s->path_row = row;
  ms_unknowns_set(rows, p.x, row, s->x_next);
  ms_unknowns_set(rows, p.w, row, s->v_next);
  if (j->keeps_end && from == 0) {
    ms_unknowns_set(rows, p.x, row, s->x_spare[1]);
    ms_unknowns_set(rows, p.w, row, s->v_spare[1]);
  }
  s->stats->contacts += p.impacts;
  s->work_in_step += s->model->mass[row] * p.work;
  j->e->followed[j->e->nfollowed++] = row;
}

/* Follows the paths of particles that need them, or may meet solids, and, with `all`, of those with
 * an impact. */
static void follow_paths(substeps *j, int all) {
  ms_contact_set *e = j->e;
  const int solids = may_any_meet_solid(j);
  if (all || solids) ensure_end_accelerations(j);
  e->nfollowed = 0;
  int32_t next = 0;
  for (int32_t r = 0; r < j->s->model->unknowns.nfree && (all || solids || next < e->ncontacts);
       r++) {
    const ms_contact *c = ms_contact_set_lookup(e, r, &next);
    const int follows = (c && needs_path(j, c)) || (solids && may_meet_solid(j, r));
    double from = follows ? 0 : MS_NOWHERE;
    if (all && from > 1) {
      impact first = {.share = MS_NOWHERE};
      find_particle_impact(j, r, c, &first);
      if (first.share <= 1) from = c || j->method->entry.order == 1 ? 0 : first.share;
    }
    if (from <= 1) follow_path(j, r, from, c);
  }
  if (!e->nfollowed) return;
  j->s->npaths += e->nfollowed;
  j->ends_known = 0;
  j->s->cached_stage_next = 0;
  j->s->finite = 0;
}

/* 1: the substeps make up the whole step; then the result is the present state. */
static int is_done(substeps *j) {
  ms_stepper *s = j->s;
  if (j->h - j->done > 8 * DBL_EPSILON * j->h) return 0;
  ms_vector_copy(s->model->shape, s->x, s->x_next);
  ms_vector_copy(s->model->shape, s->v, s->v_next);
  return 1;
}

/* The share of the substep before the first change of a contact, or MS_NOWHERE. A sharp turn is one
 * where the particle is slowest; if its steps are `fixed`, half way at the latest. */
static double find_first_change(const substeps *j, int fixed) {
  const double HALF = 0.5;
  double first = MS_NOWHERE;
  for (const ms_contact *c = j->e->contact; c < j->e->contact + j->e->ncontacts; c++) {
    const double turn = !c->turns ? MS_NOWHERE : fixed ? HALF : c->slowest;
    if (!c->has_solid) first = fmin(first, fmin(turn, c->change));
  }
  return first;
}

/* The length of a substep that ends shortly before a change or, if that is near, shortly after it:
 * so the particle path over the change is short, and accurate. */
static double length_before(const substeps *j, double share) {
  const double NEAR = 1. / 16, near = NEAR * j->h, until = share * j->s->h - near / 2;
  return until > near / 2 ? until : fmin(near, j->s->h);
}

/* p^2/(16 omega): longer steps do not resolve the fastest vibrations, which then are of order 2 at
 * most; substeps would not be cost-effective. */
double ms_impact_location_longest_step(const ms_integrator *method, double omega) {
  const int p = method->entry.order;
  return p > 2 ? p * p / (16 * omega) : 0;
}

/* Under error control steps end at impacts, unless the penetration is within the tolerances: then
 * the particle may follow its own path, though dampers of its neighbours act by its velocity before
 * the impact. Methods with one estimate of their own, of order 2, do not permit this error. */
static int is_shallow(const substeps *j, double depth) {
  const int may_pass = !j->method->estimate || j->method->two_estimates;
  return may_pass && depth <= j->s->x_tolerance && j->s->bounds.rate * depth <= j->s->v_tolerance;
}

/* Dense output of a step in which particles pass an impact goes on without it, to a penetration
 * within the tolerances: through their state after the impact it would be wrong before it. */
static void keep_end(substeps *j) {
  ms_stepper *s = j->s;
  j->keeps_end = j->method->path && s->dense_output;
  if (!j->keeps_end) return;
  ms_vector_copy(s->model->shape, s->x_next, s->x_spare[1]);
  ms_vector_copy(s->model->shape, s->v_next, s->v_spare[1]);
}

static msim_status make_parts(substeps *j, msim_error *err) {
  ms_stepper *s = j->s;
  for (;;) {
    const double left = j->h - j->done;
    j->e->bounce_time = left;
    ms_contact_set_update(s);
    j->work = s->work_in_step;
    if (s->x == j->e->x || ms_contact_set_hash(s) != j->e->contact_hash) j->cached_stage = 0;
    if (is_done(j)) return MSIM_OK;
    msim_status status = make_substep(j, left, err);
    if (status) return status;
    const int all = !s->one_substep && (!j->may_divide || j->nsubsteps == MS_MAX_IMPACT_SUBSTEPS);
    const impact i = all ? (impact){.share = MS_NOWHERE} : find_first_impact(j);
    if (s->one_substep) {
      const int passes = is_shallow(j, i.depth);
      s->impact = passes ? MS_NOWHERE : i.share;
      s->impact_row = i.row, s->impact_speed = i.speed;
      s->change = find_first_change(j, 0);
      keep_end(j);
      follow_paths(j, i.share <= 1 && passes);
      if (j->keeps_end && j->e->nfollowed) s->h_made = s->h;
      if (!j->method->path) ms_contact_impulses_add_lasting(j->method, s, s->v);
      return MSIM_OK;
    }
    const double change = j->may_divide && j->nsubsteps < MS_MAX_CHANGE_SUBSTEPS
                              ? find_first_change(j, 1)
                              : MS_NOWHERE;
    if (change < i.share) status = make_substep(j, length_before(j, change), err);
    else if (i.share <= 1) status = end_at_impact(j, &i, err);
    if (status) return status;
    follow_paths(j, all);
    ms_contact_impulses_add_lasting(j->method, s, s->v);
    if (left - s->h <= 8 * DBL_EPSILON * j->h && i.share > 1) return MSIM_OK;
    j->done += s->h;
    advance_substep(j);
    j->nsubsteps++;
  }
}

msim_status ms_impact_location_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  ms_contact_set *e = s->events;
  substeps j = {.method = method,
                .s = s,
                .e = e,
                .h = s->h,
                .work = s->work_in_step,
                .cached_stage = s->cached_stage};
  j.may_divide = j.h <= ms_impact_location_longest_step(method, s->bounds.omega);
  const msim_status status = make_parts(&j, err);
  if (status) return status;
  if (j.nsubsteps || (e->ncontacts && !method->entry.implicit)) s->cached_stage_next = 0;
  if (!j.nsubsteps && j.ends_known) ms_contact_set_record(s);
  return MSIM_OK;
}
