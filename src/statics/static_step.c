#include "statics/static_step.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/contact_curvature.h"
#include "contact/contact_joining.h"
#include "contact/solid_contact.h"
#include "physics/nonlinearity.h"
#include "statics/static_sim.h"

/* Work vectors of the stepper: forces with sliding friction; h times those that reactions do not
 * balance; velocities along normals that lead to the planes; d/h; forces after the step */
enum { FORCE, RIGHT_SIDE, PRESCRIBED, DIRECTION, FORCE_NEXT };

/* Friction of particles that slide, over the largest one of those that stick */
#define SLIDING 0.99

typedef struct static_solve {
  ms_stepper *s;
  ms_contact_set *e; /* NULL: without obstacles */
  const ms_unknowns *rows;
  double h;
  int is_limited;     /* h is shorter than wanted, for the trust region */
  int is_unsettled;   /* d may have another active set than the one that it was found with */
  int needs_slope;    /* the line search evaluates forces, too */
  double slope;       /* J: the work of the forces along d, to first order */
  double rounding;    /* J: reactions times rounding errors of positions */
  double alpha, gain; /* of the line search; gain: the reduction of U over alpha slope */
} static_solve;

/*------------------------------------- forces ---------------------------------------------------*/

/* The force on a particle in contact, raw; returns the limit of its friction. */
static double get_force(const static_solve *c, const ms_contact *on, double f[3]) {
  double left[3];
  ms_unknowns_get(c->rows, c->e->a, on->row, f);
  for (int k = 0; k < 3; k++) left[k] = f[k] *= c->s->model->mass[on->row];
  return ms_impacts_remove_normal(&on->on, left, NULL);
}

/* FORCE of a particle in contact */
static void set_force(const static_solve *c, const ms_contact *on) {
  double f[3];
  const double limit = get_force(c, on, f);
  if (!on->sticks && !on->enters) ms_vec3_axpy(-SLIDING * limit, on->sliding_direction, f);
  ms_unknowns_set(c->rows, f, on->row, c->s->work[FORCE]);
}

static int32_t count_contacts(const static_solve *c) { return c->e ? c->e->ncontacts : 0; }

static void find_free_forces(const static_solve *c, const double *x, double *force) {
  ms_stepper *s = c->s;
  ms_stepper_evaluate_model(s, s->model, &(ms_fused_step){.x = x, .v = s->v, .a = s->scratch});
  ms_vector_scale_rows(s->model->shape, s->model->mass, s->scratch, force);
}

static void find_forces(static_solve *c) {
  if (c->e) ms_contact_curvature_update(c->s);
  find_free_forces(c, c->s->x, c->s->work[FORCE]);
  for (int32_t i = 0; i < count_contacts(c); i++) set_force(c, &c->e->contact[i]);
}

/* 1: the change of energy that is known does not include friction or a force function. */
static int needs_slope(const ms_stepper *s) {
  if (s->model->function || !s->events) return s->model->function != NULL;
  const ms_collision_planes planes = ms_contact_set_planes(s);
  for (int32_t i = 0; i < planes.n; i++)
    if (planes.plane[i].friction > 0) return 1;
  return 0;
}

/*------------------------------------- a linear solve -------------------------------------------*/

/* RIGHT_SIDE without what reactions and static friction balance; PRESCRIBED */
static void constrain(static_solve *c, const ms_contact *on) {
  ms_stepper *s = c->s;
  const ms_collision_planes planes = ms_contact_set_planes(s);
  double x[3], b[3], v[3] = {0}, held[3], to[MS_MAX_TOUCHED_PLANES], J[MS_MAX_INDEPENDENT_PLANES];
  ms_unknowns_get(c->rows, s->x, on->row, x);
  ms_unknowns_get(c->rows, s->work[RIGHT_SIDE], on->row, b);
  memcpy(held, b, sizeof held);
  if (on->sticks) memset(b, 0, sizeof b);
  else ms_impacts_remove_normal(&on->on, b, NULL);
  ms_vec3_axpy(-1, b, held);
  c->rounding += ms_impacts_distance_tolerance(&planes, x) * ms_vec3_norm(held) / c->h;
  for (int i = 0; i < on->on.n; i++) to[i] = -ms_impacts_distance(on->on.plane[i], x) / c->h;
  ms_impacts_set_normal_components(&on->on, to, v, J);
  ms_unknowns_set(c->rows, b, on->row, s->work[RIGHT_SIDE]);
  ms_unknowns_set(c->rows, v, on->row, s->work[PRESCRIBED]);
}

