#include "checkpoint/saved_scene.h"

#include <math.h>
#include <string.h>

#include "scene/laws.h"
#include "sim/rank_scene.h"

/*------------------------------------- forces ---------------------------------------------------*/

static size_t count_bytes(const ms_scene *s) { return 3 * (size_t)s->nparticles * sizeof(double); }

static void archive_numbers(ms_archive *b, size_t n, double *numbers, const char *what) {
  ms_archive_transfer(b, numbers, n * sizeof *numbers);
  for (size_t i = 0; i < n && !ms_archive_failed(b); i++)
    ms_archive_check(b, isfinite(numbers[i]), what);
}

/* Gravity, drag and constant forces. MS_ARCHIVE_COUNT reserves room for those set later. */
static msim_status archive_forces(ms_archive *b, ms_scene *s, msim_error *err) {
  int32_t there = s->force != NULL;
  archive_numbers(b, sizeof s->external / sizeof(double), (double *)(void *)&s->external,
                  "a force");
  ms_archive_check(b, s->external.drag >= 0, "drag");
  MS_ARCHIVE_TRANSFER(b, there);
  if (b->direction == MS_ARCHIVE_READ && there && !s->force &&
      !MS_NEW(&s->alloc, s->force, 3 * (size_t)s->particle_capacity))
    return ms_error_set_memory(err, "the forces on particles");
  if (b->direction == MS_ARCHIVE_READ && !there) {
    ms_memory_free(&s->alloc, s->force);
    s->force = NULL;
  }
  if (there) archive_numbers(b, 3 * (size_t)s->nparticles, s->force, "a force");
  else if (b->direction == MS_ARCHIVE_COUNT) b->position += count_bytes(s);
  return MSIM_OK;
}

/*------------------------------------- pins and motions -----------------------------------------*/

/* The next motion of the scene that is read; a wrong one is refused by the setter. */
static msim_status read_motion(ms_archive *b, msim_scene *scene, msim_error *err) {
  const msim_allocator *alloc = &scene->data->alloc;
  ms_motion m = {0};
  MS_ARCHIVE_TRANSFER(b, m.n);
  MS_ARCHIVE_TRANSFER(b, m.nt);
  MS_ARCHIVE_TRANSFER(b, m.interpolation);
  const size_t left = b->size > b->position ? b->size - b->position : 0;
  const size_t n = (size_t)m.n, nt = (size_t)m.nt;
  ms_archive_check(b, m.n > 0 && m.nt > 0 && n <= left / 4 && nt <= left / 8 / (3 * n),
                   "the size of a motion");
  if (ms_archive_failed(b)) return MSIM_OK;
  const int fits =
      MS_NEW(alloc, m.particles, n) && MS_NEW(alloc, m.t, nt) && MS_NEW(alloc, m.x, 3 * n * nt);
  msim_status status = fits ? MSIM_OK : ms_error_set_memory(err, "a motion");
  if (!status) {
    ms_archive_transfer(b, m.particles, n * sizeof *m.particles);
    ms_archive_transfer(b, m.t, nt * sizeof *m.t);
    ms_archive_transfer(b, m.x, 3 * n * nt * sizeof *m.x);
    const msim_motion add = {.size = sizeof add,
                             .n = m.n,
                             .particles = m.particles,
                             .nt = m.nt,
                             .t = m.t,
                             .x = m.x,
                             .interpolation = m.interpolation};
    status = msim_scene_add_motion(scene, &add, err);
  }
  ms_motion_free(alloc, &m);
  return status;
}

static void write_motion(ms_archive *b, ms_motion *m) {
  MS_ARCHIVE_TRANSFER(b, m->n);
  MS_ARCHIVE_TRANSFER(b, m->nt);
  MS_ARCHIVE_TRANSFER(b, m->interpolation);
  ms_archive_transfer(b, m->particles, (size_t)m->n * sizeof *m->particles);
  ms_archive_transfer(b, m->t, (size_t)m->nt * sizeof *m->t);
  ms_archive_transfer(b, m->x, 3 * (size_t)m->n * (size_t)m->nt * sizeof *m->x);
}

