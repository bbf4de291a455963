/* Fuzz target: scene files in JSON. Any bytes are a scene or are refused; a scene makes a few
 * steps, and has the same text when it is written and read back. */
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "scene/scene.h"

enum { MOST_BYTES = 4 << 20 };

/* A scene written with its objects expanded is unchanged when it is read back. */
static void check_round_trip(msim_scene *scene, const msim_allocator *alloc) {
  msim_error err;
  msim_scene *again;
  ms_text first = {.alloc = alloc}, second = {.alloc = alloc};
  double gravity[3];
  memcpy(gravity, scene->data->external.gravity, sizeof gravity);
  if (msim_scene_set_gravity(scene, gravity, &err) == MSIM_OK &&
      ms_scene_write_json(scene->data, &first, &err) == MSIM_OK) {
    msim_status status = msim_scene_parse(alloc, "again", first.data, first.length, &again, &err);
    fuzz_check(status == MSIM_OK || status == MSIM_ERR_MEMORY, "what was written can be read");
    if (!status && msim_scene_set_gravity(again, gravity, &err) == MSIM_OK &&
        ms_scene_write_json(again->data, &second, &err) == MSIM_OK)
      fuzz_check(strcmp(first.data, second.data) == 0, "what was read is what was written");
    msim_scene_destroy(again);
  }
  ms_text_free(&first);
  ms_text_free(&second);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  fuzz_budget budget;
  const msim_allocator alloc = fuzz_allocator(&budget, MOST_BYTES);
  msim_scene *scene;
  msim_error err;
  msim_status status =
      msim_scene_parse(&alloc, "fuzz", size ? (const char *)data : "", size, &scene, &err);
  fuzz_check_error(status, &err);
  if (status) return 0;
  fuzz_run_scene(scene, "implicit-midpoint", &budget, MOST_BYTES);
  check_round_trip(scene, &alloc);
  msim_scene_destroy(scene);
  return 0;
}
