#include "integrate/contacts.h"

#include <float.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/friction.h"

/*------------------------------------- creation -------------------------------------------------*/

/* The reach (impacts.h) of the scene, not of the state at creation: so which particles touch planes
 * depends on the present state alone. */
static double find_reach(const ms_model *model) {
  const ms_scene *scene = model->scene;
  double reach = 0;
  for (int32_t r = 0; r < model->rows.stride; r++)
    if (model->rows.particle[r] >= 0)
      reach = fmax(reach, ms_norm3(scene->x + 3 * (size_t)model->rows.particle[r]));
  for (int32_t p = 0; p < scene->nplanes; p++) reach = fmax(reach, fabs(scene->planes[p].offset));
  return reach;
}

msim_status ms_events_create(const ms_model *model, ms_events **events, msim_error *err) {
  const ms_scene *scene = model->scene;
  ms_events *e = *events = ms_new(&scene->alloc, 1, sizeof *e);
  if (!e) return ms_fail_memory(err, "the impacts");
  e->reach = find_reach(model);
  double **vectors[] = {&e->x,        &e->v,        &e->a,        &e->a_end,
                        &e->stage[0], &e->stage[1], &e->begin[0], &e->begin[1]};
  for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
    *vectors[i] = ms_rows_vector(scene, &model->rows);
    if (!*vectors[i]) return ms_fail_memory(err, "the impacts");
  }
  e->contact = ms_new(&scene->alloc, (size_t)model->rows.nfree, sizeof *e->contact);
  e->hold = ms_new(&scene->alloc, (size_t)model->rows.nfree, sizeof *e->hold);
  e->parts = ms_new(&scene->alloc, (size_t)ms_totals_parts(model), sizeof *e->parts);
  e->followed = ms_new(&scene->alloc, (size_t)model->rows.nfree, sizeof *e->followed);
  const int there = e->contact && e->hold && e->followed && e->parts;
  return there ? MSIM_OK : ms_fail_memory(err, "the impacts");
}

ms_walls ms_walls_of(const ms_stepper *s) {
  const ms_scene *scene = s->model->scene;
  return (ms_walls){scene->nplanes, scene->planes, s->events->reach, s->events->merge};
}

ms_path ms_contacts_path(const ms_stepper *s, int32_t row, const double *b0, const double *b1) {
  const ms_rows *rows = &s->model->rows;
  ms_path p = {.walls = ms_walls_of(s), .h = s->h};
  ms_row_get(rows, s->x, row, p.x);
  ms_row_get(rows, s->v, row, p.v);
  ms_row_get(rows, b0, row, p.b0);
  ms_row_get(rows, b1, row, p.b1);
  memcpy(p.a, p.b0, sizeof p.a);
  memcpy(p.w, p.v, sizeof p.w);
  return p;
}

void ms_events_destroy(const ms_model *model, ms_events *e) {
  if (!e) return;
  const msim_allocator *alloc = &model->scene->alloc;
  void *arrays[] = {e->x, e->v, e->a, e->a_end, e->contact, e->hold, e->followed, e->parts};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) ms_delete(alloc, arrays[i]);
  for (int i = 0; i < 2; i++) ms_delete(alloc, e->stage[i]), ms_delete(alloc, e->begin[i]);
  ms_delete(alloc, e);
}

void ms_contacts_keep_begin(ms_events *e, ms_shape shape) {
  if (!e->moved) return;
  ms_copy(shape, e->x, e->begin[0]);
  ms_copy(shape, e->v, e->begin[1]);
}

void ms_contacts_know(ms_events *e) {
  ms_swap(&e->a, &e->a_end);
  e->known = 1;
}

void ms_contacts_note(ms_stepper *s) {
  /* not under error control (one_part): results must not depend on rejected steps */
  if (!s->events->ncontacts || s->one_part) return;
  s->events->held_next = ms_contacts_sign(s);
  s->warm_next |= MS_NOTED;
}

void ms_contacts_advance(ms_stepper *s) {
  ms_events *e = s->events;
  s->warm = s->warm_next;
  if (!e || !(s->warm & MS_NOTED)) return;
  ms_contacts_know(e);
  e->held = e->held_next;
}

void ms_contacts_own(ms_stepper *s) {
  ms_events *e = s->events;
  const ms_rows *rows = &s->model->rows;
  const size_t bytes = (size_t)rows->dims * (size_t)rows->stride * sizeof *s->x;
  e->known = 0;
  if (s->x == e->x) return;
  memcpy(e->x, s->x, bytes); /* pinned particles too */
  memcpy(e->v, s->v, bytes);
  s->x = e->x, s->v = e->v;
}

