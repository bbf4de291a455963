#include "contact/implicit_contact.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/solid_contact.h"
#include "methods/methods.h"
#include "physics/external_force.h"
#include "physics/force_function.h"

/* Velocities along the normals: particles that are fast enough bounce; all particles reach the
 * plane; all particles keep their distances from it */
typedef enum impact_law { ELASTIC, INELASTIC, KEEP_DISTANCE } impact_law;

typedef struct contact_solve {
  const ms_integrator *method;
  const ms_integrator *solve_method; /* makes the steps with prescribed velocities */
  ms_stepper *s;
  ms_contact_set *e;
  const double *v_start; /* at the start of the step, before any bounce */
  impact_law law;
  int bounces; /* a particle has bounced */
} contact_solve;

/*------------------------------------- normal velocities ----------------------------------------*/

/* The speed at which a particle with velocity v before the step bounces off a plane; 0: it does
 * not bounce. */
static double find_rebound(const contact_solve *j, int32_t row, const msim_plane *p,
                           const double v[3]) {
  const ms_model *m = j->s->model;
  const double slow =
      2 * j->s->h * (ms_external_acceleration(&m->external) + ms_model_force_acceleration(m, row));
  const double back = -p->restitution * ms_vec3_dot(p->normal, v);
  return j->law == ELASTIC && back > slow ? back : 0;
}

/* To keep its distance a particle moves along the tangent plane at its start; inside out solids
 * curve towards it, so that it stays. */
static void keep_from_solids(const contact_solve *j, ms_contact *c, const double x[3]) {
  ms_solid_contact_set_tangents(j->s, c, x);
  c->sticks |= ms_solid_contact_may_be_concave(j->s, c);
}

/* Replaces the normal velocities at the start by the prescribed ones; a particle that sticks has no
 * other. The impulses J per mass, over h, add to the normal forces per mass. */
static void prescribe_velocity(contact_solve *j, ms_contact *c) {
  const ms_stepper *s = j->s;
  const ms_unknowns *rows = &s->model->unknowns;
  double x[3], v[3], to[MS_MAX_TOUCHED_PLANES], J[MS_MAX_INDEPENDENT_PLANES] = {0};
  ms_unknowns_get(rows, s->x, c->row, x);
  ms_unknowns_get(rows, j->v_start, c->row, v);
  ms_solid_contact_set_frame(s, c);
  const double kept[3] = {x[0] + c->frame.way[0], x[1] + c->frame.way[1], x[2] + c->frame.way[2]};
  const double relative[3] = {v[0] - c->frame.velocity[0], v[1] - c->frame.velocity[1],
                              v[2] - c->frame.velocity[2]};
  if (c->has_solid && j->law == KEEP_DISTANCE) keep_from_solids(j, c, kept);
  for (int i = 0; i < c->on.n; i++) {
    const double distance = ms_impacts_distance(c->on.plane[i], x);
    const int is_tangent = ms_contact_set_find_solid(s, c->on.plane[i]) >= 0;
    const double gap = is_tangent ? distance : fmax(0, distance); /* < 0: near a curved surface */
    const double back = find_rebound(j, c->row, c->on.plane[i], relative);
    const int reaches = back == 0 && j->law != KEEP_DISTANCE;
    const double away =
        c->frame.moves ? ms_vec3_dot(c->on.plane[i]->normal, c->frame.way) / s->h : 0;
    to[i] = reaches ? -gap / s->h : away + back;
    c->end[i] = reaches ? 0 : gap + s->h * to[i];
    c->leave[i] = ms_vec3_dot(c->on.plane[i]->normal, c->frame.end) + back;
    j->bounces |= back > 0;
  }
  double end[3] = {v[0], v[1], v[2]};
  ms_impacts_set_normal_components(&c->on, to, v, J);
  if (c->has_solid) ms_impacts_set_normal_components(&c->on, c->leave, end, J);
  c->impulse_friction = 0, c->least_jump = INFINITY;
  for (int i = 0; i < c->on.n && i < MS_MAX_INDEPENDENT_PLANES; i++) {
    c->impulse_friction += c->on.plane[i]->friction * J[i] / s->h;
    c->least_jump = fmin(c->least_jump, J[i] / s->h);
  }
  if (c->sticks) {
    for (int k = 0; k < 3; k++) v[k] = c->frame.way[k] / s->h;
    ms_impacts_set_normal_components(&c->on, to, v, J);
  }
  ms_unknowns_set(rows, v, c->row, s->v);
}

