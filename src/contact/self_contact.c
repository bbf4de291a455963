#include "contact/self_contact.h"

#include <string.h>

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/contact_projection.h"
#include "contact/pair_impulses.h"
#include "contact/step_energy.h"
#include "physics/external_force.h"
#include "physics/moving_pins.h"
#include "scene/motions.h"

enum {
  ROUNDS = 4, /* of searches for collisions */
  SWEEPS = 10 /* in each round */
};

struct ms_self_contact {
  double friction;
  int is_linear;  /* of implicit methods: 1: linear in the unknowns of a step */
  int is_bounded; /* 1: steps with contact must not add what those without it add */
  ms_surface_pairs pairs;
  ms_contact_projection projection; /* of implicit methods; else empty */
  ms_contact_bodies bodies;
  double *x0, *x1, *v; /* 3 nnodes: at the start and at the end of the step */
  int32_t *stopped;    /* nnodes: the pass in which a node was stopped; 0: it was not */
  double pin_work;     /* J: of moving pins on springs in the step without contact */
  double *best[2];     /* vectors: of several ends of the step, that with the least energy */
  ms_totals *parts;    /* scratch */
};

msim_status ms_self_contact_create(const ms_integrator *method, const ms_model *model,
                                   ms_self_contact **contact, msim_error *err) {
  const ms_scene *scene = model->scene;
  ms_self_contact *c = *contact = ms_memory_allocate(&scene->alloc, 1, sizeof *c);
  if (!c) return ms_error_set_memory(err, "the surface");
  c->friction = scene->self_contact.friction;
  c->is_linear = !method->nonlinear;
  c->is_bounded = method->entry.implicit && method->entry.order > 1;
  msim_status status =
      ms_surface_pairs_create(model, scene->self_contact.thickness, &c->pairs, err);
  if (!status && method->entry.implicit)
    status = ms_contact_projection_create(model, &c->pairs.surface, &c->projection, err);
  if (!status) status = ms_contact_bodies_create(model, &c->bodies, err);
  if (status) return status;
  const size_t n = (size_t)c->pairs.surface.nnodes;
  if (MS_NEW(&scene->alloc, c->x0, 3 * n) && MS_NEW(&scene->alloc, c->x1, 3 * n) &&
      MS_NEW(&scene->alloc, c->v, 3 * n) && MS_NEW(&scene->alloc, c->stopped, n) &&
      MS_NEW(&scene->alloc, c->parts, ms_totals_count_parts(model)) &&
      MS_NEW_VECTORS(scene, &model->unknowns, &c->best[0], &c->best[1]))
    return MSIM_OK;
  return ms_error_set_memory(err, "the surface");
}

void ms_self_contact_destroy(const ms_model *model, ms_self_contact *contact) {
  const ms_scene *scene = model->scene;
  if (!contact) return;
  ms_surface_pairs_destroy(scene, &contact->pairs);
  ms_contact_projection_destroy(model, &contact->projection);
  ms_contact_bodies_destroy(model, &contact->bodies);
  MS_FREE(&scene->alloc, contact->x0, contact->x1, contact->v, contact->stopped, contact->parts,
          contact->best[0], contact->best[1], contact);
}

/*------------------------------------- nodes ----------------------------------------------------*/

msim_status ms_self_contact_check(ms_self_contact *c, int32_t nparticles, const double *x,
                                  msim_error *err) {
  const ms_contact_surface *s = &c->pairs.surface;
  for (int32_t p = 0; p < nparticles; p++)
    if (s->node[p]) memcpy(c->x0 + 3 * (size_t)(s->node[p] - 1), x + 3 * (size_t)p, 3 * sizeof *x);
  return ms_surface_pairs_check(&c->pairs, c->x0, err);
}

static void gather(const ms_contact_surface *surface, const ms_unknowns *rows, const double *vec,
                   double *x) {
  for (int32_t k = 0; k < surface->nnodes; k++)
    if (surface->row[k] >= 0) ms_unknowns_get(rows, vec, surface->row[k], x + 3 * (size_t)k);
}

