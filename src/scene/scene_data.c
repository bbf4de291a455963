#include "scene/scene_data.h"

#include <string.h>

#include "scene/angles.h"
#include "scene/collider_storage.h"
#include "scene/laws.h"

/*------------------------------------- creation and destruction ---------------------------------*/

static void free_run(ms_scene *s) {
  for (int32_t i = 0; i < s->nrun; i++) {
    MS_FREE(&s->alloc, s->run[i].name, s->run[i].value);
  }
  ms_memory_free(&s->alloc, s->run);
}

static void free_scene_data(ms_scene *s) {
  MS_FREE(&s->alloc, s->name, s->source, s->x, s->v, s->mass, s->pinned, s->force, s->ij, s->k,
          s->rest, s->damping, s->faces, s->planes, (void *)(uintptr_t)s->force_function.name);
  for (int32_t m = 0; m < s->nmotions; m++) ms_motion_free(&s->alloc, &s->motions[m]);
  ms_memory_free(&s->alloc, s->motions);
  ms_collider_storage_free(s);
  free_run(s);
  ms_laws_free(s);
  ms_scene_angles_free(s);
  msim_allocator alloc = s->alloc;
  ms_memory_free(&alloc, s);
}

ms_scene *ms_scene_retain(ms_scene *scene) {
  atomic_fetch_add(&scene->references, 1);
  return scene;
}

void ms_scene_release(ms_scene *scene) {
  if (scene && atomic_fetch_sub(&scene->references, 1) == 1) free_scene_data(scene);
}

static ms_scene *create_named(const msim_allocator *alloc, const char *name) {
  ms_scene *s = ms_memory_allocate(alloc, 1, sizeof *s);
  if (!s) return NULL;
  s->alloc = *alloc;
  atomic_init(&s->references, 1);
  s->name = ms_memory_copy_string(alloc, name);
  if (s->name) return s;
  free_scene_data(s);
  return NULL;
}

ms_scene *ms_scene_data_create(const msim_allocator *alloc) { return create_named(alloc, ""); }

/*------------------------------------- copies ---------------------------------------------------*/

static int copy_motions(const ms_scene *s, ms_scene *c) {
  if (ms_memory_reserve(&c->alloc, MS_ARRAY(c->motions), 0, &c->motion_capacity, s->nmotions, NULL))
    return 0;
  for (; c->nmotions < s->nmotions; c->nmotions++)
    if (ms_motion_copy(&c->alloc, &s->motions[c->nmotions], &c->motions[c->nmotions], NULL))
      return 0;
  return 1;
}

static int copy_planes(const ms_scene *s, ms_scene *c) {
  if (ms_memory_reserve(&c->alloc, MS_ARRAY(c->planes), 0, &c->plane_capacity, s->nplanes, NULL))
    return 0;
  if (s->nplanes) memcpy(c->planes, s->planes, (size_t)s->nplanes * sizeof *s->planes);
  c->nplanes = s->nplanes;
  return 1;
}

static int copy_run(const ms_scene *s, ms_scene *c) {
  if (ms_memory_reserve(&c->alloc, MS_ARRAY(c->run), 0, &c->run_capacity, s->nrun, NULL)) return 0;
  while (c->nrun < s->nrun) {
    const ms_run_option *from = &s->run[c->nrun];
    ms_run_option *to = &c->run[c->nrun++];
    to->name = ms_memory_copy_string(&c->alloc, from->name);
    to->value = ms_memory_copy_string(&c->alloc, from->value);
    if (!to->name || !to->value) return 0;
  }
  return 1;
}

/* Room for so many of each, which the scene then has */
static int make_room(ms_scene *c, int32_t nparticles, int32_t nsprings, int32_t nfaces) {
  const ms_array faces = {&c->faces, 3 * sizeof *c->faces};
  if (!ms_scene_reserve_particles(c, nparticles, NULL) ||
      !ms_scene_reserve_springs(c, nsprings, NULL) ||
      ms_memory_reserve(&c->alloc, faces, 0, &c->face_capacity, nfaces, NULL))
    return 0;
  c->nparticles = nparticles, c->nsprings = nsprings, c->nfaces = nfaces;
  return 1;
}