static void prescribe_velocities(contact_solve *j) {
  ms_contact_set_make_writable(j->s);
  ms_vector_copy(j->s->model->shape, j->v_start, j->s->v);
  for (int32_t i = 0; i < j->e->ncontacts; i++) prescribe_velocity(j, &j->e->contact[i]);
}

/*------------------------------------- contact changes ------------------------------------------*/

/* Adds the planes to those of an unknown that it is behind at the end of the step. */
static void add_planes(const contact_solve *j, int32_t row, ms_plane_set *on) {
  const ms_collision_planes planes = ms_contact_set_planes(j->s);
  double x[3];
  ms_unknowns_get(&j->s->model->unknowns, j->s->x_next, row, x);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  for (const msim_plane *p = planes.plane; p < planes.plane + planes.n - planes.nsolids; p++)
    if (on->n < MS_MAX_INDEPENDENT_PLANES && !ms_impacts_contains_plane(on, p) &&
        ms_impacts_distance(p, x) < -tolerance)
      on->plane[on->n++] = p;
}

/* The same for tangent planes of solids */
static void add_tangents(const contact_solve *j, ms_contact *c) {
  double at[3];
  for (int32_t i = 0; i < j->e->near.nsolids && c->on.n < MS_MAX_INDEPENDENT_PLANES; i++)
    if (ms_solid_contact_meets(j->s, c->row, c, i, at)) ms_contact_set_add_tangent(j->s, c, i, at);
}

static int compare_rows(const void *a, const void *b) {
  const ms_contact *first = a, *second = b;
  return (first->row > second->row) - (first->row < second->row);
}

/* Adds particles that end behind planes to the contact set, sorted by row; returns the number of
 * contacts that are new or have new planes. */
static int32_t add_penetrating(contact_solve *j) {
  ms_contact_set *e = j->e;
  int32_t nnew = 0, changed = 0, next = 0;
  for (int32_t r = 0; r < j->s->model->unknowns.nfree; r++) {
    ms_contact *c = ms_contact_set_lookup(e, r, &next);
    ms_contact with = c ? *c : (ms_contact){.row = r, .is_prescribed = 1};
    const int before = with.on.n;
    add_planes(j, r, &with.on);
    add_tangents(j, &with);
    if (with.on.n == before) continue;
    changed++;
    with.enters = 1;
    if (c) *c = with;
    else e->contact[e->ncontacts + nnew++] = with;
  }
  e->ncontacts += nnew;
  qsort(e->contact, (size_t)e->ncontacts, sizeof *e->contact, compare_rows);
  j->s->stats->contacts += nnew;
  return changed;
}

/* Removes contacts with one plane if this plane would have to pull. Returns their number. */
static int32_t remove_pulled(contact_solve *j) {
  ms_contact_set *e = j->e;
  int32_t kept = 0;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    ms_contact c = e->contact[i];
    double a[3];
    ms_unknowns_get(&j->s->model->unknowns, e->a_end, c.row, a);
    const double push = ms_contact_set_reaction(&c, a) + c.least_jump;
    if (push < -MS_REACTION_TOLERANCE * ms_vec3_norm(a) && c.on.n == 1) continue;
    e->contact[kept++] = c;
  }
  const int32_t gone = e->ncontacts - kept;
  e->ncontacts = kept;
  return gone;
}

/* Friction from the normal force of the last solve, and whether the particle sticks or slips;
 * returns 1 if either has changed. */