static void remove_motions(ms_scene *s) {
  for (int32_t i = 0; i < s->nmotions; i++) ms_motion_free(&s->alloc, &s->motions[i]);
  for (int32_t i = 0; i < s->ncolliders; i++)
    ms_collider_motion_free(&s->alloc, &s->collider_motions[i]);
  s->nmotions = 0;
}

/* Times, positions and rotation vectors of a collider, one behind the other; nt = 0: it rests. */
static msim_status read_collider_motion(ms_archive *b, msim_scene *scene, int32_t i,
                                        msim_error *err) {
  const msim_allocator *alloc = &scene->data->alloc;
  msim_collider_motion m = {.size = sizeof m, .collider = i};
  int32_t rotates = 0;
  double *t;
  MS_ARCHIVE_TRANSFER(b, m.nt);
  MS_ARCHIVE_TRANSFER(b, m.interpolation);
  MS_ARCHIVE_TRANSFER(b, rotates);
  const size_t left = b->size > b->position ? b->size - b->position : 0, nt = (size_t)m.nt;
  ms_archive_check(b, (rotates | 1) == 1 && m.nt >= 0 && nt <= left / (4 * sizeof *t),
                   "the size of a motion");
  if (ms_archive_failed(b) || nt == 0) return MSIM_OK;
  if (!MS_NEW(alloc, t, 7 * nt)) return ms_error_set_memory(err, "a motion");
  ms_archive_transfer(b, t, (rotates ? 7 : 4) * nt * sizeof *t);
  m.t = t, m.x = t + nt, m.rotation = rotates ? t + 4 * nt : NULL;
  const msim_status status = msim_scene_set_collider_motion(scene, &m, err);
  ms_memory_free(alloc, t);
  return status;
}

/* MS_ARCHIVE_COUNT reserves room for that of msim_sim_move_collider. */
static void write_collider_motion(ms_archive *b, ms_collider_motion *m) {
  int32_t rotates = m->rotation.nt > 0;
  const size_t bytes = (size_t)m->x.nt * sizeof(double);
  MS_ARCHIVE_TRANSFER(b, m->x.nt);
  MS_ARCHIVE_TRANSFER(b, m->x.interpolation);
  MS_ARCHIVE_TRANSFER(b, rotates);
  if (bytes) {
    ms_archive_transfer(b, m->x.t, bytes);
    ms_archive_transfer(b, m->x.x, 3 * bytes);
  }
  if (rotates) ms_archive_transfer(b, m->rotation.x, 3 * bytes);
  if (b->direction == MS_ARCHIVE_COUNT) b->position += (size_t)2 * 7 * sizeof(double);
}

static msim_status archive_pins(ms_archive *b, msim_scene *scene, msim_error *err) {
  ms_scene *s = scene->data;
  const int reads = b->direction == MS_ARCHIVE_READ;
  int32_t count = s->nmotions;
  msim_status status = MSIM_OK;
  ms_archive_transfer(b, s->pinned, (size_t)s->nparticles);
  for (int32_t p = 0; p < s->nparticles; p++) ms_archive_check(b, (s->pinned[p] | 1) == 1, "a pin");
  archive_numbers(b, 3 * (size_t)s->nparticles, s->x, "the position of a pin");
  archive_numbers(b, 3 * (size_t)s->nparticles, s->v, "the velocity of a particle");
  MS_ARCHIVE_TRANSFER(b, count);
  if (reads) remove_motions(s);
  for (int32_t i = 0; i < count && !status && !ms_archive_failed(b); i++)
    if (reads) status = read_motion(b, scene, err);
    else write_motion(b, &s->motions[i]);
  for (int32_t i = 0; i < s->ncolliders && !status && !ms_archive_failed(b); i++)
    if (reads) status = read_collider_motion(b, scene, i, err);
    else write_collider_motion(b, &s->collider_motions[i]);
  return status;
}

