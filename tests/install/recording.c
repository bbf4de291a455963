#include <msim/msim.h>
#include <stdio.h>

/* Records the first steps of a scene. usage: recording SCENE TRAJECTORY */
int main(int argc, char **argv) {
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_recorder *recorder = NULL;
  msim_options options;
  msim_error error;
  if (argc != 3) return 2;
  msim_options_init(&options, sizeof options);
  options.integrator = "linearly-implicit-euler";
  options.solver = "klu";
  options.h = 1e-3;
  options.steps = 50;
  options.every = 10;

  int failed = msim_scene_load(NULL, argv[1], &scene, &error) ||
               msim_sim_create(scene, &options, &sim, &error) ||
               msim_recorder_open(sim, argv[2], &recorder, &error);
  for (int frame = 0; frame <= 5 && !failed; frame++)
    failed = (frame && msim_sim_step(sim, 10, &error)) || msim_recorder_write(recorder, &error);
  if (recorder && msim_recorder_close(recorder, failed ? NULL : &error)) failed = 1;
  if (failed) fprintf(stderr, "recording: %s\n", error.text);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return failed;
}
