/* change - new parameters for a sim in motion: its matrix gets new values, its pattern stays */
#include <math.h>
#include <string.h>

#include "sim/sim.h"

/* Steps that options.steps counts are counted from the present state on. */
msim_status msim_sim_set_step(msim_sim *sim, double h, msim_error *err) {
  if (!sim || !(isfinite(h) && h > 0))
    return ms_fail(err, MSIM_ERR_ARG, "sim is NULL, or h is not a finite number > 0");
  const msim_options before = sim->opt;
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  now.v_half = NULL; /* it belongs to the old h */
  sim->opt.h = h;
  if (sim->opt.steps >= 0) sim->opt.steps -= now.step - sim->step0;
  msim_status status = msim_sim_set_state(sim, &now, err);
  if (status) sim->opt = before;
  return status;
}

static msim_status check_values(const char *what, int32_t n, const double *values,
                                msim_error *err) {
  for (int32_t e = 0; values && e < n; e++)
    if (!(isfinite(values[e]) && values[e] >= 0))
      return ms_fail(err, MSIM_ERR_ARG, "%s[%d] is %g; it must be a finite number >= 0", what, e,
                     values[e]);
  return MSIM_OK;
}

/* The sim's own scene, no longer that of the handle it was made from. */
static ms_scene *own_scene(msim_sim *sim, msim_error *err) {
  msim_scene handle = {sim->scene};
  ms_scene *own = ms_scene_writable(&handle, err);
  if (own) sim->model->scene = sim->scene = own;
  return own;
}

msim_status msim_sim_set_springs(msim_sim *sim, const double *k, const double *rest,
                                 const double *damping, msim_error *err) {
  if (!sim) return ms_fail(err, MSIM_ERR_ARG, "sim is NULL");
  const int32_t n = sim->scene->nsprings;
  msim_status status = check_values("k", n, k, err);
  if (!status) status = check_values("rest", n, rest, err);
  if (!status) status = check_values("damping", n, damping, err);
  if (status) return status;
  ms_sim_drop_matrix(sim); /* its model is one of the scene as it was */
  ms_scene *scene = own_scene(sim, err);
  if (!scene) return MSIM_ERR_MEMORY;
  const size_t bytes = (size_t)n * sizeof(double);
  if (k) memcpy(scene->k, k, bytes);
  if (rest) memcpy(scene->rest, rest, bytes);
  if (damping) memcpy(scene->damping, damping, bytes);
  ms_model_update(sim->model, sim->opt.skip_off);
  if (sim->linear) ms_solver_restart(sim->linear);
  sim->stepper.warm = 0; /* forces were those of the old springs */
  sim->flat_is_current = 0;
  return ms_ok(err);
}
