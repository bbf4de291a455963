#include "contact/implicit_contact.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/contact_change.h"
#include "contact/contact_impulses.h"
#include "contact/contact_joining.h"
#include "contact/implicit_impulses.h"
#include "contact/solid_contact.h"
#include "contact/step_energy.h"
#include "methods/methods.h"
#include "physics/external_force.h"
#include "physics/rank_model.h"
#include "scene/options.h"

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
  int bounces;      /* a particle has bounced */
  int law_matters;  /* KEEP_DISTANCE would change what the last solve prescribed */
  int is_linear;    /* linear steps near solids */
  int joined;       /* particles joined after the last solve */
  int has_solution; /* v_next is that of an earlier solve of the step */
} contact_solve;

/* Work vector of the guess; linear steps use those before it. */
enum { GUESS = 2 };

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
  const double kept[3] = {x[0] + c->frame.displacement[0], x[1] + c->frame.displacement[1],
                          x[2] + c->frame.displacement[2]};
  const double relative[3] = {v[0] - c->frame.velocity[0], v[1] - c->frame.velocity[1],
                              v[2] - c->frame.velocity[2]};
  const int keeps = j->law == KEEP_DISTANCE || c->keeps;
  if (c->has_solid && keeps) keep_from_solids(j, c, kept);
  for (int i = 0; i < c->on.n; i++) {
    const double distance = ms_impacts_distance(c->on.plane[i], x);
    const int is_tangent = ms_contact_set_find_solid(s, c->on.plane[i]) >= 0;
    const double gap = is_tangent ? distance : fmax(0, distance); /* < 0: near a curved surface */
    const double back = keeps ? 0 : find_rebound(j, c->row, c->on.plane[i], relative);
    const int reaches = back == 0 && !keeps;
    const double away =
        c->frame.moves ? ms_vec3_dot(c->on.plane[i]->normal, c->frame.displacement) / s->h : 0;
    to[i] = reaches ? -gap / s->h : away + back;
    c->end[i] = reaches ? 0 : gap + s->h * to[i];
    c->leave[i] = ms_vec3_dot(c->on.plane[i]->normal, c->frame.end) + back;
    j->bounces |= back > 0;
    j->law_matters |= !keeps && (back > 0 || gap != 0 || away != 0 || c->has_solid);
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
    for (int k = 0; k < 3; k++) v[k] = c->frame.displacement[k] / s->h;
    ms_impacts_set_normal_components(&c->on, to, v, J);
  }
  ms_unknowns_set(rows, v, c->row, s->v);
}

static void prescribe_velocities(contact_solve *j) {
  ms_contact_set_make_writable(j->s);
  ms_vector_copy(j->s->model->shape, j->v_start, j->s->v);
  j->law_matters = 0;
  for (int32_t i = 0; i < j->e->ncontacts; i++) prescribe_velocity(j, &j->e->contact[i]);
}

/*------------------------------------- contact changes ------------------------------------------*/

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
    c->sticks = c->fixed || (c->has_friction && !c->starts_slipping && speed <= fmax(slow, stop));
    c->friction_speed = fmax(speed, slow);
  }
  return before.sticks != c->sticks ||
         fabs(c->friction - before.friction) > NEARLY * fmax(before.friction, c->friction) ||
         (c->friction > 0 && !c->sticks &&
          fabs(c->friction_speed - before.friction_speed) > NEARLY * c->friction_speed);
}

/* Rough solves, which may remove contacts and change friction; in others particles only join, so
 * that the iteration ends. */
enum { ROUGH_SOLVES = 2 };

/* Moves tangent planes to where the step has led; returns 1 if the particle is to end elsewhere. */
static int update_tangents(contact_solve *j, ms_contact *c) {
  double x[3];
  int bounces = 0;
  for (int i = 0; i < c->on.n; i++)
    bounces |= c->leave[i] > ms_vec3_dot(c->on.plane[i]->normal, c->frame.end);
  if (bounces || !ms_solid_contact_may_be_concave(j->s, c) || !ms_solid_contact_is_off(j->s, c))
    return 0;
  ms_unknowns_get(&j->s->model->unknowns, j->s->x_next, c->row, x);
  ms_solid_contact_set_tangents(j->s, c, x);
  return 1;
}