/*------------------------------------- the contact set ------------------------------------------*/

/* Lets a particle that moves into planes bounce, and puts one that lies outside on them. */
static void meet_planes(ms_stepper *s, const ms_walls *walls, ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double x[3], v[3];
  ms_row_get(rows, s->x, c->row, x);
  ms_row_get(rows, s->v, c->row, v);
  int outside = 0;
  const double noise = ms_distance_noise(walls, x);
  for (int i = 0; i < c->on.n; i++) outside |= ms_distance(c->on.plane[i], x) < -noise;
  const int bounced = ms_bounce(&c->on, v);
  s->stats->contacts += bounced;
  if (!bounced && !outside) return;
  ms_contacts_own(s);
  ms_put_on(&c->on, x);
  ms_row_put(rows, x, c->row, s->x);
  ms_row_put(rows, v, c->row, s->v);
}

/* The planes that a particle presses on, of those that it touches and does not separate from */
static ms_touch find_holding(const ms_stepper *s, const ms_touch *on, const double v[3],
                             const double a[3]) {
  const double size = ms_norm3(a), noise = 1e-14 * (ms_norm3(v) + s->h * size);
  double left[3] = {a[0], a[1], a[2]}, unused;
  const ms_touch stays = ms_touch_approached(on, v, noise);
  return ms_touch_pressed(&stays, MS_PRESS * size, left, &unused);
}

static void scale_to_one(double u[3]) {
  const double size = ms_norm3(u);
  for (int c = 0; c < 3; c++) u[c] = size > 0 ? u[c] / size : 0;
}

/* Friction force over mass for pull = sum of mu N/m. v NULL: in the direction at the start, or 0 if
 * the matrix contains it (is_given). It keeps its direction if it turns too fast for the stages of
 * an explicit method, and is constant if it might stop v in the step of an implicit one. */
static void friction_of(const ms_stepper *s, const ms_contact *c, const double *v, double pull,
                        double f[3]) {
  const int implicit = s->events->implicit, turns = c->stop < (implicit ? 2 : 1) * s->h;
  double way[3] = {c->slide[0], c->slide[1], c->slide[2]}, now[3] = {0};
  if (v) memcpy(now, v, sizeof now);
  ms_keep_along(&c->on, now, NULL);
  memset(f, 0, 3 * sizeof *f);
  if (c->is_given) {
    if (c->friction > 0) ms_axpy3(-c->friction / c->lag, now, f);
  } else if (implicit && turns) {
    memcpy(f, c->rub, sizeof c->rub);
  } else {
    /* a stage after the stop goes on in a straight line, by which the stop is found */
    if (!turns && ms_dot3(now, c->slide) > 0) memcpy(way, now, sizeof way);
    scale_to_one(way);
    ms_axpy3(-pull, way, f);
  }
}

double ms_contact_reaction(const ms_contact *c, const double a[3]) {
  double along[3] = {a[0], a[1], a[2]}, least;
  ms_keep_along(&c->on, along, &least);
  return least;
}

/* Whether the particle sticks, and the sliding direction. Without friction it sticks only if no
 * force acts along the planes. */
static void find_slide(ms_contact *c, const double v[3], const double a[3]) {
  double along[3] = {a[0], a[1], a[2]};
  const double pull = ms_keep_along(&c->on, along, NULL), size = ms_norm3(a);
  const double grip = pull > 0 ? pull - MS_PRESS * size : 16 * DBL_EPSILON * size;
  const int still = ms_norm3(v) == 0;
  c->sticks = c->fixed || (still && ms_norm3(along) <= grip);
  if (!c->sticks) memcpy(c->slide, still ? along : v, sizeof c->slide);
  scale_to_one(c->slide);
  const double friction = c->sticks ? 0 : pull;
  for (int i = 0; i < 3; i++) c->rub[i] = -friction * c->slide[i];
  c->stop = friction > 0 ? ms_norm3(v) / friction : INFINITY;
}

void ms_contact_classify(ms_contact *c, int32_t dims) {
  c->fixed = c->on.n >= dims;
  c->rubs = 0;
  for (int i = 0; i < c->on.n; i++) c->rubs |= c->on.plane[i]->friction > 0;
}