ms_scene *ms_scene_data_create_like(const ms_scene *s, int32_t nparticles, int32_t nsprings,
                                    int32_t nfaces, msim_error *err) {
  ms_scene *c = create_named(&s->alloc, s->name);
  if (c) c->external = s->external, c->self_contact = s->self_contact, c->repairs = s->repairs;
  if (c) c->planes_constrain = s->planes_constrain;
  if (c && (!s->force || MS_NEW(&c->alloc, c->force, 0)) &&
      make_room(c, nparticles, nsprings, nfaces) && copy_planes(s, c) &&
      ms_scene_reserve_colliders(c, s->ncolliders, NULL) &&
      ms_collider_storage_copy(s, c, NULL) == MSIM_OK && copy_run(s, c))
    return c;
  ms_scene_release(c);
  ms_error_set_memory(err, "a copy of the scene");
  return NULL;
}

/* width elements of `size` bytes for each of n, if there are any */
static void copy_array(void *to, const void *from, int32_t n, size_t width, size_t size) {
  if (n) memcpy(to, from, (size_t)n * width * size);
}

ms_scene *ms_scene_data_copy(const ms_scene *s, msim_error *err) {
  const int32_t n = s->nparticles, m = s->nsprings;
  ms_scene *c = ms_scene_data_create_like(s, n, m, s->nfaces, err);
  if (!c) return NULL;
  copy_array(c->x, s->x, n, 3, sizeof *s->x), copy_array(c->v, s->v, n, 3, sizeof *s->v);
  copy_array(c->mass, s->mass, n, 1, sizeof *s->mass);
  copy_array(c->pinned, s->pinned, n, 1, sizeof *s->pinned);
  if (s->force) copy_array(c->force, s->force, n, 3, sizeof *s->force);
  copy_array(c->ij, s->ij, m, 2, sizeof *s->ij), copy_array(c->k, s->k, m, 1, sizeof *s->k);
  copy_array(c->rest, s->rest, m, 1, sizeof *s->rest);
  copy_array(c->damping, s->damping, m, 1, sizeof *s->damping);
  copy_array(c->faces, s->faces, s->nfaces, 3, sizeof *s->faces);
  if (copy_motions(s, c) && ms_laws_copy(s, c) && ms_scene_angles_copy(s, c) &&
      ms_scene_copy_function(s, c))
    return c;
  ms_scene_release(c);
  ms_error_set_memory(err, "a copy of the scene");
  return NULL;
}

/*------------------------------------- cuts -----------------------------------------------------*/

static int32_t place_of(const ms_scene_cut *cut, int32_t particle) {
  return cut->place ? cut->place[particle] : particle;
}

static void cut_particles(const ms_scene *s, const ms_scene_cut *cut, ms_scene *c) {
  for (size_t i = 0; i < (size_t)cut->nparticles; i++) {
    const size_t p = (size_t)cut->particle[i];
    memcpy(c->x + 3 * i, s->x + 3 * p, 3 * sizeof *s->x);
    memcpy(c->v + 3 * i, s->v + 3 * p, 3 * sizeof *s->v);
    if (s->force) memcpy(c->force + 3 * i, s->force + 3 * p, 3 * sizeof *s->force);
    c->mass[i] = s->mass[p], c->pinned[i] = s->pinned[p];
  }
}

static void cut_springs(const ms_scene *s, const ms_scene_cut *cut, ms_scene *c) {
  for (size_t i = 0; i < (size_t)cut->nsprings; i++) {
    const size_t e = (size_t)cut->spring[i];
    for (size_t end = 0; end < 2; end++) c->ij[2 * i + end] = place_of(cut, s->ij[2 * e + end]);
    c->k[i] = s->k[e], c->rest[i] = s->rest[e], c->damping[i] = s->damping[e];
  }
}

ms_scene *ms_scene_data_cut(const ms_scene *s, const ms_scene_cut *cut, msim_error *err) {
  ms_scene *c = ms_scene_data_create_like(s, cut->nparticles, cut->nsprings, cut->nfaces, err);
  if (!c) return NULL;
  cut_particles(s, cut, c);
  cut_springs(s, cut, c);
  for (size_t i = 0; i < 3 * (size_t)cut->nfaces; i++)
    c->faces[i] = place_of(cut, s->faces[3 * (size_t)cut->first_face + i]);
  return c;
}