static void form_right_side(static_solve *c) {
  ms_stepper *s = c->s;
  const ms_shape shape = s->model->shape;
  double *b = s->work[RIGHT_SIDE];
  ms_vector_copy(shape, s->work[FORCE], b);
  ms_vector_scale(shape, c->h, b);
  ms_vector_clear_all(shape, s->work[PRESCRIBED]);
  c->rounding = 0;
  for (int32_t i = 0; i < count_contacts(c); i++) constrain(c, &c->e->contact[i]);
  /* the solver's base moves with the particles, whose inertia acts on the whole displacement */
  ms_vector_scale_rows(shape, s->model->mass, s->work[PRESCRIBED], s->work[DIRECTION]);
  ms_vector_axpy(shape, -1, s->work[DIRECTION], b);
}

/* DIRECTION roughly, by conjugate gradients that leave the centres of mass of floating bodies where
 * forces do not move them */
static msim_status descend(const static_solve *c, ms_linear_system_spec *spec, msim_error *err) {
  const double ROUGH = 1e-2;
  ms_solver *solver = c->s->solver;
  const double *b = c->s->work[RIGHT_SIDE];
  double *v = c->s->work[DIRECTION];
  spec->rtol = ROUGH;
  const msim_status status = ms_solver_descend(solver, spec, b, v, err);
  if (!status) ms_momentum_balance(c->s->model, &solver->system.a, &solver->components, b, v);
  return status;
}

/* DIRECTION = d/h - PRESCRIBED with the present contacts. Where H is not positive definite, it is
 * clamped, without negative curvature. Without contacts, whose reactions need an accurate d,
 * conjugate gradients reduce the compression of those springs only that make H indefinite: in
 * slack cloth the clamped matrix is hundreds of times too stiff for motions out of its surface. */
static msim_status solve(static_solve *c, msim_error *err) {
  ms_stepper *s = c->s;
  ms_linear_system_spec spec = {.x = s->x,
                                .h = c->h,
                                .indefinite = -1,
                                .rtol = s->opt->newton_rtol,
                                .base = s->work[PRESCRIBED]};
  form_right_side(c);
  ms_stepper_linearize(s, s->x, s->v);
  if (!c->e && ms_solver_can_descend(s->solver)) return descend(c, &spec, err);
  ms_contact_curvature_constrain(s, -INFINITY, &spec);
  msim_status status =
      ms_solver_solve(s->solver, &spec, s->work[RIGHT_SIDE], s->work[DIRECTION], err);
  if (status != MSIM_NOT_SPD) return status;
  ms_contact_curvature_constrain(s, 0, &spec);
  spec.clamp = 1;
  return ms_solver_solve(s->solver, &spec, s->work[RIGHT_SIDE], s->work[DIRECTION], err);
}

/* DIRECTION = d/h, with the prescribed components, which weights have enforced roughly */
static void add_prescribed(const static_solve *c) {
  ms_stepper *s = c->s;
  ms_vector_axpy(s->model->shape, 1, s->work[PRESCRIBED], s->work[DIRECTION]);
  for (int32_t i = 0; i < count_contacts(c); i++) {
    const ms_contact *on = &c->e->contact[i];
    double v[3], along[3] = {0};
    if (!on->sticks) ms_unknowns_get(c->rows, s->work[DIRECTION], on->row, along);
    ms_impacts_remove_normal(&on->on, along, NULL);
    ms_unknowns_get(c->rows, s->work[PRESCRIBED], on->row, v);
    ms_vec3_axpy(1, along, v);
    ms_unknowns_set(c->rows, v, on->row, s->work[DIRECTION]);
  }
}

/*------------------------------------- the active set -------------------------------------------*/