static void scatter(const ms_contact_surface *surface, const ms_unknowns *rows, const double *x,
                    double *vec) {
  for (int32_t k = 0; k < surface->nnodes; k++)
    if (surface->row[k] >= 0) ms_unknowns_set(rows, x + 3 * (size_t)k, surface->row[k], vec);
}

static void set_pinned(const ms_contact_surface *s, const ms_scene *scene, ms_instant at,
                       double *x) {
  for (int32_t k = 0; k < s->nnodes; k++)
    if (s->row[k] < 0) memcpy(x + 3 * (size_t)k, s->x_rest + 3 * (size_t)k, 3 * sizeof *x);
  for (int32_t m = 0; m < scene->nmotions; m++)
    for (int32_t i = 0; i < scene->motions[m].n; i++) {
      const int32_t k = s->node[scene->motions[m].particles[i]] - 1;
      double unused[3];
      if (k >= 0) ms_motion_evaluate(&scene->motions[m], i, at, x + 3 * (size_t)k, unused);
    }
}

static void gather_end(ms_self_contact *c, const ms_stepper *s) {
  gather(&c->pairs.surface, &s->model->unknowns, s->x_next, c->x1);
  gather(&c->pairs.surface, &s->model->unknowns, s->v_next, c->v);
}

static void scatter_end(const ms_self_contact *c, ms_stepper *s) {
  scatter(&c->pairs.surface, &s->model->unknowns, c->x1, s->x_next);
  scatter(&c->pairs.surface, &s->model->unknowns, c->v, s->v_next);
}

static void gather_step(ms_self_contact *c, const ms_stepper *s) {
  const ms_instant start = {.t = s->t}, end = {.t = s->t + s->h, .before = 1};
  gather(&c->pairs.surface, &s->model->unknowns, s->x, c->x0);
  gather_end(c, s);
  set_pinned(&c->pairs.surface, s->model->scene, start, c->x0);
  set_pinned(&c->pairs.surface, s->model->scene, end, c->x1);
  for (int32_t k = 0; k < c->pairs.surface.nnodes; k++)
    for (size_t i = 3 * (size_t)k; i < 3 * (size_t)k + 3 && c->pairs.surface.row[k] < 0; i++)
      c->v[i] = (c->x1[i] - c->x0[i]) / s->h;
}

/*------------------------------------- planes of contact ----------------------------------------*/

static void set_plane(ms_surface_pair *p, const ms_proximity *at) {
  p->is_active = 1;
  memcpy(p->normal, at->normal, sizeof p->normal);
  memcpy(p->weight, at->weight, sizeof p->weight);
}

/* 1: both closest points lie inside their features, and not on corners or edges that other pairs
 * have, too, whose normals differ little: surfaces side by side push each other apart and not along
 * each other. */
static int are_inside(const ms_proximity *at) {
  return at->weight[0] != 0 && at->weight[1] != 0 && at->weight[2] != 0 && at->weight[3] != 0;
}

/* Prepare the pairs for a step: those that are close at x0 get a plane. A pair that is closer than
 * the thickness is moved apart by a part of what is missing, at most longest_return. */
static void start_pairs(ms_self_contact *c, double longest_return) {
  const double LEAST = 0.1; /* of the thickness, or of half the distance at x0 */
  const double RETURN = 0.1;
  for (ms_surface_pair *p = c->pairs.pair; p < c->pairs.pair + c->pairs.n; p++) {
    double x[4][3];
    ms_feature_pair_get(p->node, c->x0, x);
    const ms_proximity at = ms_proximity_find(p->kind, x);
    p->is_active = p->is_pushed = 0;
    p->least = LEAST * fmin(p->thickness, 0.5 * at.distance);
    p->stop = ms_proximity_stop(at.distance, p->least);
    const double missing = fmax(0, p->thickness - at.distance);
    p->target = fmin(p->thickness, at.distance + fmin(RETURN * missing, longest_return));
    p->unit = p->target;
    memcpy(p->apart, at.normal, sizeof p->apart);
    if (at.distance <= p->thickness && are_inside(&at)) set_plane(p, &at);
  }
}

