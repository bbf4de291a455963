#include "contact/contact_set.h"

#include <float.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/contact_impulses.h"
#include "contact/moving_obstacles.h"
#include "contact/path_bounces.h"
#include "physics/rank_model.h"

/*------------------------------------- creation -------------------------------------------------*/

/* The reach (impacts.h) of the scene, not of the state at creation: so which particles touch planes
 * depends on the present state alone. */
static double find_reach(const ms_model *model) {
  const ms_scene *scene = model->scene;
  const int32_t *particle = model->unknowns.particle;
  double reach = 0;
  for (int32_t r = 0; r < model->unknowns.stride; r++)
    if (particle[r] >= 0) reach = fmax(reach, ms_vec3_norm(scene->x + 3 * (size_t)particle[r]));
  for (int32_t p = 0; p < scene->nplanes; p++) reach = fmax(reach, fabs(scene->planes[p].offset));
  for (int32_t i = 0; i < scene->ncolliders; i++) reach = fmax(reach, scene->solids[i].reach);
  return reach;
}

msim_status ms_contact_set_create(const ms_model *model, ms_contact_set **events, msim_error *err) {
  const ms_scene *scene = model->scene;
  ms_contact_set *e = *events = ms_memory_allocate(&scene->alloc, 1, sizeof *e);
  if (!e) return ms_error_set_memory(err, "the contact set");
  e->reach = find_reach(model);
  const int32_t n = model->unknowns.nfree;
  const size_t tangents = scene->ncolliders ? (size_t)MS_MAX_TANGENTS * (size_t)n : 0;
  const int fits =
      ms_obstacles_create(scene, &e->near) &&
      MS_NEW_VECTORS(scene, &model->unknowns, &e->x, &e->v, &e->a, &e->a_end, &e->stage[0],
                     &e->stage[1], &e->begin[0], &e->begin[1]) &&
      MS_NEW(&scene->alloc, e->contact, n) && MS_NEW(&scene->alloc, e->constraint, n) &&
      MS_NEW(&scene->alloc, e->followed, n) && MS_NEW(&scene->alloc, e->tangent, tangents) &&
      MS_NEW(&scene->alloc, e->solid, tangents) &&
      MS_NEW(&scene->alloc, e->parts, ms_totals_count_parts(model));
  return fits ? MSIM_OK : ms_error_set_memory(err, "the contact set");
}

void ms_contact_set_connect(const ms_model *model, ms_contact_set *e) {
  ms_ranks_maximum(ms_rank_model_ranks(model), 1, &e->reach);
}

ms_collision_planes ms_contact_set_planes(const ms_stepper *s) {
  const ms_scene *scene = s->model->scene;
  const ms_contact_set *e = s->events;
  const ms_obstacles *o = &e->near;
  if (!o->plane)
    return (ms_collision_planes){.n = scene->nplanes,
                                 .plane = scene->planes,
                                 .scene_size = e->reach,
                                 .contact_distance = e->merge};
  return (ms_collision_planes){.n = o->nplanes + o->nsolids,
                               .plane = o->plane,
                               .scene_size = e->reach,
                               .contact_distance = e->merge,
                               .nsolids = o->nsolids,
                               .solid = o->solid,
                               .tangent = o->plane + o->nplanes,
                               .moving = o->moves ? &s->events->near : NULL,
                               .scene = scene};
}

ms_particle_path ms_contact_set_make_path(const ms_stepper *s, int32_t row, const double *b0,
                                          const double *b1) {
  const ms_unknowns *rows = &s->model->unknowns;
  ms_particle_path p = {.planes = ms_contact_set_planes(s),
                        .t = s->t,
                        .h = s->h,
                        .bounce_reach = s->events->bounce_reach,
                        .x_error = s->events->path_tolerance};
  ms_unknowns_get(rows, s->x, row, p.x);
  ms_unknowns_get(rows, s->v, row, p.v);
  ms_unknowns_get(rows, b0, row, p.b0);
  ms_unknowns_get(rows, b1, row, p.b1);
  memcpy(p.a, p.b0, sizeof p.a);
  memcpy(p.w, p.v, sizeof p.w);
  return p;
}

