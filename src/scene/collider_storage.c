#include "scene/collider_storage.h"

static void release_samples(const msim_allocator *alloc, ms_samples *samples) {
  if (samples && atomic_fetch_sub(&samples->references, 1) == 1) ms_memory_free(alloc, samples);
}

msim_status ms_collider_storage_copy(const ms_scene *from, ms_scene *to, msim_error *err) {
  for (int32_t i = 0; i < from->ncolliders; i++) {
    const msim_status status = ms_collider_motion_copy(&to->alloc, &from->collider_motions[i],
                                                       &to->collider_motions[i], err);
    if (status) return status;
    to->colliders[i] = from->colliders[i];
    to->solids[i] = from->solids[i];
    if (to->solids[i].samples) atomic_fetch_add(&to->solids[i].samples->references, 1);
    to->ncolliders++;
  }
  return MSIM_OK;
}

void ms_collider_storage_free(ms_scene *s) {
  for (int32_t i = 0; i < s->ncolliders; i++) {
    ms_collider_motion_free(&s->alloc, &s->collider_motions[i]);
    release_samples(&s->alloc, s->solids[i].samples);
  }
  MS_FREE(&s->alloc, s->collider_motions, s->colliders, s->solids);
}