/* At x0 the plane normal to p->apart separates both by their distance. */
static int collides(const ms_self_contact *c, const ms_surface_pair *p, ms_proximity *at) {
  double x0[4][3], x1[4][3];
  ms_feature_pair_get(p->node, c->x1, x1);
  if (ms_proximity_find_gap(p->kind, x1, p->apart) > p->stop) return 0;
  ms_feature_pair_get(p->node, c->x0, x0);
  return ms_proximity_collides(p->kind, x0, x1, p->least, at);
}

/* Pairs that collide get a plane where they do; returns their number. keeps_planes: those that have
 * one keep it. */
static int64_t find_collisions(ms_self_contact *c, int keeps_planes) {
  int64_t n = 0;
  for (ms_surface_pair *p = c->pairs.pair; p < c->pairs.pair + c->pairs.n; p++) {
    ms_proximity at;
    if (!collides(c, p, &at)) continue;
    if (!(keeps_planes && p->is_active)) set_plane(p, &at);
    n++;
  }
  return n;
}

/*------------------------------------- particles that stay --------------------------------------*/

/* Returns 1 if it moved. */
static int stop_node(ms_self_contact *c, int32_t k, int32_t pass) {
  const size_t at = 3 * (size_t)k, bytes = 3 * sizeof *c->x0;
  if (c->stopped[k] || c->pairs.surface.row[k] < 0) return 0;
  c->stopped[k] = pass;
  ms_contact_bodies_join(&c->bodies, c->pairs.surface.row[k], -1);
  memcpy(c->x1 + at, c->x0 + at, bytes);
  memset(c->v + at, 0, bytes);
  return 1;
}

/* 1: a node of the pair was stopped in that pass. */
static int was_stopped(const ms_self_contact *c, const ms_surface_pair *p, int32_t pass) {
  for (int k = 0; k < 4; k++)
    if (c->stopped[p->node[k]] == pass) return 1;
  return 0;
}

/* Stop the nodes of a pair that collides. Returns the number of those that moved. */
static int32_t stop_pair(ms_self_contact *c, const ms_surface_pair *p, int32_t pass) {
  int32_t n = 0;
  for (int k = 0; k < 4; k++) n += stop_node(c, p->node[k], pass);
  return n;
}

/* Stop the nodes of pairs in the list that collide, until none does; returns their number. *stuck:
 * a pair that collides though none of its nodes is free to move; NULL: none */
static int64_t stop_colliding(ms_self_contact *c, int32_t *pass, const ms_surface_pair **stuck) {
  int64_t all = 0, stopped = 1;
  *stuck = NULL;
  for (int is_first = 1; stopped && !*stuck; is_first = 0) {
    stopped = 0;
    ++*pass;
    for (const ms_surface_pair *p = c->pairs.pair; p < c->pairs.pair + c->pairs.n; p++) {
      ms_proximity unused;
      const int may_have_changed =
          is_first || was_stopped(c, p, *pass - 1) || was_stopped(c, p, *pass);
      if (!may_have_changed || !collides(c, p, &unused)) continue;
      const int32_t n = stop_pair(c, p, *pass);
      if (n == 0) *stuck = p;
      stopped += n;
    }
    all += stopped;
  }
  return all;
}

static msim_status report_stuck(const ms_self_contact *c, ms_stepper *s, const ms_surface_pair *p,
                                msim_error *err) {
  const ms_contact_surface *surface = &c->pairs.surface;
  int32_t pinned = 0;
  for (int k = 0; k < 4; k++) {
    const int32_t row = surface->row[p->node[k]];
    if (row >= 0) s->offender = row;
    else pinned = p->node[k];
  }
  int32_t particle = 0;
  while (surface->node[particle] != pinned + 1) particle++;
  return ms_error_set(
      err, MSIM_NOT_CONVERGED,
      "pinned particles that move, near particle %d, force a surface through another "
      "one or through itself; change their motion, or use a smaller h",
      particle);
}