/* Whether a particle sticks or slides; f: what reactions balance along the surface, v: its
 * velocity. Returns 1 if that has changed. */
static int update_friction(const static_solve *c, ms_contact *on, const double f[3],
                           const double v[3]) {
  double unused[3];
  const int before = on->sticks;
  const double limit = get_force(c, on, unused), pull = ms_vec3_norm(f);
  if (on->sticks && pull > limit) {
    on->sticks = 0;
    for (int k = 0; k < 3; k++) on->sliding_direction[k] = f[k] / pull;
  } else if (ms_vec3_dot(on->sliding_direction, v) < 0) on->sticks = 1;
  set_force(c, on);
  return on->sticks != before;
}

/* Removes planes that would have to pull, and lets the particle stick or slide, if it may change to
 * that. What reactions balance is the force less that which moves the weights of the constraint.
 * Returns 1 if the contact has changed. */
static int update_contact(const static_solve *c, ms_contact *on, const ms_constraint *g,
                          int may_change) {
  static const double zero[MS_MAX_TOUCHED_PLANES] = {0};
  const ms_plane_set all = on->on;
  double f[3], v[3], J[MS_MAX_INDEPENDENT_PLANES] = {0};
  ms_unknowns_get(c->rows, c->s->work[FORCE], on->row, f);
  ms_unknowns_get(c->rows, c->s->work[DIRECTION], on->row, v);
  for (int k = 0; k < g->n; k++)
    ms_vec3_axpy(g->weight / c->h * ms_vec3_dot(g->direction[k], v), g->direction[k], f);
  ms_impacts_set_normal_components(&all, zero, f, J);
  on->on.n = 0;
  for (int k = 0; k < all.n && k < MS_MAX_INDEPENDENT_PLANES; k++)
    if (J[k] >= 0) on->on.plane[on->on.n++] = all.plane[k];
  const int is_fixed = on->fixed, changed = on->on.n < all.n;
  ms_contact_set_classify(on, c->rows->dims);
  if (is_fixed && !on->fixed) on->sticks = 0;
  if (!on->on.n || on->fixed || on->enters || !on->has_friction) return changed;
  if (may_change) return update_friction(c, on, f, v) || changed;
  set_force(c, on);
  return changed;
}

/* together: friction of all particles may change, else of the first one only. */
static int update_contacts(static_solve *c, int together) {
  int32_t kept = 0;
  int changed = 0;
  for (int32_t i = 0; i < count_contacts(c); i++) {
    ms_contact *on = &c->e->contact[i];
    changed |= update_contact(c, on, &c->e->constraint[i], together || !changed);
    if (on->on.n) c->e->contact[kept++] = *on;
    else set_force(c, on);
  }
  if (c->e) c->e->ncontacts = kept;
  return changed;
}

static double find_largest_displacement(const static_solve *c) {
  double longest = 0;
  for (int32_t r = 0; r < c->rows->nfree; r++) {
    double v[3];
    ms_unknowns_get(c->rows, c->s->work[DIRECTION], r, v);
    longest = fmax(longest, c->h * ms_vec3_norm(v));
  }
  return longest;
}

/* d, with h so short that it lies in the trust region at first; solves until the active set stays,
 * MOST times. If friction of all particles changes TOGETHER, the sets may come round again; if only
 * that of the first one does, they cannot (least-index rule; Murty, Opsearch 11 (1974) 123). */
static msim_status find_direction(static_solve *c, ms_static_step *step, msim_error *err) {
  enum { MOST = 8, TOGETHER = 5 };
  ms_stepper *s = c->s;
  for (int i = 0, changed = 1; i < MOST && changed;) {
    const msim_status status = solve(c, err);
    if (status) return status;
    step->solves++;
    const double longest = i == 0 ? find_largest_displacement(c) : 0;
    if (longest > step->radius && step->solves < step->most) {
      c->is_limited = 1;
      c->h *= fmax(0.1, 0.9 * sqrt(step->radius / longest));
      continue;
    }
    changed = ++i < MOST ? update_contacts(c, i <= TOGETHER) : 0;
    add_prescribed(c);
    ms_vector_copy_all(s->model->shape, s->x, s->x_next);
    ms_vector_axpy(s->model->shape, c->h, s->work[DIRECTION], s->x_next);
    changed |= c->e && ms_contact_joining_add_penetrating(s, 0) > 0;
    c->is_unsettled = i == MOST;
  }
  return MSIM_OK;
}