void ms_contact_set_destroy(const ms_model *model, ms_contact_set *e) {
  if (!e) return;
  ms_obstacles_destroy(model->scene, &e->near);
  MS_FREE(&model->scene->alloc, e->x, e->v, e->a, e->a_end, e->stage[0], e->stage[1], e->begin[0],
          e->begin[1], e->contact, e->constraint, e->followed, e->tangent, e->solid, e->parts, e);
}

void ms_contact_set_forget(ms_contact_set *e) {
  if (!e) return;
  e->ncontacts = e->nfollowed = e->others_have_contacts = 0;
  e->moved = e->a_is_known = 0;
  e->contact_hash = e->contact_hash_next = 0;
}

void ms_contact_set_save_start(ms_contact_set *e, ms_shape shape) {
  if (!e->moved) return;
  ms_vector_copy(shape, e->x, e->begin[0]);
  ms_vector_copy(shape, e->v, e->begin[1]);
}

void ms_contact_set_shift_acceleration(ms_contact_set *e) {
  ms_stepper_swap(&e->a, &e->a_end);
  e->a_is_known = 1;
}

void ms_contact_set_record(ms_stepper *s) {
  /* not under error control (one_substep): results must not depend on rejected steps */
  if (!s->events->ncontacts || s->one_substep) return;
  s->events->contact_hash_next = ms_contact_set_hash(s);
  s->cached_stage_next |= MS_CONTACTS_CACHED;
}

void ms_contact_set_accept_step(ms_stepper *s) {
  ms_contact_set *e = s->events;
  s->cached_stage = s->cached_stage_next;
  if (!e || !(s->cached_stage & MS_CONTACTS_CACHED)) return;
  ms_contact_set_shift_acceleration(e);
  e->contact_hash = e->contact_hash_next;
}

void ms_contact_set_make_writable(ms_stepper *s) {
  ms_contact_set *e = s->events;
  e->a_is_known = 0;
  if (s->x == e->x) return;
  ms_vector_copy_all(s->model->shape, s->x, e->x);
  ms_vector_copy_all(s->model->shape, s->v, e->v);
  s->x = e->x, s->v = e->v;
}

/*------------------------------------- the contact set ------------------------------------------*/

/* Lets a particle that moves into planes bounce, and puts one that lies outside on them. */
static void bounce_off_planes(ms_stepper *s, const ms_collision_planes *planes, ms_contact *c) {
  const ms_unknowns *rows = &s->model->unknowns;
  double x[3], v[3];
  ms_unknowns_get(rows, s->x, c->row, x);
  ms_unknowns_get(rows, s->v, c->row, v);
  int outside = 0;
  const double tolerance = ms_impacts_distance_tolerance(planes, x);
  for (int i = 0; i < c->on.n; i++) outside |= ms_impacts_distance(c->on.plane[i], x) < -tolerance;
  double u[3] = {0}, before[3] = {v[0], v[1], v[2]};
  if (planes->moving) ms_moving_obstacles_find_velocity(planes, &c->on, x, u);
  ms_vec3_axpy(-1, u, v);
  const int bounced = ms_impacts_bounce(&c->on, v);
  ms_vec3_axpy(1, u, v);
  s->stats->contacts += bounced;
  for (int k = 0; k < 3 && bounced; k++)
    s->work_in_step += s->model->mass[c->row] * (v[k] - before[k]) * u[k];
  if (!bounced && !outside) return;
  ms_contact_set_make_writable(s);
  if (bounced) ms_contact_impulses_add(s, c->row, &c->on, x, before, v);
  ms_obstacles_move_onto(planes, &c->on, x);
  ms_unknowns_set(rows, x, c->row, s->x);
  ms_unknowns_set(rows, v, c->row, s->v);
}

