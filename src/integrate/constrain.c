#include "integrate/constrain.h"

#include <math.h>
#include <stdlib.h>

#include "base/vec3.h"
#include "integrate/methods.h"

typedef struct constraint {
  const ms_integrator *method;
  const ms_integrator *by; /* makes steps with given velocities */
  ms_stepper *s;
  ms_events *e;
  const double *v_start; /* before anything bounced */
  int inelastic;
} constraint;

/*------------------------------------- normal velocities ----------------------------------------*/

/* The velocities that the planes of a contact give it, in place of those at the start. Its impulses
 * over h and m belong to the pressure of the planes. */
static void give_velocity(constraint *j, ms_contact *c) {
  ms_stepper *s = j->s;
  const ms_rows *rows = &s->model->rows;
  const double slow = 2 * s->h * ms_norm3(s->model->gravity);
  double x[3], v[3], to[MS_MOST_TOUCHED], J[MS_MOST_HOLDING] = {0};
  ms_row_get(rows, s->x, c->row, x);
  ms_row_get(rows, j->v_start, c->row, v);
  c->leaves = 0;
  for (int i = 0; i < c->on.n; i++) {
    const msim_plane *p = c->on.plane[i];
    const double back = -p->restitution * ms_dot3(p->normal, v);
    const int bounces = !j->inelastic && back > slow;
    to[i] = bounces ? back : -fmax(0, ms_distance(p, x)) / s->h;
    c->leaves |= bounces;
  }
  ms_meet(&c->on, to, v, J);
  ms_row_put(rows, v, c->row, s->v);
  c->jump = 0, c->least_jump = INFINITY;
  for (int i = 0; i < c->on.n && i < MS_MOST_HOLDING; i++) {
    c->jump += c->on.plane[i]->friction * J[i] / s->h;
    c->least_jump = fmin(c->least_jump, J[i] / s->h);
  }
}

static void give_velocities(constraint *j) {
  ms_contacts_own(j->s);
  ms_copy(j->s->model->shape, j->v_start, j->s->v);
  for (int32_t i = 0; i < j->e->ncontacts; i++) give_velocity(j, &j->e->contact[i]);
}

/*------------------------------------- what changes ---------------------------------------------*/

/* The planes of a row: those of its contact, if it has one, and what it has run into at the end of
 * the step. */
static ms_touch find_planes(const constraint *j, int32_t row, const ms_contact *c) {
  const ms_walls walls = ms_walls_of(j->s);
  double x[3];
  ms_touch on = c ? c->on : (ms_touch){0};
  ms_row_get(&j->s->model->rows, j->s->x_next, row, x);
  const double noise = ms_distance_noise(&walls, x);
  for (const msim_plane *p = walls.plane; p < walls.plane + walls.n; p++)
    if (on.n < MS_MOST_HOLDING && !ms_touch_holds(&on, p) && ms_distance(p, x) < -noise)
      on.plane[on.n++] = p;
  return on;
}

static int compare_rows(const void *a, const void *b) {
  const ms_contact *first = a, *second = b;
  return (first->row > second->row) - (first->row < second->row);
}

/* Rows that end behind planes become contacts, in the order of rows; how many. */
static int32_t let_in(constraint *j) {
  ms_events *e = j->e;
  int32_t nnew = 0, changed = 0, next = 0;
  for (int32_t r = 0; r < j->s->model->rows.nfree; r++) {
    ms_contact *c = ms_contact_of(e, r, &next);
    const ms_touch on = find_planes(j, r, c);
    if (on.n == (c ? c->on.n : 0)) continue;
    changed++;
    if (c) c->on = on;
    else
      e->contact[e->ncontacts + nnew++] =
          (ms_contact){.row = r, .on = on, .is_given = 1, .enters = 1};
  }
  e->ncontacts += nnew;
  qsort(e->contact, (size_t)e->ncontacts, sizeof *e->contact, compare_rows);
  j->s->stats->contacts += nnew;
  return changed;
}

/* Contacts on which a plane would pull leave; how many. */
static int32_t let_go(constraint *j) {
  ms_events *e = j->e;
  int32_t kept = 0;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    ms_contact c = e->contact[i];
    double a[3];
    ms_row_get(&j->s->model->rows, e->a_end, c.row, a);
    const double push = ms_contact_reaction(&c, a) + c.least_jump;
    if (push < -MS_PRESS * ms_norm3(a) && c.on.n == 1) continue;
    e->contact[kept++] = c;
  }
  const int32_t gone = e->ncontacts - kept;
  e->ncontacts = kept;
  return gone;
}

