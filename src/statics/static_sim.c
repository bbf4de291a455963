#include "statics/static_sim.h"

#include <math.h>
#include <string.h>

#include "contact/contact_curvature.h"
#include "linear/backends.h"
#include "methods/methods.h"
#include "scene/motions.h"
#include "sim/rank_sim.h"

static msim_status refuse(const char *function, const char *what, msim_error *err) {
  return ms_error_set(err, MSIM_ERR_UNSUPPORTED, "%s does not support %s", function, what);
}

msim_status ms_static_sim_check(const msim_sim *of, const char *function, msim_error *err) {
  const msim_status status = ms_rank_sim_refuse(of, function, err);
  if (status) return status;
  if (ms_scene_function_has(of->scene, MSIM_FORCE_TIME | MSIM_FORCE_VELOCITY))
    return refuse(function, "forces that depend on time or velocity", err);
  if (ms_collider_motion_is_there(of->scene)) return refuse(function, "colliders that move", err);
  return MSIM_OK;
}

/* Copy the scene without damping, drag, motions and self-contact, at rest in the positions x. */
static msim_status copy_scene(const ms_scene *from, const double *x, msim_scene *to,
                              msim_error *err) {
  to->data = ms_scene_retain((ms_scene *)from);
  msim_status status = msim_scene_set_drag(to, 0, err);
  if (!status) status = msim_scene_set_self_contact(to, 0, 0, err);
  ms_scene *s = status ? NULL : ms_scene_make_writable(to, err);
  if (!s) return MSIM_ERR_MEMORY;
  while (s->nmotions) ms_scene_remove_motion(to->data, s->motions[0].particles[0]);
  for (size_t i = 0; i < 3 * (size_t)s->nparticles; i++) s->x[i] = x[i], s->v[i] = 0;
  for (int32_t e = 0; e < s->nsprings; e++) s->damping[e] = 0;
  for (int32_t e = 0; e < s->angles.n; e++) s->angles.damping[e] = 0;
  return MSIM_OK;
}

static msim_status choose_solver(const msim_sim *of, int kind, msim_options *opt, msim_error *err) {
  const msim_options *from = &of->config.opt;
  const msim_backend *cholmod;
  opt->solver = "pcg";
  if (kind == MS_STATIC_FAST) return MSIM_OK;
  opt->solver = from->solver, opt->solver_options = from->solver_options;
  if (strcmp(opt->solver, "auto") != 0) return MSIM_OK;
  const msim_status status = ms_backends_find("cholmod", opt, &of->alloc, &cholmod, err);
  opt->solver = status ? "pcg" : "cholmod";
  return status == MSIM_ERR_MEMORY ? status : MSIM_OK;
}

msim_status ms_static_sim_create(msim_sim *of, int kind, msim_sim **sim, msim_error *err) {
  const msim_options *from = &of->config.opt;
  msim_state now = {.size = sizeof now};
  msim_scene scene = {.data = NULL};
  msim_options opt;
  *sim = NULL;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = ms_implicit_euler.entry.name;
  opt.steps = 0;
  opt.threads = from->threads;
  opt.plugin_path = from->plugin_path, opt.backends = from->backends;
  opt.newton_rtol = 1e-3; /* of each of many solves */
  opt.collision = MSIM_COLLISION_EVENT;
  opt.watch = MSIM_WATCH_OFF;
  opt.skip_off = MSIM_SKIP_TWO_D | MSIM_SKIP_ISLANDS | MSIM_SKIP_ZERO_REST_LENGTH;
  msim_status status = choose_solver(of, kind, &opt, err);
  if (status) return status;
  msim_sim_state(of, &now);
  status = copy_scene(of->scene, now.x, &scene, err);
  if (!status) status = ms_sim_create(&scene, &opt, NULL, NULL, sim, err);
  ms_scene_release(scene.data);
  return status;
}

msim_status ms_static_sim_check_stop(msim_sim *of, msim_error *err) {
  if (!atomic_exchange(&of->stop, 0)) return MSIM_OK;
  return ms_error_set(err, MSIM_STOPPED, "stopped on request; the state is as it was");
}

msim_status ms_static_sim_start(msim_sim *sim, const double *x, double h, msim_error *err) {
  const msim_state state = {
      .size = sizeof state, .n = sim->scene->nparticles, .x = x, .v = sim->scene->v};
  ms_sim_switch_method(sim, sim->config.integrator, h);
  sim->config.opt.h = h;
  return ms_sim_set_state(sim, &state, err);
}

msim_status ms_static_sim_solve(msim_sim *sim, double h, const double *b, double *v,
                                msim_error *err) {
  ms_stepper *s = &sim->islands->stepper;
  ms_linear_system_spec spec = {.x = s->x, .h = h, .indefinite = -1, .rtol = MS_STATIC_RTOL};
  ms_stepper_linearize(s, s->x, s->v);
  ms_contact_curvature_constrain(s, -INFINITY, &spec);
  return ms_solver_solve(s->solver, &spec, b, v, err);
}

msim_status ms_static_sim_solve_definite(msim_sim *sim, double *h, const double *b, double *v,
                                         msim_error *err) {
  enum { HALVINGS = 100 };
  msim_status status = ms_static_sim_solve(sim, *h, b, v, err);
  for (int i = 0; i < HALVINGS && (status == MSIM_NOT_SPD || status == MSIM_NOT_CONVERGED); i++) {
    *h /= 2;
    status = ms_static_sim_solve(sim, *h, b, v, err);
  }
  return status;
}

msim_status ms_static_sim_solve_again(msim_sim *sim, const double *b, double *v, msim_error *err) {
  return ms_solver_solve_again(sim->islands->stepper.solver, MS_STATIC_RTOL, b, v, err);
}

msim_status ms_static_sim_solve_several(msim_sim *sim, int32_t n, double *const *b,
                                        double *const *v, double *room, msim_error *err) {
  return ms_solver_solve_several(sim->islands->stepper.solver, MS_STATIC_RTOL, n, b, v, room, err);
}