/* Updates the contact set by solve number `solve`, from 0; returns 1 if it has changed on any rank.
 */
static int update_contacts(contact_solve *j, int solve) {
  const int is_rough = solve < ROUGH_SOLVES;
  const int keeps = j->e->near.nsolids > 0 && solve > 0;
  int32_t changed = is_rough ? remove_pulled(j) : 0;
  for (int32_t i = 0; i < j->e->ncontacts && is_rough; i++)
    changed += update_friction(j, &j->e->contact[i]) + update_tangents(j, &j->e->contact[i]);
  changed += ms_contact_joining_add_penetrating(j->s, keeps);
  ms_contact_set_share(j->s);
  return ms_rank_model_any(j->s->model, changed > 0);
}

/* Friction by the free acceleration at the start of the step, and whether the particle sticks */
static void start_friction(const contact_solve *j, ms_contact *c) {
  const ms_unknowns *rows = &j->s->model->unknowns;
  double a[3], v[3];
  ms_solid_contact_set_frame(j->s, c);
  ms_unknowns_get(rows, j->e->a, c->row, a);
  ms_unknowns_get(rows, j->s->v, c->row, v);
  ms_vec3_axpy(-1, c->frame.velocity, v);
  ms_contact_set_classify(c, rows->dims);
  const int still = ms_vec3_norm(v) == 0;
  c->friction = ms_impacts_remove_normal(&c->on, a, NULL);
  ms_impacts_remove_normal(&c->on, v, NULL);
  if (c->is_prescribed)
    c->sticks = c->fixed || (still && c->has_friction && ms_vec3_norm(a) <= c->friction);
  c->starts_slipping = still && !c->enters && c->has_friction && ms_vec3_norm(a) > c->friction;
  c->keeps = c->is_prescribed && c->sticks;
  c->is_prescribed = 1;
  c->friction_speed = fmax(ms_vec3_norm(v), 1e-3 * j->s->h * c->friction);
}

/*------------------------------------- the step -------------------------------------------------*/

/* The last v_next as a guess of the change of velocity in the next solve, which is 0 along
 * constraints */
static void make_guess(contact_solve *j) {
  const ms_stepper *s = j->s;
  const ms_unknowns *rows = &s->model->unknowns;
  ms_vector_clear_all(s->model->shape, s->work[GUESS]); /* 0 past the unknowns */
  ms_vector_add_scaled(s->model->shape, s->v_next, -1, s->v, s->work[GUESS]);
  for (int32_t i = 0; i < j->e->ncontacts; i++) {
    const ms_contact *c = &j->e->contact[i];
    double dv[3] = {0};
    if (!c->sticks) ms_unknowns_get(rows, s->work[GUESS], c->row, dv);
    if (!c->sticks) ms_impacts_remove_normal(&c->on, dv, NULL);
    ms_unknowns_set(rows, dv, c->row, s->work[GUESS]);
  }
  j->e->guess = s->work[GUESS];
}

/* The free accelerations that the reactions cancel, in a_end */
static void find_reactions(contact_solve *j, int is_linear) {
  for (int32_t i = 0; i < j->e->ncontacts; i++) {
    double a[3];
    ms_implicit_impulses_find_reaction(j->s, i, is_linear, a);
    ms_unknowns_set(&j->s->model->unknowns, a, j->e->contact[i].row, j->e->a_end);
  }
}

/* Solves the step with the present contacts. rtol: the relative residual, if larger than that of
 * the options */
