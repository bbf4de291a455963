/* capacity - makes room in the arrays of a scene */
#include "scene/scene.h"

int ms_scene_reserve_particles(ms_scene *s, int64_t needed, msim_error *err) {
  const ms_array arrays[] = {{&s->x, 3 * sizeof *s->x},
                             {&s->v, 3 * sizeof *s->v},
                             MS_ARRAY(s->mass),
                             MS_ARRAY(s->pinned),
                             {&s->force, 3 * sizeof *s->force}};
  const int count = s->force ? 5 : 4;
  int32_t capacity = s->particle_capacity;
  for (int i = 0; i < count; i++) {
    capacity = s->particle_capacity;
    if (ms_memory_reserve(&s->alloc, arrays[i], s->nparticles, &capacity, needed, err)) return 0;
  }
  s->particle_capacity = capacity;
  return 1;
}

int ms_scene_reserve_springs(ms_scene *s, int64_t needed, msim_error *err) {
  ms_array arrays[6] = {
      {&s->ij, 2 * sizeof *s->ij}, MS_ARRAY(s->k), MS_ARRAY(s->rest), MS_ARRAY(s->damping)};
  int count = 4;
  if (s->law) arrays[count++] = MS_ARRAY(s->law);
  if (s->broken) arrays[count++] = MS_ARRAY(s->broken);
  int32_t capacity = s->spring_capacity;
  for (int i = 0; i < count; i++) {
    capacity = s->spring_capacity;
    if (ms_memory_reserve(&s->alloc, arrays[i], s->nsprings, &capacity, needed, err)) return 0;
  }
  s->spring_capacity = capacity;
  return 1;
}

int ms_scene_reserve_colliders(ms_scene *s, int64_t needed, msim_error *err) {
  const ms_array arrays[] = {MS_ARRAY(s->colliders), MS_ARRAY(s->solids),
                             MS_ARRAY(s->collider_motions)};
  int32_t capacity = s->collider_capacity;
  for (int i = 0; i < 3; i++) {
    capacity = s->collider_capacity;
    if (ms_memory_reserve(&s->alloc, arrays[i], s->ncolliders, &capacity, needed, err)) return 0;
  }
  s->collider_capacity = capacity;
  return 1;
}