/* A node that stays where others go on may collide with features that were not near its path. */
static msim_status stop_all_colliding(ms_self_contact *c, ms_stepper *s, msim_error *err) {
  const msim_allocator *alloc = &s->model->scene->alloc;
  int32_t pass = 0;
  int64_t stopped = 1;
  memset(c->stopped, 0, (size_t)c->pairs.surface.nnodes * sizeof *c->stopped);
  while (stopped) {
    const ms_surface_pair *stuck;
    int is_new;
    const msim_status status =
        ms_surface_pairs_update(alloc, &c->pairs, c->x0, c->x1, &is_new, err);
    if (status) return status;
    if (is_new) start_pairs(c, 0);
    else if (pass > 0) break;
    stopped = stop_colliding(c, &pass, &stuck);
    if (stuck) return report_stuck(c, s, stuck, err);
  }
  return MSIM_OK;
}

/*------------------------------------- the step -------------------------------------------------*/

/* The body of a node touches an obstacle: that holds it, unless its plane is known. */
static void touch_obstacle(ms_self_contact *c, int32_t k) {
  const int32_t row = c->pairs.surface.row[k];
  ms_contact_bodies_join(&c->bodies, row, c->projection.d ? row : -1);
}

/* Moves particles out of obstacles, which hold the bodies of nodes and, in the projection, the
 * nodes from now on. Returns the largest displacement of a node. */
static double reflect(ms_self_contact *c, ms_stepper *s) {
  const ms_contact_surface *surface = &c->pairs.surface;
  double longest = 0;
  gather_end(c, s);
  ms_stepper_reflect_remaining(s, NULL);
  for (int32_t k = 0; k < surface->nnodes; k++) {
    double x[3], displacement[3];
    if (surface->row[k] < 0) continue;
    ms_unknowns_get(&s->model->unknowns, s->x_next, surface->row[k], x);
    memcpy(displacement, x, sizeof displacement);
    ms_vec3_axpy(-1, c->x1 + 3 * (size_t)k, displacement);
    const double size = ms_vec3_norm(displacement);
    if (!(size > 0)) continue;
    longest = fmax(longest, size);
    touch_obstacle(c, k);
    if (c->projection.d)
      ms_contact_projection_hold(&c->projection, k, displacement, x, c->pairs.thickness);
  }
  gather_end(c, s);
  return longest;
}

static int64_t sweep_positions(ms_self_contact *c) {
  int64_t pushed = 0, n = 1;
  for (int sweep = 0; sweep < SWEEPS && n; sweep++)
    pushed += n = ms_pair_impulses_push_positions(&c->pairs, c->friction, c->x0, c->x1);
  return pushed;
}

/* Push pairs apart, and out of obstacles. Returns the number of pairs that collide in the end. */
static int64_t sweep(ms_self_contact *c, ms_stepper *s) {
  int64_t collisions = 0;
  for (int round = 0; round < ROUNDS; round++) {
    collisions = find_collisions(c, round == 0);
    if (sweep_positions(c) == 0) break;
    scatter_end(c, s);
    reflect(c, s);
  }
  return collisions;
}

/* x_next = x* + d, v_next = v* + d/h, out of obstacles */
static double end_projection(ms_self_contact *c, ms_stepper *s) {
  const ms_shape shape = s->model->shape;
  ms_vector_add_scaled(shape, c->best[0], 1, c->projection.d, s->x_next);
  ms_vector_add_scaled(shape, c->best[1], 1 / s->h, c->projection.d, s->v_next);
  return reflect(c, s);
}

/* The same for implicit methods by contact_projection.h, from x*, v* in c->best. A round shows
 * which obstacles hold nodes in the next one. */
