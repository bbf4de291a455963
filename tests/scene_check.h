/* scene_check - scenes to begin with, and assertions about scenes */
#ifndef SCENE_CHECK_H
#define SCENE_CHECK_H

#include <stdlib.h>
#include <string.h>

#include "limited_allocator.h"
#include "scene/scene.h"

/*------------------------------------- scenes ---------------------------------------------------*/

static inline msim_scene *make_empty_scene(void) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  return scene;
}

/* One particle before an object, so that indices of the object do not start at 0. */
static inline msim_scene *make_started_scene(void) {
  const double x[3] = {9, 9, 9}, mass = 5;
  msim_scene *scene = make_empty_scene();
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  return scene;
}

/*------------------------------------- content --------------------------------------------------*/

/* The whole content of a scene as JSON text; the caller frees it. */
static inline char *text_of(const ms_scene *data) {
  const msim_allocator alloc = ms_memory_allocator(NULL);
  ms_text text = {.alloc = &alloc};
  assert_ok(ms_scene_write_json(data, &text, err));
  char *copy = malloc(text.length + 1);
  memcpy(copy, text.data, text.length + 1);
  ms_text_free(&text);
  return copy;
}

static inline msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  return view;
}

static inline void assert_same_bits(const msim_scene *one, const msim_scene *other) {
  const msim_scene_view a = view_of(one), b = view_of(other);
  const size_t n = (size_t)a.nparticles, s = (size_t)a.nsprings;
  assert_string_equal(a.name, b.name);
  assert_int_equal(a.nparticles, b.nparticles);
  assert_int_equal(a.nsprings, b.nsprings);
  assert_int_equal(a.nplanes, b.nplanes);
  assert_memory_equal(a.x, b.x, 3 * n * sizeof *a.x);
  assert_memory_equal(a.v, b.v, 3 * n * sizeof *a.v);
  assert_memory_equal(a.mass, b.mass, n * sizeof *a.mass);
  assert_memory_equal(a.pinned, b.pinned, n);
  if (s) assert_memory_equal(a.ij, b.ij, 2 * s * sizeof *a.ij);
  if (s) assert_memory_equal(a.k, b.k, s * sizeof *a.k);
  if (s) assert_memory_equal(a.rest, b.rest, s * sizeof *a.rest);
  if (s) assert_memory_equal(a.damping, b.damping, s * sizeof *a.damping);
  assert_int_equal(a.nfaces, b.nfaces);
  if (a.nfaces) assert_memory_equal(a.faces, b.faces, 3 * (size_t)a.nfaces * sizeof *a.faces);
  if (a.nplanes) assert_memory_equal(a.planes, b.planes, (size_t)a.nplanes * sizeof *a.planes);
  assert_int_equal(a.planes_constrain, b.planes_constrain);
  assert_int_equal(a.ncolliders, b.ncolliders);
  if (a.ncolliders)
    assert_memory_equal(a.colliders, b.colliders, (size_t)a.ncolliders * sizeof *a.colliders);
  assert_memory_equal(a.gravity, b.gravity, sizeof a.gravity);
  assert_memory_equal(&a.drag, &b.drag, sizeof a.drag);
}

/* The call returns MSIM_ERR_ARG, its message contains `words`, and the scene is unchanged. */
#define assert_refused(scene, call, words)                                                  \
  do {                                                                                      \
    msim_error err_ = {0, ""};                                                              \
    msim_error *err = &err_;                                                                \
    char *before_ = text_of((scene)->data);                                                 \
    if ((call) != MSIM_ERR_ARG || err->status != MSIM_ERR_ARG || !strstr(err->text, words)) \
      fail_msg("%s: status %d, \"%s\"", #call, (int)err->status, err->text);                \
    char *after_ = text_of((scene)->data);                                                  \
    assert_string_equal(before_, after_);                                                   \
    free(before_), free(after_);                                                            \
  } while (0)

#endif