/* The planes that a particle presses on, of those that it touches and does not separate from */
static ms_plane_set find_holding(const ms_stepper *s, const ms_plane_set *on, const double x[3],
                                 const double v[3], const double a[3]) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const double size = ms_vec3_norm(a),
               slow =
                   ms_path_bounces_find_rest_speed(&planes, on, x, size, s->events->bounce_reach),
               tolerance = fmax(slow, 1e-14 * (ms_vec3_norm(v) + s->h * size));
  double left[3] = {a[0], a[1], a[2]}, least[MS_MAX_TOUCHED_PLANES], unused;
  double u[3] = {0}, relative[3] = {v[0], v[1], v[2]};
  if (planes.moving) ms_moving_obstacles_find_velocity(&planes, on, x, u);
  ms_vec3_axpy(-1, u, relative);
  const ms_plane_set stays = ms_impacts_select_approached(on, relative, tolerance);
  if (!planes.nsolids)
    return ms_impacts_remove_pressing(&stays, MS_REACTION_TOLERANCE * size, left, &unused);
  ms_obstacles_find_centripetal(&planes, &stays, x, v, least);
  return ms_impacts_raise_pressing(&stays, least, MS_REACTION_TOLERANCE * size, left, &unused);
}

int32_t ms_contact_set_find_solid(const ms_stepper *s, const msim_plane *plane) {
  const ms_contact_set *e = s->events;
  const ms_obstacles *o = &e->near;
  const int is_shared = !o->plane || (plane >= o->plane && plane < o->plane + o->nplanes);
  return is_shared ? -1 : e->solid[plane - e->tangent];
}

void ms_contact_set_add_tangent(ms_stepper *s, ms_contact *c, int32_t solid, const double x[3]) {
  ms_contact_set *e = s->events;
  size_t slot = (size_t)MS_MAX_TANGENTS * (size_t)c->row;
  while (ms_impacts_contains_plane(&c->on, &e->tangent[slot])) slot++;
  e->tangent[slot] = e->near.plane[e->near.nplanes + solid];
  e->solid[slot] = solid;
  ms_obstacles_set_tangent(&e->near.solid[solid], x, &e->tangent[slot]);
  c->on.plane[c->on.n++] = &e->tangent[slot];
  c->has_solid = 1;
}

/* Replaces tangent planes near the particle at hand by those of the contact. */
static void own_tangents(ms_stepper *s, ms_contact *c, const double x[3]) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const ms_plane_set on = c->on;
  c->on.n = 0;
  for (int i = 0; i < on.n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(&planes, on.plane[i]);
    if (solid) ms_contact_set_add_tangent(s, c, (int32_t)(solid - planes.solid), x);
    else c->on.plane[c->on.n++] = on.plane[i];
  }
}

static void scale_to_one(double u[3]) {
  const double size = ms_vec3_norm(u);
  for (int c = 0; c < 3; c++) u[c] = size > 0 ? u[c] / size : 0;
}

/* Friction force over mass for pull = sum of mu N/m. v NULL: in the direction at the start, or 0 if
 * the matrix contains it (is_prescribed). It keeps its direction if it turns too fast for stages of
 * an explicit method, and is constant if it might stop v in the step of an implicit one. */
static void friction_of(const ms_stepper *s, const ms_contact *c, const double *v, double pull,
                        double f[3]) {
  const int implicit = s->events->implicit, turns = c->stop < (implicit ? 2 : 1) * s->h;
  double direction[3] = {c->sliding_direction[0], c->sliding_direction[1], c->sliding_direction[2]},
         now[3] = {0};
  if (v) memcpy(now, v, sizeof now);
  ms_impacts_remove_normal(&c->on, now, NULL);
  memset(f, 0, 3 * sizeof *f);
  if (c->is_prescribed) {
    if (c->friction > 0) ms_vec3_axpy(-c->friction / c->friction_speed, now, f);
  } else if (implicit && turns) {
    memcpy(f, c->friction_force, sizeof c->friction_force);
  } else {
    /* a stage after the stop goes on in a straight line, by which the stop is found */
    if (!turns && ms_vec3_dot(now, c->sliding_direction) > 0)
      memcpy(direction, now, sizeof direction);
    scale_to_one(direction);
    ms_vec3_axpy(-pull, direction, f);
  }
}