/* Reduces c->on to the planes that act, and v to motion along them; 0: the particle is free. */
static int settle(ms_stepper *s, ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double v[3], before[3], a[3];
  ms_row_get(rows, s->v, c->row, v);
  ms_row_get(rows, s->events->a, c->row, a);
  const ms_touch touched = c->on;
  c->on = find_holding(s, &touched, v, a);
  const double left = s->events->sums;
  if (!c->on.n && left > 0 && touched.n == 1 &&
      ms_path_sums_bounces(touched.plane[0], v, a, left, s->events->jump)) {
    c->on = touched;
    c->bounces = 1;
    c->rebound = ms_dot3(touched.plane[0]->normal, v);
  }
  if (!c->on.n) return 0;
  ms_contact_classify(c, rows->dims);
  const double noise = ms_speed_noise(v);
  memcpy(before, v, sizeof v);
  ms_keep_along(&c->on, v, NULL);
  if (c->fixed || ms_norm3(v) <= noise) memset(v, 0, sizeof v);
  ms_axpy3(-1, v, before);
  if (ms_norm3(before) > noise || (ms_norm3(v) == 0 && ms_norm3(before) > 0)) {
    ms_contacts_own(s);
    ms_row_put(rows, v, c->row, s->v);
  }
  find_slide(c, v, a);
  return 1;
}

void ms_contacts_free(ms_stepper *s, const double *x, const double *v, double *a) {
  const int32_t n = s->events->ncontacts;
  s->events->ncontacts = 0;
  ms_acceleration(s, x, v, a);
  s->events->ncontacts = n;
}

void ms_contacts_find(ms_stepper *s) {
  const ms_rows *rows = &s->model->rows;
  const ms_walls walls = ms_walls_of(s);
  ms_events *e = s->events;
  int32_t touching = 0;
  e->ncontacts = 0;
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3];
    ms_row_get(rows, s->x, r, x);
    const ms_touch on = ms_touched(&walls, x);
    if (!on.n) continue;
    e->contact[touching] = (ms_contact){.row = r, .on = on};
    meet_planes(s, &walls, &e->contact[touching++]);
  }
  if (!touching) return;
  if (!e->known) ms_contacts_free(s, s->x, s->v, e->a);
  e->known = 1;
  int32_t resting = 0;
  for (int32_t i = 0; i < touching; i++) {
    ms_contact c = e->contact[i];
    if (settle(s, &c)) e->contact[resting++] = c;
  }
  e->ncontacts = resting;
}

void ms_contacts_hold(ms_stepper *s, double ah) {
  ms_events *e = s->events;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    const int all = c->sticks || c->on.n > 2;
    ms_hold *hold = &e->hold[i];
    *hold = (ms_hold){.row = c->row, .n = all ? 3 : c->on.n};
    for (int k = 0; k < hold->n; k++)
      if (all) hold->along[k][k] = 1;
      else memcpy(hold->along[k], c->on.plane[k]->normal, sizeof hold->along[k]);
    if (c->is_given && !c->sticks && c->friction > 0)
      hold->drag = s->model->mass[c->row] * ah * c->friction / c->lag;
  }
}

/*------------------------------------- contact changes ------------------------------------------*/

/* 1 if v turns by more than 45 degrees in h, or if its direction is stiff: velocity across v decays
 * at the rate F/|v|, F the friction over mass. Straight motion has none. v: at both ends; a: at the
 * second */
static int turns(const ms_contact *c, double h, double v[2][3], const double a[3]) {
  double along[3] = {a[0], a[1], a[2]};
  if (!c->rubs || c->sticks || c->fixed || c->bounces) return 0;
  ms_keep_along(&c->on, along, NULL);
  const double ahead = ms_dot3(c->slide, along), across2 = ms_dot3(along, along) - ahead * ahead;
  const int is_straight = across2 <= 1e-12 * ahead * ahead;
  return (c->stop < h && !is_straight) ||
         ms_dot3(v[0], v[1]) < sqrt(0.5) * ms_norm3(v[0]) * ms_norm3(v[1]);
}

/* Friction margin (m/s^2): how much larger |a_t| may become before a sticking particle slips */
static double grip(const ms_contact *c, const double a[3]) {
  double along[3] = {a[0], a[1], a[2]};
  const double pull = ms_keep_along(&c->on, along, NULL);
  return pull - ms_norm3(along);
}

/* The share of the substep after which g, linear in time, falls below 0 */
static double crossing(double g0, double g1) { return g0 > 0 ? g0 / (g0 - g1) : 0; }

/* ms_contact.change, but for turns. v: at the start; a0, a1: free accelerations at both ends.
 * Sliding stops as with constant a0. */