static msim_status solve_once(contact_solve *j, const ms_integrator *by, double rtol,
                              msim_error *err) {
  ms_stepper *s = j->s;
  prescribe_velocities(j);
  j->e->guess = NULL;
  if (j->has_solution && !by->nonlinear) make_guess(j);
  j->e->continues = j->has_solution && !j->method->nonlinear;
  s->cached_stage = 0;
  s->dense_output = 0;
  j->e->draft_rtol = rtol;
  const msim_status status = by->step(s, err);
  j->e->draft_rtol = 0, j->e->guess = NULL, j->e->continues = 0;
  j->has_solution = !status;
  if (status) return status;
  ms_implicit_impulses_keep(s, j->v_start, !by->nonlinear);
  ms_contact_set_place(s);
  find_reactions(j, !by->nonlinear);
  return MSIM_OK;
}

#ifndef MS_ROUGH_RESIDUAL /* tests make it small */
#  define MS_ROUGH_RESIDUAL 3e-2
#endif

/* At most n solves that find out which particles are in contact, to a relative residual of
 * MS_ROUGH_RESIDUAL. The matrix is that of linearly-implicit-euler, also for methods that solve
 * nonlinear equations. */
static msim_status find_contacts(contact_solve *j, int n, msim_error *err) {
  int changes = 1;
  for (int i = 0; i < n && changes; i++) {
    const msim_status status = solve_once(j, &ms_linearly_implicit_euler, MS_ROUGH_RESIDUAL, err);
    if (status) return status;
    changes = update_contacts(j, i);
  }
  return MSIM_OK;
}

/* Solves the step with the contacts found. Particles that end behind planes or in solids join them,
 * and are moved onto the surfaces. */
static msim_status solve_contact_step(contact_solve *j, msim_error *err) {
  const msim_status status = solve_once(j, j->solve_method, 0, err);
  if (status) return status;
  j->joined = update_contacts(j, ROUGH_SOLVES);
  if (j->joined) ms_contact_set_place(j->s);
  ms_solid_contact_finish(j->s, j->law == KEEP_DISTANCE);
  return MSIM_OK;
}

/* 1 if the method's own step changes no contact of this rank */
static int is_settled(const contact_solve *j) {
  int32_t next = 0;
  for (int32_t r = 0; r < j->s->model->unknowns.nfree; r++) {
    const ms_contact *c = ms_contact_set_lookup(j->e, r, &next);
    if (ms_contact_joining_is_new(j->s, r, c) ||
        (c && (c->change <= 1 || c->turns || ms_solid_contact_is_off(j->s, c))))
      return 0;
  }
  return 1;
}

typedef enum energy_growth { NO_GROWTH, ERROR_OF_METHOD, OTHER_MINIMUM } energy_growth;

/* The error of implicit Euler, which follows curved surfaces by their tangents, is part of the
 * energy of motion. Where Newton's method arrived at another minimum, as that of a body turned
 * inside out, energy is more than twice as large. */
static energy_growth find_growth(contact_solve *j, const ms_step_energy *start) {
  double motion;
  const double most = start->most + (j->is_linear ? start->linear : 0);
  const double end = ms_step_energy_find_end(j->s, &motion);
  const double own = ms_solid_contact_find_work(j->s, j->v_start);
  const double by_solids = 2 * fabs(ms_rank_model_sum(j->s->model, own));
  const double excess = end - (most + (ms_step_energy_bound_work(j->s, j->v_start) + by_solids));
  if (!(excess > 0)) return NO_GROWTH;
  return excess > start->motion && excess > motion / 2 ? OTHER_MINIMUM : ERROR_OF_METHOD;
}

/* Makes the step under the present law; repeats it with particles that joined as long as it adds
 * energy. *growth: what it adds at last */
static msim_status try_law(contact_solve *j, const ms_step_energy *start, energy_growth *growth,
                           msim_error *err) {
  enum { MOST = 3 };
  const int is_last = j->law == KEEP_DISTANCE;
  msim_status status = is_last ? MSIM_OK : find_contacts(j, ROUGH_SOLVES, err);
  *growth = OTHER_MINIMUM;
  for (int i = 0; !status && *growth && (i == 0 || j->joined) && (i < MOST || is_last); i++) {
    status = solve_contact_step(j, err);
    if (!status) *growth = find_growth(j, start);
  }
  return status;
}