static int update_friction(contact_solve *j, ms_contact *c) {
  const ms_unknowns *rows = &j->s->model->unknowns;
  const double NEARLY = 0.1, STOPS = 0.3, h = j->s->h;
  const ms_contact before = *c;
  double a[3], v[3], start[3];
  ms_unknowns_get(rows, j->e->a_end, c->row, a);
  ms_unknowns_get(rows, j->s->v_next, c->row, v);
  ms_unknowns_get(rows, j->v_start, c->row, start);
  ms_vec3_axpy(-1, c->frame.end, v), ms_vec3_axpy(-1, c->frame.end, start);
  ms_contact_set_classify(c, rows->dims);
  c->friction = fmax(0, ms_impacts_remove_normal(&c->on, a, NULL) + c->impulse_friction);
  ms_impacts_remove_normal(&c->on, v, NULL);
  ms_impacts_remove_normal(&c->on, start, NULL);
  ms_vec3_axpy(1 / h, start, a);
  const double speed = ms_vec3_norm(v), pull = ms_vec3_norm(a), slow = 1e-3 * h * c->friction;
  if (before.sticks) {
    c->sticks = c->fixed || pull <= c->friction;
    c->slipped = !c->sticks;
    c->friction_speed = fmax(h * (pull - c->friction), slow);
  } else {
    const double stop = before.friction > 0 && !c->slipped ? STOPS * c->friction_speed : 0;
    c->sticks = c->fixed || (c->has_friction && speed <= fmax(slow, stop));
    c->friction_speed = fmax(speed, slow);
  }
  return before.sticks != c->sticks ||
         fabs(c->friction - before.friction) > NEARLY * fmax(before.friction, c->friction) ||
         (c->friction > 0 && !c->sticks &&
          fabs(c->friction_speed - before.friction_speed) > NEARLY * c->friction_speed);
}

/* Solves before these numbers may remove contacts, and change friction; then particles only join,
 * so that the iteration ends. */
enum { REMOVAL_SOLVES = 2, FRICTION_SOLVES = 3, TANGENT_SOLVES = 6 };

/* Moves tangent planes to where the step has led; returns 1 if the particle is to end elsewhere. */
static int update_tangents(contact_solve *j, ms_contact *c) {
  double x[3];
  int bounces = 0;
  for (int i = 0; i < c->on.n; i++)
    bounces |= c->leave[i] > ms_vec3_dot(c->on.plane[i]->normal, c->frame.end);
  if (bounces || !ms_solid_contact_is_off(j->s, c)) return 0;
  ms_unknowns_get(&j->s->model->unknowns, j->s->x_next, c->row, x);
  ms_solid_contact_set_tangents(j->s, c, x);
  return 1;
}

/* Updates the contact set by the step just made; returns 1 if it has changed. */
static int update_contacts(contact_solve *j, int solves) {
  int32_t changed = solves < REMOVAL_SOLVES ? remove_pulled(j) : 0;
  for (int32_t i = 0; i < j->e->ncontacts && solves < FRICTION_SOLVES; i++)
    changed += update_friction(j, &j->e->contact[i]);
  for (int32_t i = 0; i < j->e->ncontacts && solves < TANGENT_SOLVES; i++)
    changed += update_tangents(j, &j->e->contact[i]);
  changed += add_penetrating(j);
  return changed > 0;
}

/*------------------------------------- the step -------------------------------------------------*/

/* J */
typedef struct energy {
  double total;            /* kinetic, elastic and gravitational energy */
  double motion, rounding; /* the first two, and the rounding tolerance of all */
} energy;

static energy find_energy(const ms_stepper *s, const double *x, const double *v) {
  const ms_totals_copy copy = {s->events->stage[0], s->events->stage[1]};
  const ms_totals t = ms_totals_compute(s->model, x, v, &copy, s->events->parts);
  const ms_external *forces = &s->model->external;
  double weight = 0; /* sum of the magnitudes of external forces, N */
  for (int32_t r = 0; r < s->model->unknowns.nfree; r++)
    weight += s->model->mass[r] *
              (ms_external_acceleration(forces) + ms_model_force_acceleration(s->model, r));
  const double potential =
      s->model->function ? ms_force_function_compute_potential(s->model, x) : 0;
  return (energy){.total = t.kinetic + t.elastic - ms_external_work(forces, t.moment) -
                           t.force_work + potential,
                  .motion = t.kinetic + t.elastic,
                  .rounding = 1e-12 * (t.kinetic + t.elastic + weight * s->events->reach)};
}

/* A bound on the work of moving pins and of a force function in the step just made, J: twice its
 * trapezoidal rule */
static double bound_work(contact_solve *j) {
  ms_stepper *s = j->s;
  const double before = s->work_in_step;
  s->work_in_step = 0;
  ms_stepper_add_trapezoidal_work(s, j->v_start);
  const double work = s->work_in_step;
  s->work_in_step = before;
  return 2 * fabs(work);
}

/* Solves the step until the contact set stays the same. For KEEP_DISTANCE, which starts from the
 * contacts and friction found before, particles can only join. */