static int64_t project(ms_self_contact *c, ms_stepper *s) {
  const ms_shape shape = s->model->shape;
  const ms_projected_step step = {s,           c->is_linear, &c->pairs, &c->bodies,
                                  c->friction, c->x0,        c->x1};
  const double work = s->work_in_step, LITTLE = 0.05; /* of the thickness */
  int64_t collisions = 0;
  double reflected = 0;
  for (int round = 0; round < ROUNDS; round++) {
    collisions = find_collisions(c, round == 0);
    if (round > 0 && collisions == 0 && reflected <= LITTLE * c->pairs.thickness) break;
    ms_vector_add_scaled(shape, c->best[0], 1, c->projection.d, s->x_next);
    gather_end(c, s);
    ms_vector_copy(shape, c->best[0], s->x_next);
    s->work_in_step = work;
    ms_contact_projection_improve(&c->projection, &step);
    reflected = end_projection(c, s);
  }
  s->work_in_step += ms_contact_projection_find_work(&step);
  return collisions;
}

/* Returns the number of pairs that were pushed, or else of those that collide, as all of their
 * nodes are pinned. */
static int64_t push_apart(ms_self_contact *c, ms_stepper *s) {
  const int64_t collisions = c->projection.d ? project(c, s) : sweep(c, s);
  for (int sweep = 0; sweep < SWEEPS; sweep++)
    if (ms_pair_impulses_push_velocities(&c->pairs, c->friction, c->v, &s->work_in_step) == 0)
      break;
  const int64_t pushed = ms_pair_impulses_count(&c->pairs);
  return pushed > 0 ? pushed : collisions;
}

/*------------------------------------- energy ---------------------------------------------------*/

/* The work of moving pins on springs in the step as it is now, by the trapezoidal rule */
static double find_pin_work(ms_stepper *s) {
  const double before = s->work_in_step;
  if (s->model->scene->nmotions == 0) return 0;
  s->work_in_step = 0;
  ms_stepper_add_trapezoidal_work(s, s->v);
  const double work = s->work_in_step;
  s->work_in_step = before;
  return work;
}

/* Less work; of that, work_in_step has what pins did in the step without contact. */
static double find_end_energy(const ms_self_contact *c, ms_stepper *s, double *motion) {
  return ms_step_energy_sum(s->model, s->x_next, s->v_next, c->parts, motion) - s->work_in_step -
         (find_pin_work(s) - c->pin_work);
}

/* The energy, less work, that the step may lead to: that at its start or without contact, with what
 * the method may add by errors of rounding and linearization. Implicit methods of order 2, which do
 * not damp vibrations of stiff springs, would let contact excite more and more of these. In
 * explicit methods contact turns m (g h)^2/2, the energy of the velocity that gravity adds, into
 * height: that is exact only in sum. */
static double find_most_energy(ms_self_contact *c, ms_stepper *s) {
  const double SMALL = 1e-5; /* of kinetic and elastic energy */
  const ms_model *model = s->model;
  const double added = s->solver ? 0 : s->h * ms_external_acceleration(&model->external);
  double motion[2], mass = 0;
  if (model->pins)
    ms_moving_pins_set(model, (ms_instant){.t = s->t + s->h, .before = 1}, s->x_next, NULL);
  for (int32_t r = 0; r < model->unknowns.nfree; r++) mass += model->mass[r];
  double most = ms_step_energy_sum(model, s->x, s->v, c->parts, &motion[0]);
  c->pin_work = find_pin_work(s);
  const double end = find_end_energy(c, s, &motion[1]);
  if (!c->is_bounded) most = fmax(most, end);
  return most + SMALL * fmax(motion[0], motion[1]) + 0.5 * mass * added * added;
}

/* Join the bodies of pairs that were pushed. */
static void join_bodies(ms_self_contact *c) {
  ms_contact_bodies_separate(&c->bodies);
  for (int32_t k = 0; k < c->pairs.surface.nnodes && c->projection.d; k++)
    if (c->projection.held[k].is_active) touch_obstacle(c, k);
  for (const ms_surface_pair *p = c->pairs.pair; p < c->pairs.pair + c->pairs.n; p++)
    for (int k = 1; k < 4 && p->is_pushed; k++)
      ms_contact_bodies_join(&c->bodies, c->pairs.surface.row[p->node[0]],
                             c->pairs.surface.row[p->node[k]]);
}

