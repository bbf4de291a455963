#include <msim/msim.h>
#include <stdio.h>

/* A mass on a spring, for two seconds. usage: pendulum [INTEGRATOR [SOLVER]] */
int main(int argc, char **argv) {
  const double x[] = {0, 0, 2, 0.5, 0, 2}, mass[] = {1, 0.2}, k = 500;
  const double gravity[] = {0, 0, -9.81};
  const int32_t ij[] = {0, 1}, pinned = 0;
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_options options;
  msim_state state;
  msim_error error;

  msim_options_init(&options, sizeof options);
  options.integrator = argc > 1 ? argv[1] : "velocity-verlet";
  options.solver = argc > 2 ? argv[2] : "auto";
  options.h = 1e-3;

  /* success is 0: the first call that fails ends the chain */
  int failed = msim_scene_create(NULL, &scene, &error) ||
               msim_scene_set_gravity(scene, gravity, &error) ||
               msim_scene_add_particles(scene, 2, x, NULL, mass, &error) ||
               msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, &error) ||
               msim_scene_pin(scene, 1, &pinned, &error) ||
               msim_sim_create(scene, &options, &sim, &error) || msim_sim_step(sim, 2000, &error);
  if (failed) {
    fprintf(stderr, "pendulum: %s\n", error.text);
  } else {
    state.size = sizeof state;
    msim_sim_state(sim, &state);
    printf("t = %g s, x = %g %g %g m\n", state.t, state.x[3], state.x[4], state.x[5]);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return failed;
}