static msim_status solve_contact_step(contact_solve *j, msim_error *err) {
  for (int solves = j->law == KEEP_DISTANCE ? TANGENT_SOLVES : 0;; solves++) {
    prescribe_velocities(j);
    j->s->cached_stage = 0;
    j->s->dense_output = 0;
    const msim_status status = j->solve_method->step(j->s, err);
    if (status) return status;
    ms_contact_set_finish_substep(j->s);
    if (update_contacts(j, solves)) continue;
    ms_solid_contact_finish(j->s, j->law == KEEP_DISTANCE);
    return MSIM_OK;
  }
}

/* 1 if the method's own step changes no contact */
static int is_settled(contact_solve *j) {
  int32_t next = 0;
  for (int32_t r = 0; r < j->s->model->unknowns.nfree; r++) {
    const ms_contact *c = ms_contact_set_lookup(j->e, r, &next);
    ms_plane_set on = c ? c->on : (ms_plane_set){0};
    const int before = on.n;
    double at[3];
    add_planes(j, r, &on);
    if (on.n > before || (c && (c->change <= 1 || ms_solid_contact_is_off(j->s, c)))) return 0;
    for (int32_t i = 0; i < j->e->near.nsolids; i++)
      if (ms_solid_contact_meets(j->s, r, c, i, at)) return 0;
  }
  return 1;
}

/* Uses the first law under which the solve converges and the energy does not grow. Under the last
 * one planes do no work, so that only the error of implicit Euler remains. Near solids it may take
 * very many iterations, as where a cloth folds: there linear methods try all laws by themselves,
 * with a small error of their own; if it is larger, the step is to be made in substeps. */
static msim_status remake_step(contact_solve *j, msim_error *err) {
  const double SMALL = 1e-4; /* growth over kinetic and elastic energy */
  ms_stepper *s = j->s;
  const int prefers_own = j->e->near.nsolids > 0 && !j->method->nonlinear;
  const energy start = find_energy(s, s->x, j->v_start);
  j->solve_method = j->method->nonlinear ? &ms_implicit_euler : j->method;
  for (;;) {
    const msim_status status = solve_contact_step(j, err);
    const int is_last = j->law == KEEP_DISTANCE;
    if ((is_last && !prefers_own) || (status && status != MSIM_NOT_CONVERGED)) return status;
    const double most = start.total + start.rounding + (is_last ? SMALL * start.motion : 0);
    const double work = ms_solid_contact_find_work(s, j->v_start);
    if (!status &&
        find_energy(s, s->x_next, s->v_next).total <= most + bound_work(j) + 2 * fabs(work))
      return status;
    if (is_last)
      return ms_error_set(err, MSIM_NOT_CONVERGED,
                          "impacts on colliders add energy in a step of h = %g s; use a smaller h, "
                          "or implicit-euler",
                          s->h);
    j->law = j->law == ELASTIC && j->bounces ? INELASTIC : KEEP_DISTANCE;
    if (!prefers_own) j->solve_method = &ms_implicit_euler;
  }
}

msim_status ms_implicit_contact_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  ms_contact_set *e = s->events;
  contact_solve j = {.method = method, .s = s, .e = e, .v_start = s->v};
  const int64_t impacts = s->stats->contacts;
  const int carried = s->cached_stage;
  const double work = s->work_in_step;
  ms_contact_set_update(s);
  s->work_in_step = work; /* the step starts before any bounce */
  ms_solid_contact_move_to_end(s);
  int made = 0;
  if (s->stats->contacts == impacts && !ms_solid_contact_any_moves(s)) {
    s->cached_stage = s->x != e->x && ms_contact_set_hash(s) == e->contact_hash ? carried : 0;
    s->c = 0;
    const msim_status status = method->step(s, err);
    if (status && status != MSIM_NOT_CONVERGED) return status;
    made = !status;
    if (made) ms_contact_set_finish_substep(s);
    if (made && is_settled(&j)) {
      if (ms_solid_contact_finish(s, 0)) s->cached_stage_next = 0;
      else ms_contact_set_record(s);
      return MSIM_OK;
    }
  }
  s->stats->contacts = impacts;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    ms_contact *c = &e->contact[i];
    c->is_prescribed = 1;
    c->friction_speed = INFINITY;
  }
  if (made) update_contacts(&j, 0);
  const msim_status status = remake_step(&j, err);
  if (!status) s->work_in_step += ms_solid_contact_find_work(s, j.v_start);
  s->cached_stage_next = 0;
  return status;
}