/*------------------------------------- line search ----------------------------------------------*/

/* The planes of a contact onto which x is to be moved: those that it is behind, and, with `all`,
 * those whose edges it has not passed */
static ms_plane_set select_planes(const static_solve *c, const ms_contact *on, int all,
                                  const double x[3]) {
  const ms_collision_planes planes = ms_contact_set_planes(c->s);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  double from[3], displacement[3];
  ms_plane_set to = {0};
  ms_unknowns_get(c->rows, c->s->x, on->row, from);
  for (int k = 0; k < 3; k++) displacement[k] = x[k] - from[k];
  for (int i = 0; i < on->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(c->s, on->on.plane[i]);
    const int is_beyond =
        solid >= 0 && !on->enters &&
        ms_obstacles_is_beyond_edge(&c->e->near.solid[solid], from, displacement, tolerance);
    if ((all && !is_beyond) || ms_impacts_distance(on->on.plane[i], x) < 0)
      to.plane[to.n++] = on->on.plane[i];
  }
  return to;
}

/* Moves a particle onto its planes and surfaces, or out of those that it is yet to reach. */
static void place_contact(const static_solve *c, const ms_contact *on) {
  enum { MOST = 8 };
  const int all = !on->enters || c->alpha == 1;
  double x[3];
  ms_unknowns_get(c->rows, on->sticks && !on->enters ? c->s->x : c->s->x_next, on->row, x);
  for (int i = 0; i < (on->has_solid ? MOST : 1); i++) {
    ms_solid_contact_set_tangents(c->s, on, x);
    const ms_plane_set to = select_planes(c, on, all, x);
    ms_impacts_move_onto(&to, x);
  }
  ms_unknowns_set(c->rows, x, on->row, c->s->x_next);
}

/* x_next = x + alpha d, with particles moved onto the surfaces, and v_next = x_next - x */
static void move(const static_solve *c) {
  ms_stepper *s = c->s;
  const ms_shape shape = s->model->shape;
  ms_vector_copy_all(shape, s->x, s->x_next);
  ms_vector_axpy(shape, c->alpha * c->h, s->work[DIRECTION], s->x_next);
  if (c->e) ms_contact_joining_add_penetrating(s, 0);
  for (int32_t i = 0; i < count_contacts(c); i++) place_contact(c, &c->e->contact[i]);
  ms_vector_clear_all(shape, s->v_next);
  ms_vector_add_scaled(shape, s->x_next, -1, s->x, s->v_next);
}

/* Adds friction at x_next against the direction to f, which acts there. */
static void add_friction(const static_solve *c, const ms_contact *on, double f[3]) {
  const ms_collision_planes planes = ms_contact_set_planes(c->s);
  double x[3], along[3], left[3] = {f[0], f[1], f[2]};
  ms_unknowns_get(c->rows, c->s->x_next, on->row, x);
  ms_unknowns_get(c->rows, c->s->work[DIRECTION], on->row, along);
  for (int k = 0; k < on->on.n; k++)
    if (ms_impacts_distance(on->on.plane[k], x) > ms_impacts_distance_tolerance(&planes, x)) return;
  const double limit = ms_impacts_remove_normal(&on->on, left, NULL);
  ms_impacts_remove_normal(&on->on, along, NULL);
  if (!on->enters) memcpy(along, on->sliding_direction, sizeof along);
  const double speed = ms_vec3_norm(along);
  if (speed > 0) ms_vec3_axpy(-SLIDING * limit / speed, along, f);
}

/* What the forces at x_next would do along d */
static double find_next_slope(const static_solve *c) {
  ms_stepper *s = c->s;
  double *force = s->work[FORCE_NEXT];
  find_free_forces(c, s->x_next, force);
  for (int32_t i = 0; i < count_contacts(c); i++) {
    const ms_contact *on = &c->e->contact[i];
    double f[3];
    if (on->sticks) continue;
    ms_unknowns_get(c->rows, force, on->row, f);
    add_friction(c, on, f);
    ms_unknowns_set(c->rows, f, on->row, force);
  }
  return c->h * ms_vector_dot(s->model->shape, force, s->work[DIRECTION]);
}