/* 1: KEEP_DISTANCE would prescribe the same, as it does for particles that stick, so that its step
 * is the one just made. */
static int is_step_of_last_law(const contact_solve *j) {
  return !j->joined && !ms_rank_model_any(j->s->model, j->law_matters);
}

/* Uses the first law under which the solve converges and the energy does not grow. Under the last
 * one planes do no work, so that only the error of implicit Euler remains. Steps of linear methods
 * near solids have a larger error of their own, where springs turn by large angles; if it adds
 * energy, the step is to be made in substeps. */
static msim_status remake_step(contact_solve *j, msim_error *err) {
  ms_stepper *s = j->s;
  j->is_linear = j->e->near.nsolids > 0 && !j->method->nonlinear;
  const ms_step_energy start = ms_step_energy_bound(s, j->v_start);
  j->solve_method = j->method->nonlinear ? &ms_implicit_euler : j->method;
  for (;;) {
    energy_growth growth;
    const msim_status status = try_law(j, &start, &growth, err);
    j->bounces = ms_rank_model_any(s->model, j->bounces);
    const int is_last = j->law == KEEP_DISTANCE || (j->is_linear && !j->bounces);
    if (status && (is_last || status != MSIM_NOT_CONVERGED)) return status;
    const int may_grow =
        growth == ERROR_OF_METHOD && !j->is_linear && (is_last || is_step_of_last_law(j));
    if (!status && (!growth || may_grow)) return MSIM_OK;
    if (is_last)
      return ms_error_set(
          err, MSIM_NOT_CONVERGED,
          "impacts on colliders add energy in a step of h = %g s; use a smaller h%s", s->h,
          j->is_linear ? ", or implicit-euler" : "");
    j->law = j->law == ELASTIC && j->bounces ? INELASTIC : KEEP_DISTANCE;
    if (!j->is_linear) j->solve_method = &ms_implicit_euler;
  }
}

/*------------------------------------- collision = reflect --------------------------------------*/

/* Two solves, the first of which finds the particles in contact, unless it was the method's own
 * step. With incomplete = accept they share the iterations of a step. */
static msim_status solve_twice(contact_solve *j, msim_error *err) {
  const msim_options *opt = j->s->opt;
  if (ms_options_accept_incomplete(opt))
    j->e->most_iterations = (opt->solver_max_iterations + 1) / 2;
  msim_status status = j->has_solution ? MSIM_OK : find_contacts(j, 1, err);
  if (!status) status = solve_once(j, j->method, 0, err);
  j->e->most_iterations = 0;
  return status;
}

/* One step of a linear method. Particles that end inside are reflected. */
static msim_status make_reflected_step(contact_solve *j, msim_error *err) {
  ms_stepper *s = j->s;
  const double before = ms_rank_model_sum(s->model, s->work_in_step);
  const ms_step_energy start = ms_step_energy_bound(s, j->v_start);
  const msim_status status = solve_twice(j, err);
  if (status) return status;
  ms_solid_contact_finish(s, 0);
  s->work_in_step += ms_implicit_impulses_find_work(s);
  ms_implicit_impulses_add(s);
  ms_stepper_reflect_remaining(s, s->contact_log);
  ms_step_energy_shorten(
      s, start.most + start.linear - before + ms_step_energy_bound_work(s, j->v_start));
  return MSIM_OK;
}

/* The method's own step, which is the result if it changes no contact: *settled. cached: the
 * cached-stage tag at the start */