double ms_contact_set_reaction(const ms_contact *c, const double a[3]) {
  double along[3] = {a[0], a[1], a[2]}, least;
  ms_impacts_remove_normal(&c->on, along, &least);
  return least;
}

/* Whether the particle sticks, and the sliding direction. Without friction it sticks only if no
 * force acts along the planes. */
static void find_slide(ms_contact *c, const double v[3], const double a[3]) {
  double along[3] = {a[0], a[1], a[2]};
  const double pull = ms_impacts_remove_normal(&c->on, along, NULL), size = ms_vec3_norm(a);
  const double most = pull > 0 ? pull - MS_REACTION_TOLERANCE * size : 16 * DBL_EPSILON * size;
  const int still = ms_vec3_norm(v) == 0;
  c->sticks = c->fixed || (still && ms_vec3_norm(along) <= most);
  if (!c->sticks) memcpy(c->sliding_direction, still ? along : v, sizeof c->sliding_direction);
  scale_to_one(c->sliding_direction);
  const double friction = c->sticks ? 0 : pull;
  for (int i = 0; i < 3; i++) c->friction_force[i] = -friction * c->sliding_direction[i];
  c->stop = friction > 0 ? ms_vec3_norm(v) / friction : INFINITY;
}

void ms_contact_set_classify(ms_contact *c, int32_t dims) {
  c->fixed = c->on.n >= dims;
  c->has_friction = 0;
  for (int i = 0; i < c->on.n; i++) c->has_friction |= c->on.plane[i]->friction > 0;
}

/* Reduces c->on to the planes that act, and v to motion along them; 0: the particle is free. */
static int settle_contact(ms_stepper *s, ms_contact *c) {
  const ms_unknowns *rows = &s->model->unknowns;
  double x[3], v[3], before[3], a[3];
  ms_unknowns_get(rows, s->x, c->row, x);
  ms_unknowns_get(rows, s->v, c->row, v);
  ms_unknowns_get(rows, s->events->a, c->row, a);
  const ms_plane_set touched = c->on;
  c->on = find_holding(s, &touched, x, v, a);
  const ms_collision_planes planes = ms_contact_set_planes(s);
  ms_moving_obstacles_set_frame(&planes, &c->on, x, v, s->h, &c->frame);
  const double left = s->events->bounce_time;
  if (!c->on.n && left > 0 && touched.n == 1 && !planes.moving &&
      ms_path_bounces_are_summed(touched.plane[0], v, a, left, s->events->bounce_reach)) {
    c->on = touched;
    c->bounces = 1;
    c->rebound = ms_vec3_dot(touched.plane[0]->normal, v);
  }
  if (!c->on.n) return 0;
  if (s->events->near.nsolids) own_tangents(s, c, x);
  ms_contact_set_classify(c, rows->dims);
  const double tolerance = ms_impacts_speed_tolerance(v);
  memcpy(before, v, sizeof v);
  ms_vec3_axpy(-1, c->frame.velocity, v);
  ms_vec3_axpy(-1, c->frame.acceleration, a);
  ms_impacts_remove_normal(&c->on, v, NULL);
  if (c->fixed || ms_vec3_norm(v) <= tolerance) memset(v, 0, sizeof v);
  const double now[3] = {v[0] + c->frame.velocity[0], v[1] + c->frame.velocity[1],
                         v[2] + c->frame.velocity[2]};
  ms_vec3_axpy(-1, now, before);
  if (ms_vec3_norm(before) > tolerance || (ms_vec3_norm(v) == 0 && ms_vec3_norm(before) > 0)) {
    ms_contact_set_make_writable(s);
    ms_unknowns_set(rows, now, c->row, s->v);
    ms_contact_impulses_add(s, c->row, &c->on, x, before, (double[3]){0});
  }
  find_slide(c, v, a);
  return 1;
}

void ms_contact_set_free_acceleration(ms_stepper *s, double c, const double *x, const double *v,
                                      double *a) {
  s->c = c;
  ms_stepper_evaluate_model(s, s->model, &(ms_fused_step){.x = x, .v = v, .a = a});
}