/* The minimum along d of U = slope (-a + a^2/2 + b a^4): d is a step of Newton's method, and motion
 * across a spring stretches it by its square, so that U of nearly inextensible cloth is of the
 * fourth power. b follows from the gain at alpha, 1 - alpha/2 - b alpha^3. With a = alpha t the
 * slope is 0 where t^3 + p t = q, whose only real root is Cardano's. */
static double find_quartic_minimum(const static_solve *c) {
  const double b = 1 - c->alpha / 2 - c->gain, p = c->alpha / (4 * b), q = 1 / (4 * b);
  const double root = sqrt(q * q / 4 + p * p * p / 27);
  return c->alpha * (cbrt(q / 2 + root) + cbrt(q / 2 - root));
}

/* 1: alpha is accepted; else *better is the minimum of a quartic. */
static int try_alpha(static_solve *c, double *better) {
  ms_stepper *s = c->s;
  move(c);
  const double change = ms_nonlinearity_compute(s->model, s->x, 1, s->v_next, 1, s->scratch) -
                        ms_vector_dot(s->model->shape, s->work[FORCE], s->v_next);
  c->gain = -change / (c->alpha * c->slope);
  if (change > c->rounding - 1e-4 * c->alpha * c->slope) {
    *better = find_quartic_minimum(c);
    return 0;
  }
  const double next = c->needs_slope ? find_next_slope(c) : 0;
  *better = c->alpha * c->slope / (c->slope - next);
  return next >= -0.5 * c->slope - c->rounding;
}

static msim_status search_line(static_solve *c, msim_error *err) {
  enum { MOST = 12 };
  const ms_stepper *s = c->s;
  c->slope = c->h * ms_vector_dot(s->model->shape, s->work[FORCE], s->work[DIRECTION]);
  c->alpha = 1;
  for (int i = 0; i < MOST && c->slope > -c->rounding; i++) {
    double better;
    if (try_alpha(c, &better)) return MSIM_OK;
    c->alpha *= fmin(fmax(better / c->alpha, 0.1), 0.5);
  }
  return ms_error_set(err, MSIM_NOT_CONVERGED, "no step of h = %g s reduces the energy", c->h);
}

/*------------------------------------- the step -------------------------------------------------*/

/* h and radius of the next step. Where the active set is not settled and nothing moves, up to
 * rounding, it is shorter, so that particles that slide meet less resistance by others. */
static void adapt(const static_solve *c, msim_status status, ms_static_step *step) {
  const double GOOD = 0.3, FEW = 0.03, LEAST = 1e-3;
  step->h = c->h;
  if (status || (c->is_unsettled && c->slope < c->rounding)) step->h /= 10;
  else if (c->alpha < FEW) {
    step->h /= 10;
    step->radius =
        fmax(fmin(step->radius, c->alpha * find_largest_displacement(c)), LEAST * step->length);
  } else if (c->is_limited) step->radius *= 2, step->h *= 1.4;
  else if (c->alpha < 1) step->h /= 3;
  else if (c->gain > GOOD) step->h *= 5;
}

msim_status ms_static_step_make(ms_static_step *step, msim_sim *sim, double *x, msim_error *err) {
  msim_status status = ms_static_sim_start(sim, x, step->h, err);
  if (status) return status;
  ms_stepper *s = &sim->islands->stepper;
  double *const start = s->x, *const rest = s->v;
  static_solve c = {.s = s, .e = s->events, .rows = &s->model->unknowns, .h = step->h};
  c.needs_slope = needs_slope(s);
  find_forces(&c);
  status = find_direction(&c, step, err);
  if (!status) status = search_line(&c, err);
  if (!status) ms_unknowns_scatter(c.rows, s->x_next, x);
  s->x = start, s->v = rest;
  adapt(&c, status, step);
  return status;
}
