/* edits - random edits of small scenes, and the edited scenes built without msim_scene_edit */
#ifndef TEST_EDITS_H
#define TEST_EDITS_H

#include <math.h>

#include "laws.h"

enum { SIDE = 6, N = SIDE * SIDE, MOST = 6 * N, ADDED = 3, TIED = 4 };

/* Kinds of scenes */
enum { PLAIN, LAWS, MOVING, EVENT, KINDS };

static inline msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  return view;
}

static inline void add_motion(msim_scene *scene, int32_t n, const int32_t *particles) {
  const double t[2] = {0, 0.125};
  double x[12];
  const msim_scene_view s = view_of(scene);
  for (int i = 0; i < 6 * n; i++)
    x[i] = s.x[3 * particles[i / 3 % n] + i % 3] + (i < 3 * n ? 0 : 0.0625);
  const msim_motion m = {.size = sizeof m, .n = n, .particles = particles, .nt = 2, .t = t, .x = x};
  assert_ok(msim_scene_add_motion(scene, &m, err));
}

static inline msim_scene *make_scene(const char *method, int kind) {
  const int32_t corners[2] = {0, SIDE - 1};
  double force[3 * N];
  msim_scene *scene = hanging_cloth(SIDE, 300, takes_positions_only(method) ? 0 : 0.01);
  for (int i = 0; i < 3 * N; i++) force[i] = 0.01 * cos(1.3 * i);
  assert_ok(msim_scene_set_forces(scene, force, err));
  if (kind == MOVING) add_motion(scene, 2, corners);
  if (kind == EVENT) plane(scene, 0, 0, 1, -0.02, 0.5, 0.2);
  if (kind != LAWS) return scene;
  add_laws(scene);
  for (int32_t e = 0; e < view_of(scene).nsprings; e += 3)
    assert_ok(msim_scene_set_law(scene, 1, &e, 1 + e % LAW_KINDS, err));
  return scene;
}

/*------------------------------------- edits ----------------------------------------------------*/

typedef struct random_edit {
  msim_edit is;
  int32_t particles[4], springs[8], ij[2 * TIED], law[TIED];
  double x[3 * ADDED], v[3 * ADDED], mass[ADDED], k[TIED], rest[TIED], damping[TIED];
} random_edit;

static inline int is_removed(const random_edit *r, int32_t p) {
  for (int i = 0; i < r->is.nremoved_particles; i++)
    if (r->particles[i] == p) return 1;
  return 0;
}

static inline int32_t pick(unsigned *seed, int32_t n) { return (int32_t)(uniform(seed) * n); }

/* Springs tie particles that stay to added ones. */
static inline void fill_edit(const msim_scene_view *s, int damped, unsigned seed, random_edit *r) {
  *r = (random_edit){.is = {.size = sizeof r->is}};
  r->is.nremoved_particles = (int32_t)seed % 5, r->is.removed_particles = r->particles;
  r->is.nremoved_springs = 8, r->is.removed_springs = r->springs;
  for (int i = 0; i < 4; i++) r->particles[i] = pick(&seed, s->nparticles);
  for (int i = 0; i < 8; i++) r->springs[i] = pick(&seed, s->nsprings);
  r->is.nparticles = ADDED, r->is.x = r->x, r->is.v = r->v, r->is.mass = r->mass;
  for (int i = 0; i < 3 * ADDED; i++)
    r->x[i] = 0.2 + 0.5 * uniform(&seed), r->v[i] = 0.1 * (uniform(&seed) - 0.5);
  for (int i = 0; i < ADDED; i++) r->mass[i] = 0.01 + 0.01 * uniform(&seed);
  r->is.nsprings = TIED, r->is.ij = r->ij, r->is.k = r->k, r->is.rest = r->rest;
  r->is.damping = damped ? r->damping : NULL, r->is.law = r->law;
  for (int e = 0; e < TIED; e++) {
    do r->ij[2 * e] = pick(&seed, s->nparticles);
    while (is_removed(r, r->ij[2 * e]));
    r->ij[2 * e + 1] = s->nparticles + e % ADDED;
    r->k[e] = 100 + 100 * uniform(&seed), r->rest[e] = 0.3 + 0.1 * uniform(&seed);
    r->damping[e] = 0.02 * uniform(&seed), r->law[e] = s->nlaws ? pick(&seed, s->nlaws + 1) : 0;
  }
}

/* number[p] of particles that stay and of added ones; -1 */
static inline int32_t number_particles(const random_edit *r, int32_t n, int32_t *number) {
  int32_t kept = 0;
  for (int32_t p = 0; p < n + r->is.nparticles; p++)
    number[p] = p < n && is_removed(r, p) ? -1 : kept++;
  return kept;
}

static inline int stays(const random_edit *r, const int32_t *number, const msim_scene_view *s,
                        int32_t e) {
  for (int i = 0; i < r->is.nremoved_springs; i++)
    if (r->springs[i] == e) return 0;
  return number[s->ij[2 * e]] >= 0 && number[s->ij[2 * e + 1]] >= 0;
}