int ms_contact_set_require_acceleration(ms_stepper *s, int is_needed) {
  ms_contact_set *e = s->events;
  double any[2] = {is_needed, !e->a_is_known};
  ms_ranks_maximum(ms_rank_model_ranks(s->model), 2, any);
  if (!(any[0] > 0)) return 0;
  if (any[1] > 0) ms_contact_set_free_acceleration(s, 0, s->x, s->v, e->a);
  e->a_is_known = 1;
  return 1;
}

void ms_contact_set_share(ms_stepper *s) {
  const int32_t own = s->events->ncontacts;
  s->events->others_have_contacts = ms_rank_model_count(s->model, own) > own;
}

/* Returns the number of unknowns that touch planes. */
static int32_t bounce_touching(ms_stepper *s, const ms_collision_planes *planes) {
  const ms_unknowns *rows = &s->model->unknowns;
  ms_contact_set *e = s->events;
  const int64_t before = s->stats->contacts;
  int32_t touching = 0;
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3];
    ms_unknowns_get(rows, s->x, r, x);
    ms_obstacles_touch(planes, x);
    const ms_plane_set on = ms_impacts_find_touched(planes, x);
    if (!on.n) continue;
    e->contact[touching] = (ms_contact){.row = r, .on = on};
    bounce_off_planes(s, planes, &e->contact[touching++]);
  }
  s->stats->contacts = before + ms_rank_model_count(s->model, s->stats->contacts - before);
  return touching;
}

void ms_contact_set_update(ms_stepper *s) {
  const ms_unknowns *rows = &s->model->unknowns;
  const ms_collision_planes planes = ms_contact_set_planes(s);
  ms_contact_set *e = s->events;
  e->ncontacts = e->others_have_contacts = 0;
  ms_moving_obstacles_place(&planes, (ms_instant){.t = s->t});
  const int32_t touching = bounce_touching(s, &planes);
  if (!ms_contact_set_require_acceleration(s, touching > 0)) return;
  int32_t resting = 0;
  for (int32_t i = 0; i < touching; i++) {
    ms_contact c = e->contact[i];
    double x[3];
    ms_unknowns_get(rows, s->x, c.row, x);
    ms_obstacles_touch(&planes, x);
    if (settle_contact(s, &c)) e->contact[resting++] = c;
  }
  e->ncontacts = resting;
  ms_contact_set_share(s);
}

void ms_contact_set_make_constraints(ms_stepper *s, double ah) {
  ms_contact_set *e = s->events;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    const int all = c->sticks || c->on.n > 2;
    ms_constraint *constraint = &e->constraint[i];
    *constraint = (ms_constraint){.row = c->row, .n = all ? 3 : c->on.n};
    for (int k = 0; k < constraint->n; k++)
      if (all) constraint->direction[k][k] = 1;
      else
        memcpy(constraint->direction[k], c->on.plane[k]->normal, sizeof constraint->direction[k]);
    if (c->is_prescribed && !c->sticks && c->friction > 0)
      constraint->friction = s->model->mass[c->row] * ah * c->friction / c->friction_speed;
  }
}

/*------------------------------------- reactions ------------------------------------------------*/

/* One step of the FNV-1a hash (Fowler, Noll and Vo), by words in place of bytes */
static uint64_t hash_number(uint64_t hash, uint64_t number) {
  return (hash ^ number) * 1099511628211u;
}

/* Tangent planes count by their solid and their normal. */
static uint64_t hash_plane(const ms_stepper *s, const msim_plane *plane, uint64_t hash) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const int32_t solid = ms_contact_set_find_solid(s, plane);
  uint64_t normal[3];
  if (solid < 0) return hash_number(hash, (uint64_t)(plane - planes.plane));
  memcpy(normal, plane->normal, sizeof normal);
  for (int c = 0; c < 3; c++) hash = hash_number(hash, normal[c]);
  return hash_number(hash, (uint64_t)(planes.n + solid));
}

