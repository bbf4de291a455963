/* Fuzz target: scene files in HDF5. Any bytes are a scene or are refused; a scene makes a few
 * steps, and is unchanged when it is written and read back. */
#include <string.h>

#include "fuzz.h"

enum { MOST_BYTES = 4 << 20 };

static int same(const void *a, const void *b, size_t bytes) {
  return bytes == 0 || memcmp(a, b, bytes) == 0;
}

static void check_round_trip(const msim_scene *scene, const char *path,
                             const msim_allocator *alloc) {
  msim_error err;
  msim_scene *again;
  msim_scene_view a = {.size = sizeof a}, b = {.size = sizeof b};
  if (msim_scene_save(scene, path, &err) != MSIM_OK) return;
  const msim_status status = msim_scene_load(alloc, path, &again, &err);
  fuzz_check(status == MSIM_OK || status == MSIM_ERR_MEMORY, err.text);
  if (status) return;
  msim_scene_get(scene, &a);
  msim_scene_get(again, &b);
  const size_t n = (size_t)a.nparticles, s = (size_t)a.nsprings, real = sizeof(double);
  fuzz_check(a.nparticles == b.nparticles && a.nsprings == b.nsprings && a.nplanes == b.nplanes &&
                 a.ncolliders == b.ncolliders,
             "counts are kept");
  fuzz_check(same(a.x, b.x, 3 * n * real) && same(a.v, b.v, 3 * n * real) &&
                 same(a.mass, b.mass, n * real) && same(a.pinned, b.pinned, n) &&
                 same(a.ij, b.ij, 2 * s * sizeof *a.ij) && same(a.k, b.k, s * real) &&
                 same(a.rest, b.rest, s * real) && same(a.damping, b.damping, s * real) &&
                 same(a.planes, b.planes, (size_t)a.nplanes * sizeof *a.planes) &&
                 same(a.colliders, b.colliders, (size_t)a.ncolliders * sizeof *a.colliders) &&
                 same(a.gravity, b.gravity, sizeof a.gravity) && a.drag == b.drag,
             "bits are kept");
  msim_scene_destroy(again);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  fuzz_budget budget;
  const msim_allocator alloc = fuzz_allocator(&budget, MOST_BYTES);
  msim_scene *scene;
  msim_error err;
  const char *path = fuzz_path("scene.h5");
  fuzz_write(data, size);
  msim_status status = msim_scene_load(&alloc, path, &scene, &err);
  fuzz_check_error(status, &err);
  fuzz_check(status != MSIM_ERR_PLUGIN && status != MSIM_ERR_NAME, err.text);
  if (status) return 0;
  fuzz_run_scene(scene, "velocity-verlet", &budget, MOST_BYTES);
  check_round_trip(scene, path, &alloc);
  msim_scene_destroy(scene);
  return 0;
}
