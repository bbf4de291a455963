/* scene_check - an allocator that counts blocks and fails on demand, and assertions about scenes */
#ifndef SCENE_CHECK_H
#define SCENE_CHECK_H

#include <stdlib.h>
#include <string.h>

#include "testing.h"
#include "scene/scene.h"

/*------------------------------------- memory ---------------------------------------------------*/

typedef struct starving {
  int live;  /* blocks allocated and not freed */
  int meals; /* successful allocations until all fail; < 0: none fails */
} starving;

static inline void *starving_alloc(size_t bytes, void *user) {
  starving *s = user;
  if (s->meals == 0) return NULL;
  s->meals -= s->meals > 0;
  void *block = malloc(bytes);
  s->live += block != NULL;
  return block;
}

static inline void starving_free(void *block, void *user) {
  ((starving *)user)->live -= block != NULL;
  free(block);
}

static inline msim_allocator starving_allocator(starving *s) {
  *s = (starving){0, -1};
  return (msim_allocator){starving_alloc, starving_free, s};
}

/*------------------------------------- content --------------------------------------------------*/

/* The whole content of a scene as JSON text; the caller frees it. */
static inline char *text_of(const ms_scene *data) {
  const msim_allocator alloc = ms_allocator(NULL);
  ms_text text = {.alloc = &alloc};
  assert_ok(ms_scene_to_json(data, &text, err));
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