/*------------------------------------- springs --------------------------------------------------*/

static void archive_springs(ms_archive *b, ms_scene *s) {
  double *arrays[] = {s->k, s->rest, s->damping};
  for (int i = 0; i < 3; i++) {
    ms_archive_transfer(b, arrays[i], (size_t)s->nsprings * sizeof(double));
    for (int32_t e = 0; e < s->nsprings && b->direction == MS_ARCHIVE_READ; e++)
      ms_archive_check(b, isfinite(arrays[i][e]) && arrays[i][e] >= 0, "a spring");
  }
}

/*------------------------------------- edited scenes --------------------------------------------*/

/* Numbers of particles, springs and faces; 1 where springs have laws */
typedef struct sizes {
  int32_t particles, springs, faces, laws;
} sizes;

/* Give the scene these sizes, with arrays whose content does not matter. */
static msim_status resize(ms_scene *s, sizes n, msim_error *err) {
  const ms_array faces = {&s->faces, 3 * sizeof *s->faces};
  s->nparticles = s->nsprings = s->nfaces = 0;
  if (!ms_scene_reserve_particles(s, n.particles, err) ||
      !ms_scene_reserve_springs(s, n.springs, err) ||
      ms_memory_reserve(&s->alloc, faces, 0, &s->face_capacity, n.faces, err))
    return MSIM_ERR_MEMORY;
  if (!n.laws) MS_FREE(&s->alloc, s->law), s->law = NULL;
  else if (!s->law && !MS_NEW(&s->alloc, s->law, s->spring_capacity))
    return ms_error_set_memory(err, "the laws of springs");
  s->nparticles = n.particles, s->nsprings = n.springs, s->nfaces = n.faces;
  return ms_scene_prepare_breaking(s, err);
}

static void check_topology(ms_archive *b, const ms_scene *s) {
  for (int32_t p = 0; p < s->nparticles; p++)
    ms_archive_check(b, isfinite(s->mass[p]) && s->mass[p] > 0, "a mass");
  for (size_t i = 0; i < 2 * (size_t)s->nsprings; i++)
    ms_archive_check(
        b, s->ij[i] >= 0 && s->ij[i] < s->nparticles && (i % 2 == 0 || s->ij[i] != s->ij[i - 1]),
        "an end of a spring");
  for (int32_t e = 0; e < s->nsprings && s->law; e++)
    ms_archive_check(b, s->law[e] >= 0 && s->law[e] <= s->nlaws, "the law of a spring");
  for (size_t i = 0; i < 3 * (size_t)s->nfaces; i++)
    ms_archive_check(b, s->faces[i] >= 0 && s->faces[i] < s->nparticles, "a face");
}

/* All that an edit changes, except forces and pins */
static msim_status archive_topology(ms_archive *b, ms_scene *s, msim_error *err) {
  sizes n = {s->nparticles, s->nsprings, s->nfaces, s->law != NULL};
  MS_ARCHIVE_TRANSFER(b, n);
  if (b->direction == MS_ARCHIVE_READ) {
    const size_t left = b->size > b->position ? b->size - b->position : 0;
    ms_archive_check(b,
                     n.particles > 0 && n.springs >= 0 && n.faces >= 0 && (n.laws | 1) == 1 &&
                         (size_t)n.particles <= left / 56 && (size_t)n.springs <= left / 32 &&
                         (size_t)n.faces <= left / 12,
                     "the size of the scene");
    if (ms_archive_failed(b)) return MSIM_OK;
    const msim_status status = resize(s, n, err);
    if (status) return status;
  }
  const size_t springs = (size_t)n.springs;
  ms_archive_transfer(b, s->mass, (size_t)n.particles * sizeof *s->mass);
  ms_archive_transfer(b, s->ij, 2 * springs * sizeof *s->ij);
  ms_archive_transfer(b, s->faces, 3 * (size_t)n.faces * sizeof *s->faces);
  if (n.laws) ms_archive_transfer(b, s->law, springs * sizeof *s->law);
  archive_springs(b, s);
  if (b->direction == MS_ARCHIVE_READ && !ms_archive_failed(b)) check_topology(b, s);
  return MSIM_OK;
}

