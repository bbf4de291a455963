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

/* 1 where the matrix becomes one of scalars, or ceases to be one. */
static int changes_kind(const msim_sim *sim, const double *rest, const double *damping) {
  const ms_springs *s = &sim->model->springs;
  int alike = !(sim->opt.skip_off & MSIM_SKIP_ZERO_REST_LENGTH);
  for (int32_t i = 0; i < s->n; i++) {
    const int32_t e = s->spring[i];
    alike &= (rest ? rest : sim->scene->rest)[e] == 0;
    alike &= (damping ? damping : sim->scene->damping)[e] == 0;
  }
  return sim->linear && alike != (sim->linear->system.a.block == 1);
}

static msim_status write_springs(msim_sim *sim, const double *k, const double *rest,
                                 const double *damping, msim_error *err) {
  ms_scene *scene = own_scene(sim, err);
  if (!scene) return MSIM_ERR_MEMORY;
  const size_t bytes = (size_t)scene->nsprings * sizeof(double);
  if (k) memcpy(scene->k, k, bytes);
  if (rest) memcpy(scene->rest, rest, bytes);
  if (damping) memcpy(scene->damping, damping, bytes);
  ms_model_update(sim->model, sim->opt.skip_off);
  return MSIM_OK;
}

static msim_status replace_solver(msim_sim *sim, msim_error *err) {
  ms_solver *fresh;
  msim_status status =
      ms_solver_create(sim->model, &sim->opt, sim->plan.h, &sim->stats, &fresh, err);
  if (status) return status;
  ms_solver_destroy(sim->linear);
  sim->linear = sim->stepper.solver = fresh;
  return MSIM_OK;
}

static void put_back(msim_sim *sim, ms_scene *before) {
  ms_scene_release(sim->scene);
  sim->model->scene = sim->scene = before;
  ms_model_update(sim->model, sim->opt.skip_off);
}

msim_status msim_sim_set_springs(msim_sim *sim, const double *k, const double *rest,
                                 const double *damping, msim_error *err) {
  if (!sim) return ms_fail(err, MSIM_ERR_ARG, "sim is NULL");
  const int32_t n = sim->scene->nsprings;
  msim_status status = check_values("k", n, k, err);
  if (!status) status = check_values("rest", n, rest, err);
  if (!status) status = check_values("damping", n, damping, err);
  if (status) return status;
  const int other = changes_kind(sim, rest, damping);
  ms_scene *before = other ? ms_scene_share(sim->scene) : NULL;
  ms_sim_drop_matrix(sim); /* its model is one of the scene as it was */
  status = write_springs(sim, k, rest, damping, err);
  if (!status && other) status = replace_solver(sim, err);
  if (status && other) put_back(sim, before);
  else ms_scene_release(before);
  if (status) return status;
  if (sim->linear) ms_solver_renew(sim->linear);
  sim->at_rest = 0;
  sim->stepper.warm = 0; /* forces were those of the old springs */
  sim->flat_is_current = 0;
  return ms_ok(err);
}
