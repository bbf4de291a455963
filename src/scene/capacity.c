/* capacity - makes room in the arrays of a scene */
#include "scene/scene.h"

int ms_scene_reserve(const ms_scene *s, const ms_array *arrays, int count, int32_t n,
                     int32_t *capacity, int64_t needed, msim_error *err) {
  int32_t larger = *capacity;
  for (int i = 0; i < count; i++) {
    larger = *capacity;
    if (ms_memory_reserve(&s->alloc, arrays[i], n, &larger, needed, err)) return 0;
  }
  *capacity = larger;
  return 1;
}

int ms_scene_reserve_particles(ms_scene *s, int64_t needed, msim_error *err) {
  const ms_array arrays[] = {{&s->x, 3 * sizeof *s->x},
                             {&s->v, 3 * sizeof *s->v},
                             MS_ARRAY(s->mass),
                             MS_ARRAY(s->pinned),
                             {&s->force, 3 * sizeof *s->force}};
  return ms_scene_reserve(s, arrays, s->force ? 5 : 4, s->nparticles, &s->particle_capacity, needed,
                          err);
}

int ms_scene_reserve_springs(ms_scene *s, int64_t needed, msim_error *err) {
  ms_array arrays[6] = {
      {&s->ij, 2 * sizeof *s->ij}, MS_ARRAY(s->k), MS_ARRAY(s->rest), MS_ARRAY(s->damping)};
  int count = 4;
  if (s->law) arrays[count++] = MS_ARRAY(s->law);
  if (s->broken) arrays[count++] = MS_ARRAY(s->broken);
  return ms_scene_reserve(s, arrays, count, s->nsprings, &s->spring_capacity, needed, err);
}

int ms_scene_reserve_colliders(ms_scene *s, int64_t needed, msim_error *err) {
  const ms_array arrays[] = {MS_ARRAY(s->colliders), MS_ARRAY(s->solids),
                             MS_ARRAY(s->collider_motions)};
  return ms_scene_reserve(s, arrays, 3, s->ncolliders, &s->collider_capacity, needed, err);
}