static int are_equal(const void *a, const void *b, size_t bytes) {
  return bytes == 0 || memcmp(a, b, bytes) == 0;
}

static int have_same_topology(const ms_scene *a, const ms_scene *b) {
  const size_t n = (size_t)a->nparticles, m = (size_t)a->nsprings, real = sizeof(double);
  return a->nparticles == b->nparticles && a->nsprings == b->nsprings && a->nfaces == b->nfaces &&
         !a->law == !b->law && are_equal(a->mass, b->mass, n * real) &&
         are_equal(a->ij, b->ij, 2 * m * sizeof *a->ij) && are_equal(a->k, b->k, m * real) &&
         are_equal(a->rest, b->rest, m * real) && are_equal(a->damping, b->damping, m * real) &&
         (!a->law || are_equal(a->law, b->law, m * sizeof *a->law)) &&
         are_equal(a->faces, b->faces, 3 * (size_t)a->nfaces * sizeof *a->faces);
}

/*------------------------------------- broken springs -------------------------------------------*/

void ms_saved_scene_archive_broken(ms_archive *b, const ms_scene *s, uint8_t *broken) {
  if (!broken) return;
  ms_archive_transfer(b, broken, (size_t)s->nsprings);
  for (int32_t e = 0; e < s->nsprings; e++)
    ms_archive_check(b, broken[e] <= MS_BROKEN_BEFORE, "a broken spring");
}

/*------------------------------------- changes --------------------------------------------------*/

enum { PARTICLE = 9 * sizeof(double) + 1 }; /* its force and pin: bytes of forces and pins */

void ms_saved_scene_write_changes(ms_archive *b, const msim_sim *sim) {
  int32_t changed = sim->edited_from ? MS_SCENE_EDITED : sim->created_from ? MS_SCENE_CHANGED : 0;
  msim_scene handle = {.data = sim->scene};
  const int32_t elsewhere = ms_rank_scene_count_particles(sim) - sim->scene->nparticles;
  MS_ARCHIVE_TRANSFER(b, changed);
  if (b->direction == MS_ARCHIVE_COUNT) b->position += (size_t)elsewhere * PARTICLE;
  if (changed == MS_SCENE_EDITED) archive_topology(b, handle.data, NULL);
  if (MS_ARCHIVE_OPTIONAL(b, changed)) archive_forces(b, handle.data, NULL);
  if (MS_ARCHIVE_OPTIONAL(b, changed)) archive_pins(b, &handle, NULL);
  ms_saved_scene_archive_broken(b, sim->scene, sim->scene->broken);
}

/* The forces and pins of `from`, which has the same particles */
static msim_status copy_changes(const ms_scene *from, msim_scene *to, msim_error *err) {
  ms_scene *s = to->data;
  const size_t n = (size_t)s->nparticles;
  s->external = from->external;
  memcpy(s->pinned, from->pinned, n);
  memcpy(s->x, from->x, count_bytes(s));
  memcpy(s->v, from->v, count_bytes(s));
  remove_motions(s);
  msim_status status = msim_scene_set_forces(to, from->force, err);
  for (int32_t i = 0; i < from->nmotions && !status; i++) {
    const ms_motion *m = &from->motions[i];
    const msim_motion add = {.size = sizeof add,
                             .n = m->n,
                             .particles = m->particles,
                             .nt = m->nt,
                             .t = m->t,
                             .x = m->x,
                             .interpolation = m->interpolation};
    status = msim_scene_add_motion(to, &add, err);
  }
  for (int32_t i = 0; i < from->ncolliders && !status; i++)
    status = ms_collider_motion_copy(&s->alloc, &from->collider_motions[i], &s->collider_motions[i],
                                     err);
  return status;
}

