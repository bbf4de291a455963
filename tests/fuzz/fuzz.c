#include "fuzz.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *spend(size_t bytes, void *user) {
  fuzz_budget *budget = user;
  if (bytes > budget->left) return NULL;
  budget->left -= bytes;
  return malloc(bytes);
}

static void give_back(void *ptr, void *user) {
  (void)user;
  free(ptr);
}

msim_allocator fuzz_allocator(fuzz_budget *budget, size_t bytes) {
  budget->left = bytes;
  return (msim_allocator){sizeof(msim_allocator), spend, give_back, budget};
}

void fuzz_check(int kept, const char *property) {
  if (kept) return;
  fprintf(stderr, "broken: %s\n", property);
  abort();
}

void fuzz_check_error(msim_status status, const msim_error *err) {
  fuzz_check(err->status == status, "the error has the status that was returned");
  fuzz_check(!*err->text == !status, "a message if and only if the call fails");
  for (const char *c = err->text; *c; c++)
    fuzz_check((unsigned char)*c >= ' ' && *c != 0x7f, "a message is one line");
}

void fuzz_check_state(msim_sim *sim) {
  msim_state state = {.size = sizeof state};
  msim_sim_state(sim, &state);
  fuzz_check(isfinite(state.t), "time is finite");
  for (size_t i = 0; i < 3 * (size_t)state.n; i++)
    fuzz_check(isfinite(state.x[i]) && isfinite(state.v[i]), "the state is finite");
}

msim_scene *fuzz_rope(const msim_allocator *alloc, const char *steps) {
  char text[512];
  msim_error err;
  msim_scene *scene;
  const int length = snprintf(
      text, sizeof text,
      "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"particles\": {\"x\": [[0,0,2],[0.5,0,2],"
      "[1,0,0]],\"mass\": 1, \"pinned\": [0]}, \"springs\": {\"ij\": [[0,1],[1,2]], \"k\": 500},"
      "\"run\": {\"integrator\": \"velocity-verlet\", \"h\": 0.01, %s}}",
      steps);
  fuzz_check(msim_scene_parse(alloc, "fuzz", text, (size_t)length, &scene, &err) == MSIM_OK,
             err.text);
  return scene;
}

msim_sim *fuzz_make_sim(const msim_scene *scene) {
  msim_error err;
  msim_sim *sim;
  msim_options options;
  msim_options_init(&options, sizeof options);
  msim_options_from_scene(&options, scene, NULL);
  options.threads = 1;
  fuzz_check(msim_sim_create(scene, &options, &sim, &err) == MSIM_OK, err.text);
  return sim;
}

void fuzz_run(const msim_scene *scene, const msim_options *options) {
  msim_error err;
  msim_sim *sim;
  const char *text;
  msim_options own = *options;
  own.threads = 1;
  msim_status status = msim_sim_create(scene, &own, &sim, &err);
  fuzz_check_error(status, &err);
  if (status) return;
  fuzz_check_error(msim_sim_explain(sim, &text, &err), &err);
  for (int i = 0; i < 3; i++) {
    fuzz_check_error(msim_sim_step(sim, 1, &err), &err);
    fuzz_check_state(sim);
  }
  msim_sim_destroy(sim);
}

void fuzz_run_scene(const msim_scene *scene, const char *integrator, fuzz_budget *budget,
                    size_t bytes) {
  msim_error err;
  msim_options options;
  msim_options_init(&options, sizeof options);
  fuzz_check_error(msim_options_from_scene(&options, scene, &err), &err);
  if (!options.integrator) options.integrator = integrator;
  budget->left = bytes;
  fuzz_run(scene, &options);
  budget->left = bytes;
}