uint64_t ms_contact_set_hash(const ms_stepper *s) {
  const ms_contact_set *e = s->events;
  uint64_t hash = e->ncontacts ? 14695981039346656037u : 0;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    hash = hash_number(hash_number(hash, (uint64_t)c->row), (uint64_t)c->sticks);
    for (int k = 0; k < c->on.n; k++) hash = hash_plane(s, c->on.plane[k], hash);
  }
  return hash;
}

static void add_to_unknown(const ms_unknowns *rows, double h, const double u[3], int32_t r,
                           double *vec) {
  double sum[3];
  ms_unknowns_get(rows, vec, r, sum);
  ms_vec3_axpy(h, u, sum);
  ms_unknowns_set(rows, sum, r, vec);
}

/* Reactions cancel all of a if the particle sticks, else its normal part, and friction is added. */
void ms_contact_set_add_reactions(const ms_stepper *s, const ms_fused_step *sweep) {
  const ms_unknowns *rows = &s->model->unknowns;
  const int follows = !sweep->along || sweep->along == sweep->v_to; /* x_to moves with v_to */
  for (int32_t i = 0; i < s->events->ncontacts; i++) {
    ms_contact *c = &s->events->contact[i];
    double a[3], along[3], v[3] = {0}, f[3] = {0}, *push = c->push;
    const int has_v =
        sweep->v || (c->frame.moves && c->is_prescribed); /* friction then acts at v = 0 */
    ms_unknowns_get(rows, sweep->a, c->row, a);
    if (sweep->v) ms_unknowns_get(rows, sweep->v, c->row, v);
    for (int k = 0; k < 3 && c->frame.moves; k++) {
      a[k] -= c->frame.acceleration[k];
      v[k] -= c->frame.velocity[k] + s->c * s->h * c->frame.acceleration[k];
    }
    memcpy(along, a, sizeof along);
    const double pull = ms_impacts_remove_normal(&c->on, along, NULL);
    if (c->has_friction && !c->sticks) friction_of(s, c, has_v ? v : NULL, pull, f);
    for (int k = 0; k < 3; k++) push[k] = c->sticks ? -a[k] : along[k] + f[k] - a[k];
    add_to_unknown(rows, 1, push, c->row, sweep->a);
    if (sweep->v_to) add_to_unknown(rows, sweep->h, push, c->row, sweep->v_to);
    if (sweep->x_to && follows)
      add_to_unknown(rows, sweep->drift * sweep->h, push, c->row, sweep->x_to);
  }
}

void ms_contact_set_place(ms_stepper *s) {
  const ms_unknowns *rows = &s->model->unknowns;
  const ms_contact_set *e = s->events;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    double x[3], v[3] = {0}, J[MS_MAX_INDEPENDENT_PLANES];
    ms_unknowns_get(rows, c->sticks ? s->x : s->x_next, c->row, x);
    if (!c->sticks) ms_unknowns_get(rows, s->v_next, c->row, v);
    if (c->sticks) ms_vec3_axpy(1, c->frame.displacement, x), ms_vec3_axpy(1, c->frame.end, v);
    const int has_distances = c->is_prescribed || !c->frame.moves; /* `end` and `leave` */
    if (has_distances && (!c->sticks || c->enters)) ms_impacts_move_to_distance(&c->on, c->end, x);
    if (has_distances) ms_impacts_set_normal_components(&c->on, c->leave, v, J);
    ms_unknowns_set(rows, x, c->row, s->x_next);
    ms_unknowns_set(rows, v, c->row, s->v_next);
  }
}

void ms_contact_set_find_acceleration(ms_stepper *s, double *a) {
  ms_contact_set *e = s->events;
  double *x = s->x, *v = s->v;
  e->a_is_known = 0;
  ms_contact_set_update(s);
  ms_contact_set_require_acceleration(s, 1);
  ms_vector_copy(s->model->shape, e->a, a);
  ms_contact_set_add_reactions(s, &(ms_fused_step){.a = a});
  s->x = x, s->v = v;
}