static inline void build_springs(msim_scene *to, const msim_scene_view *s, const random_edit *r,
                                 const int32_t *number) {
  int32_t n = 0;
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t ij[2] = {number[s->ij[2 * e]], number[s->ij[2 * e + 1]]};
    if (!stays(r, number, s, e)) continue;
    assert_ok(msim_scene_add_springs(to, 1, ij, s->k + e, s->rest + e, s->damping + e, err));
    if (s->law && s->law[e]) assert_ok(msim_scene_set_law(to, 1, &n, s->law[e], err));
    n++;
  }
  for (int32_t e = 0; e < r->is.nsprings; e++, n++) {
    const int32_t ij[2] = {number[r->ij[2 * e]], number[r->ij[2 * e + 1]]};
    assert_ok(msim_scene_add_springs(to, 1, ij, r->k + e, r->rest + e,
                                     r->is.damping ? r->damping + e : NULL, err));
    if (r->law[e]) assert_ok(msim_scene_set_law(to, 1, &n, r->law[e], err));
  }
}

static inline void build_motion(msim_scene *to, const msim_scene *scene, const int32_t *number) {
  msim_motion m = {.size = sizeof m};
  if (view_of(scene).nmotions == 0) return;
  assert_int_equal(msim_scene_get_motion(scene, 0, &m), MSIM_OK);
  double x[12];
  int32_t particles[2], n = 0;
  for (int32_t i = 0; i < m.n; i++)
    if (number[m.particles[i]] >= 0) particles[n++] = number[m.particles[i]];
  for (int32_t k = 0, at = 0; k < m.nt; k++)
    for (int32_t i = 0; i < m.n; i++)
      if (number[m.particles[i]] >= 0) memcpy(x + 3 * at++, m.x + 3 * (k * m.n + i), 3 * sizeof *x);
  m.n = n, m.particles = particles, m.x = x;
  if (n) assert_ok(msim_scene_add_motion(to, &m, err));
}

/* The edited scene, without msim_scene_edit */
static inline msim_scene *build_edited(const msim_scene *scene, const random_edit *r) {
  const msim_scene_view s = view_of(scene);
  int32_t number[N + ADDED];
  double force[3 * (N + ADDED)] = {0};
  msim_scene *to;
  assert_ok(msim_scene_create(NULL, &to, err));
  number_particles(r, s.nparticles, number);
  for (int32_t p = 0; p < s.nparticles; p++) {
    if (number[p] < 0) continue;
    assert_ok(msim_scene_add_particles(to, 1, s.x + 3 * p, s.v + 3 * p, s.mass + p, err));
    if (s.pinned[p]) assert_ok(msim_scene_pin(to, 1, &number[p], err));
    if (s.force) memcpy(force + 3 * number[p], s.force + 3 * p, 3 * sizeof *force);
  }
  assert_ok(msim_scene_add_particles(to, r->is.nparticles, r->x, r->v, r->mass, err));
  if (s.force) assert_ok(msim_scene_set_forces(to, force, err));
  if (s.nlaws) add_laws(to);
  build_springs(to, &s, r, number);
  build_motion(to, scene, number);
  for (int32_t i = 0; i < s.nfaces; i++) {
    int32_t corner[3];
    for (int c = 0; c < 3; c++) corner[c] = number[s.faces[3 * i + c]];
    if (corner[0] >= 0 && corner[1] >= 0 && corner[2] >= 0)
      assert_ok(msim_scene_add_faces(to, 1, corner, err));
  }
  for (int32_t i = 0; i < s.nplanes; i++) assert_ok(msim_scene_add_plane(to, &s.planes[i], err));
  assert_ok(msim_scene_set_gravity(to, s.gravity, err));
  return to;
}

/*------------------------------------- running sims ---------------------------------------------*/

/* auto, then all methods */
static inline const char *method_or_auto(int32_t i) { return i ? method_at(i - 1) : "auto"; }

static inline int is(const char *method, const char *name) { return strcmp(method, name) == 0; }

static inline int takes(const char *method, int kind, int controlled) {
  const int partial = is(method, "takahashi-imada") || is(method, "respa") || is(method, "auto");
  if (controlled && (partial || is(method, "verlet"))) return 0;
  if (kind == MOVING) return !partial;
  if (kind == EVENT) return !partial && !is(method, "verlet");
  return 1;
}

static inline msim_options run_options(const char *method, int kind, int controlled) {
  msim_options opt = options(method, 1.0 / 1024);
  if (controlled) opt.tol = 1e-4, opt.steps = -1, opt.t_end = 1;
  else if (is(method, "auto")) opt.tol = 1e-3, opt.t_end = 1;
  else opt.steps = 1024;
  if (kind == EVENT) opt.collision = MSIM_COLLISION_EVENT;
  return opt;
}

#endif