/* Friction by the pressure that was found, stick or slip; 1: they are others. */
static int find_friction(constraint *j, ms_contact *c) {
  const ms_rows *rows = &j->s->model->rows;
  const double NEARLY = 0.1, STOPS = 0.3, h = j->s->h;
  const ms_contact before = *c;
  double a[3], v[3];
  ms_row_get(rows, j->e->a_end, c->row, a);
  ms_row_get(rows, j->s->v_next, c->row, v);
  ms_contact_classify(c, rows->dims);
  c->friction = fmax(0, ms_keep_along(&c->on, a, NULL) + c->jump);
  ms_keep_along(&c->on, v, NULL);
  const double speed = ms_norm3(v), pull = ms_norm3(a), slow = 1e-3 * h * c->friction;
  if (before.sticks) {
    c->sticks = c->fixed || pull <= c->friction;
    c->slipped = !c->sticks;
    c->lag = fmax(h * (pull - c->friction), slow);
  } else {
    const double stop = before.friction > 0 && !c->slipped ? STOPS * c->lag : 0;
    c->sticks = c->fixed || (c->rubs && speed <= fmax(slow, stop));
    c->lag = fmax(speed, slow);
  }
  return before.sticks != c->sticks ||
         fabs(c->friction - before.friction) > NEARLY * fmax(before.friction, c->friction) ||
         (c->friction > 0 && !c->sticks && fabs(c->lag - before.lag) > NEARLY * c->lag);
}

/* Do the contacts change? By what the step just made says. */
static int update(constraint *j, int may_go) {
  int32_t changed = may_go ? let_go(j) : 0;
  for (int32_t i = 0; i < j->e->ncontacts; i++) changed += find_friction(j, &j->e->contact[i]);
  changed += let_in(j);
  return changed > 0;
}

/*------------------------------------- the step -------------------------------------------------*/

static double energy_of(const ms_stepper *s, const double *x, const double *v) {
  const ms_totals_copy copy = {s->events->stage[0], s->events->stage[1]};
  const ms_totals t = ms_totals_compute(s->model, x, v, &copy, s->events->parts);
  return t.kinetic + t.elastic - ms_dot3(s->model->gravity, t.moment);
}

static msim_status solve(constraint *j, msim_error *err) {
  enum { MOST = 4, MAY_GO = 2 };
  for (int i = 0; i < MOST; i++) {
    give_velocities(j);
    j->s->warm = 0;
    j->s->looked = 0;
    const msim_status status = j->by->step(j->s, err);
    if (status) return status;
    ms_contacts_finish(j->s);
    if (!update(j, i < MAY_GO)) break;
  }
  return MSIM_OK;
}

/* Contacts are what they were, as the method has it. */
static int is_settled(constraint *j) {
  int32_t next = 0;
  for (int32_t r = 0; r < j->s->model->rows.nfree; r++) {
    const ms_contact *c = ms_contact_of(j->e, r, &next);
    if (find_planes(j, r, c).n > (c ? c->on.n : 0) || (c && c->change <= 1)) return 0;
  }
  return 1;
}

/* By the first of these that feeds no energy: the method, if it is linear; implicit Euler; the same
 * without restitution, whatever it does. */
static msim_status make_anew(constraint *j, msim_error *err) {
  const ms_stepper *s = j->s;
  const ms_integrator *const by[] = {j->method, &ms_implicit_euler, &ms_implicit_euler};
  const double before = energy_of(s, s->x, j->v_start);
  for (int i = j->method->nonlinear ? 1 : 0;; i++) {
    j->by = by[i];
    j->inelastic = i == 2;
    const msim_status status = solve(j, err);
    if (status || i == 2 || energy_of(s, s->x_next, s->v_next) <= before) return status;
  }
}

msim_status ms_constrain_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  ms_events *e = s->events;
  constraint j = {.method = method, .s = s, .e = e, .v_start = s->v};
  const int64_t impacts = s->stats->contacts;
  const int carried = s->warm;
  ms_contacts_find(s);
  int made = 0;
  if (s->stats->contacts == impacts) {
    s->warm = s->x != e->x && ms_contacts_sign(s) == e->held ? carried : 0;
    const msim_status status = method->step(s, err);
    if (status && status != MSIM_NOT_CONVERGED) return status;
    made = !status;
    if (made) ms_contacts_finish(s);
    if (made && is_settled(&j)) {
      ms_contacts_note(s);
      return MSIM_OK;
    }
  }
  s->stats->contacts = impacts;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    ms_contact *c = &e->contact[i];
    c->is_given = 1;
    c->lag = INFINITY;
  }
  if (made) update(&j, 1);
  const msim_status status = make_anew(&j, err);
  s->warm_next = 0;
  return status;
}