/* Bodies that touch tend to a translation that keeps their momentum, along obstacles, or, if
 * something holds them, to no motion. */
static void halve_step(ms_self_contact *c, ms_stepper *s) {
  const ms_shape shape = s->model->shape;
  const ms_surface_pair *held = c->projection.d ? c->projection.held : NULL;
  ms_contact_bodies_halve(&c->bodies, s->model, &c->pairs.surface, held, s->v_next);
  ms_vector_axpy(shape, -1, s->x, s->x_next);
  ms_contact_bodies_halve(&c->bodies, s->model, &c->pairs.surface, held, s->x_next);
  ms_vector_axpy(shape, 1, s->x, s->x_next);
}

static void copy_step(ms_shape shape, const double *x, const double *v, double *x_to,
                      double *v_to) {
  ms_vector_copy(shape, x, x_to);
  ms_vector_copy(shape, v, v_to);
}

/* Stop what collides, and shorten the step until its energy is at most `most`; else the one with
 * the least energy is made. */
static msim_status finish_step(ms_self_contact *c, ms_stepper *s, double most, msim_error *err) {
  enum { MOST = 24 };
  const ms_shape shape = s->model->shape;
  double best = INFINITY, work = 0, unused;
  join_bodies(c);
  for (int n = 0; n <= MOST; n++) {
    if (n > 0) halve_step(c, s), reflect(c, s);
    const msim_status status = stop_all_colliding(c, s, err);
    if (status) return status;
    scatter_end(c, s);
    const double now = find_end_energy(c, s, &unused);
    if (now <= most) return MSIM_OK;
    if (!(now < best)) continue;
    best = now, work = s->work_in_step;
    copy_step(shape, s->x_next, s->v_next, c->best[0], c->best[1]);
  }
  copy_step(shape, c->best[0], c->best[1], s->x_next, s->v_next);
  s->work_in_step = work;
  return MSIM_OK;
}

/* Push pairs apart, and those that are closer than the thickness back to it: by less than gravity
 * moves them in the step. If that needs more energy than there is, they keep their distance. */
static int64_t push_apart_within(ms_self_contact *c, ms_stepper *s, double most) {
  const ms_shape shape = s->model->shape;
  const double work = s->work_in_step;
  double unused;
  if (c->projection.d) ms_contact_projection_start(&c->projection, s->model, &c->pairs);
  start_pairs(c, 0.25 * s->h * s->h * ms_external_acceleration(&s->model->external));
  copy_step(shape, s->x_next, s->v_next, c->best[0], c->best[1]);
  const int64_t pushed = push_apart(c, s);
  scatter_end(c, s);
  if (pushed == 0 || find_end_energy(c, s, &unused) <= most) return pushed;
  copy_step(shape, c->best[0], c->best[1], s->x_next, s->v_next);
  s->work_in_step = work;
  gather_end(c, s);
  start_pairs(c, 0);
  const int64_t again = push_apart(c, s);
  scatter_end(c, s);
  return again > 0 ? again : pushed;
}

static msim_status correct_end(ms_self_contact *c, ms_stepper *s, msim_error *err) {
  int is_new;
  gather_step(c, s);
  msim_status status =
      ms_surface_pairs_update(&s->model->scene->alloc, &c->pairs, c->x0, c->x1, &is_new, err);
  if (status || c->pairs.n == 0) return status;
  const double most = find_most_energy(c, s);
  const int64_t pushed = push_apart_within(c, s, most);
  if (pushed == 0) return MSIM_OK;
  s->stats->contacts += pushed;
  s->cached_stage_next = 0;
  status = finish_step(c, s, most, err);
  s->work_in_step += find_pin_work(s) - c->pin_work;
  return status;
}

msim_status ms_self_contact_correct(ms_self_contact *contact, ms_stepper *s, msim_error *err) {
  const double start = ms_clock_now();
  const msim_status status = correct_end(contact, s, err);
  s->stats->collide_s += ms_clock_now() - start;
  return status;
}