static msim_status make_own_step(contact_solve *j, int cached, int *settled, msim_error *err) {
  ms_stepper *s = j->s;
  *settled = 0;
  const int is_new = s->x == j->e->x || ms_contact_set_hash(s) != j->e->contact_hash;
  s->cached_stage = ms_rank_model_any(s->model, is_new) ? 0 : cached;
  s->c = 0;
  j->e->may_reject = j->method == &ms_implicit_euler; /* its iterate is x_next */
  j->e->rejected = 0;
  const msim_status status = j->method->step(s, err);
  j->e->may_reject = 0;
  if (status) return status == MSIM_NOT_CONVERGED ? MSIM_OK : status;
  if (j->e->rejected) return MSIM_OK; /* too rough for reactions */
  j->has_solution = 1;
  if (j->method->entry.order == 1) ms_implicit_impulses_keep(s, j->v_start, !j->method->nonlinear);
  ms_contact_change_finish_substep(s);
  *settled = !ms_rank_model_any(s->model, !is_settled(j));
  if (!*settled) {
    if (!ms_stepper_has_contacts(s)) /* those that are predicted are updated by it */
      ms_contact_set_free_acceleration(s, 1, s->x_next, s->v_next, j->e->a_end);
    return MSIM_OK;
  }
  if (ms_solid_contact_finish(s, 0)) s->cached_stage_next = 0;
  else ms_contact_set_record(s);
  if (j->method->entry.order == 1) ms_implicit_impulses_add(s);
  else ms_contact_impulses_add_lasting(j->method, s, j->v_start);
  return MSIM_OK;
}

/* 1: a step may be the method's own, as far as contacts at its start are concerned. Not with solids
 * in linear methods, where it would be one more solve like those of the remade step, nor with
 * collision = reflect, as methods of order 2 restart after each reflection. */
static int may_make_own_step(const contact_solve *j) {
  const int may_touch =
      j->s->opt->collision == MSIM_COLLISION_EVENT && (j->method->nonlinear || !j->e->near.nsolids);
  return !ms_solid_contact_any_moves(j->s) && (may_touch || !ms_stepper_has_contacts(j->s));
}

static int64_t count_planes(const ms_contact_set *e) {
  int64_t n = 0;
  for (int32_t i = 0; i < e->ncontacts; i++) n += e->contact[i].on.n;
  return n;
}

/* 1: implicit Euler would drop its own step, and make it once more with other contacts: particles
 * are predicted to meet more planes than the n that they touch, or slide to a stop. */
static int expects_change(const contact_solve *j, int64_t n) {
  const int changes = count_planes(j->e) > n || ms_contact_change_any_stops(j->s);
  return ms_rank_model_any(j->s->model, changes);
}

msim_status ms_implicit_contact_step(const ms_integrator *method, ms_stepper *s, msim_error *err) {
  ms_contact_set *e = s->events;
  contact_solve j = {.method = method, .s = s, .e = e, .v_start = s->v};
  const int64_t before = s->stats->contacts;
  const int cached = s->cached_stage, is_euler = method == &ms_implicit_euler;
  const double work = s->work_in_step;
  struct ms_contact_log *log = s->contact_log;
  s->contact_log = NULL;
  ms_contact_set_update(s);
  s->contact_log = log;
  s->work_in_step = work; /* the step starts before any bounce */
  ms_solid_contact_move_to_end(s);
  const int impacts = s->stats->contacts > before;
  const int predicts = !method->nonlinear || is_euler;
  const int64_t n = count_planes(e);
  int64_t predicted = predicts ? ms_contact_joining_add_predicted(s) : 0;
  if (!impacts && may_make_own_step(&j) && !(is_euler && expects_change(&j, n))) {
    int settled;
    const msim_status status = make_own_step(&j, cached, &settled, err);
    if (status || settled) return status;
  }
  if (!predicts) predicted = ms_contact_joining_add_predicted(s);
  s->stats->contacts = before + predicted;
  for (int32_t i = 0; i < e->ncontacts; i++) start_friction(&j, &e->contact[i]);
  if (j.has_solution) update_contacts(&j, 0);
  const int reflects = !method->nonlinear && s->opt->collision == MSIM_COLLISION_REFLECT;
  const msim_status status = reflects ? make_reflected_step(&j, err) : remake_step(&j, err);
  s->cached_stage_next = 0;
  if (status || reflects) return status;
  s->work_in_step += ms_solid_contact_find_work(s, j.v_start);
  ms_implicit_impulses_add(s);
  return MSIM_OK;
}