static int have_same_motions(const ms_scene *a, const ms_scene *b) {
  if (a->nmotions != b->nmotions) return 0;
  for (int32_t i = 0; i < a->nmotions; i++)
    if (!ms_motion_is_equal(&a->motions[i], &b->motions[i])) return 0;
  for (int32_t i = 0; i < a->ncolliders; i++) {
    const ms_collider_motion *m = &a->collider_motions[i], *o = &b->collider_motions[i];
    if (!ms_motion_is_equal(&m->x, &o->x) || !ms_motion_is_equal(&m->rotation, &o->rotation))
      return 0;
  }
  return 1;
}

static int have_same_changes(const ms_scene *a, const ms_scene *b) {
  const size_t bytes = count_bytes(a);
  return have_same_topology(a, b) && memcmp(&a->external, &b->external, sizeof a->external) == 0 &&
         !a->force == !b->force && (!a->force || memcmp(a->force, b->force, bytes) == 0) &&
         memcmp(a->pinned, b->pinned, (size_t)a->nparticles) == 0 &&
         memcmp(a->x, b->x, bytes) == 0 && memcmp(a->v, b->v, bytes) == 0 &&
         have_same_motions(a, b);
}

/* Read changes into a scene that has none. */
static msim_status read_changes(ms_archive *b, msim_scene *scene, int32_t changed,
                                msim_error *err) {
  msim_status status = MSIM_OK;
  if (changed == MS_SCENE_EDITED) status = archive_topology(b, scene->data, err);
  if (status || ms_archive_failed(b)) return status;
  status = archive_forces(b, scene->data, err);
  return status ? status : archive_pins(b, scene, err);
}

msim_status ms_saved_scene_read_changes(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                        int32_t *changed, msim_error *err) {
  msim_scene copy = {.data = ms_scene_retain(sim->edited_from ? sim->edited_from : sim->scene)};
  msim_status status = MSIM_OK;
  *scene = NULL;
  MS_ARCHIVE_TRANSFER(b, *changed);
  ms_archive_check(b, *changed >= 0 && *changed <= MS_SCENE_EDITED, "the change of the scene");
  if (!ms_archive_failed(b) && (*changed || sim->created_from)) {
    if (!ms_scene_make_writable(&copy, err)) status = MSIM_ERR_MEMORY;
    else if (!*changed) status = copy_changes(sim->created_from, &copy, err);
    else status = read_changes(b, &copy, *changed, err);
  }
  if (!status && !ms_archive_failed(b))
    *scene = ms_scene_retain(have_same_changes(copy.data, sim->scene) ? sim->scene : copy.data);
  ms_scene_release(copy.data);
  return status;
}

/*------------------------------------- springs of solvers ---------------------------------------*/

void ms_saved_scene_write_springs(ms_archive *b, const msim_sim *sim) {
  archive_springs(b, sim->chosen_for);
}

/* A copy of the sim's scene, to be changed; NULL: out of memory */
static ms_scene *copy_scene(const msim_sim *sim, msim_error *err) {
  msim_scene copy = {.data = ms_scene_retain(sim->scene)};
  ms_scene *scene = ms_scene_make_writable(&copy, err);
  if (!scene) ms_scene_release(sim->scene);
  return scene;
}

msim_status ms_saved_scene_read_springs(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                        msim_error *err) {
  *scene = copy_scene(sim, err);
  if (!*scene) return MSIM_ERR_MEMORY;
  archive_springs(b, *scene);
  return MSIM_OK;
}

msim_status ms_saved_scene_copy_springs(const ms_scene *from, const msim_sim *sim, ms_scene **scene,
                                        msim_error *err) {
  const size_t bytes = (size_t)from->nsprings * sizeof *from->k;
  *scene = copy_scene(sim, err);
  if (!*scene) return MSIM_ERR_MEMORY;
  memcpy((*scene)->k, from->k, bytes);
  memcpy((*scene)->rest, from->rest, bytes);
  memcpy((*scene)->damping, from->damping, bytes);
  return MSIM_OK;
}