static double find_change(const ms_contact *c, double h, const double v[3], double a0[3],
                          const double a1[3]) {
  if (c->bounces) return MS_NOWHERE;
  const double noise = MS_PRESS * ms_norm3(a1), push = ms_contact_reaction(c, a1);
  if (push < -noise) return crossing(ms_contact_reaction(c, a0), push);
  if (c->fixed || (c->sticks && grip(c, a1) >= -noise)) return MS_NOWHERE;
  if (c->sticks) return crossing(grip(c, a0), grip(c, a1));
  if (!c->rubs) return MS_NOWHERE;
  const double friction = ms_keep_along(&c->on, a0, NULL);
  const double stop = ms_friction_stop(a0, friction, v) / h;
  return stop <= 1 ? stop : MS_NOWHERE;
}

/* Sets `change` by the substep just made, with free accelerations a and a_end. */
static void judge(const ms_stepper *s, ms_contact *c) {
  const ms_rows *rows = &s->model->rows;
  double v[2][3], a[2][3];
  ms_row_get(rows, s->v, c->row, v[0]);
  ms_row_get(rows, s->v_next, c->row, v[1]);
  ms_row_get(rows, s->events->a, c->row, a[0]);
  ms_row_get(rows, s->events->a_end, c->row, a[1]);
  c->change = turns(c, s->h, v, a[1]) ? 0.5 : MS_NOWHERE;
  c->change = fmin(c->change, find_change(c, s->h, v[0], a[0], a[1]));
}

/*------------------------------------- reactions ------------------------------------------------*/

/* One step of the FNV-1a hash (Fowler, Noll and Vo), by words in place of bytes */
static uint64_t mix(uint64_t sign, uint64_t number) { return (sign ^ number) * 1099511628211u; }

uint64_t ms_contacts_sign(const ms_stepper *s) {
  const ms_events *e = s->events;
  uint64_t sign = e->ncontacts ? 14695981039346656037u : 0;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    sign = mix(mix(sign, (uint64_t)c->row), (uint64_t)c->sticks);
    for (int k = 0; k < c->on.n; k++)
      sign = mix(sign, (uint64_t)(c->on.plane[k] - s->model->scene->planes));
  }
  return sign;
}

static void add(const ms_rows *rows, double h, const double u[3], int32_t r, double *vec) {
  double sum[3];
  ms_row_get(rows, vec, r, sum);
  ms_axpy3(h, u, sum);
  ms_row_put(rows, sum, r, vec);
}

/* Reactions cancel all of a if the particle sticks, else its normal part, and friction is added. */
void ms_contacts_push(const ms_stepper *s, const ms_pass *pass) {
  const ms_rows *rows = &s->model->rows;
  const int follows = !pass->along || pass->along == pass->v_to; /* x_to moves with v_to */
  for (int32_t i = 0; i < s->events->ncontacts; i++) {
    const ms_contact *c = &s->events->contact[i];
    double a[3], along[3], v[3], f[3] = {0}, push[3];
    ms_row_get(rows, pass->a, c->row, a);
    memcpy(along, a, sizeof along);
    if (pass->v) ms_row_get(rows, pass->v, c->row, v);
    const double pull = ms_keep_along(&c->on, along, NULL);
    if (c->rubs && !c->sticks) friction_of(s, c, pass->v ? v : NULL, pull, f);
    for (int k = 0; k < 3; k++) push[k] = c->sticks ? -a[k] : along[k] + f[k] - a[k];
    add(rows, 1, push, c->row, pass->a);
    if (pass->v_to) add(rows, pass->h, push, c->row, pass->v_to);
    if (pass->x_to && follows) add(rows, pass->drift * pass->h, push, c->row, pass->x_to);
  }
}

void ms_contacts_finish(ms_stepper *s) {
  const ms_rows *rows = &s->model->rows;
  const ms_events *e = s->events;
  if (!e->ncontacts) return;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    double x[3], v[3] = {0}, J[MS_MOST_HOLDING];
    ms_row_get(rows, c->sticks ? s->x : s->x_next, c->row, x);
    if (!c->sticks) ms_row_get(rows, s->v_next, c->row, v);
    if (!c->sticks || c->enters) ms_put_at(&c->on, c->end, x);
    ms_meet(&c->on, c->leave, v, J);
    ms_row_put(rows, x, c->row, s->x_next);
    ms_row_put(rows, v, c->row, s->v_next);
  }
  ms_contacts_free(s, s->x_next, s->v_next, e->a_end);
  for (int32_t i = 0; i < e->ncontacts; i++) judge(s, &e->contact[i]);
}
