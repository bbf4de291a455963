#include "sim/precision_check.h"

#include "physics/single.h"
#include "scene/laws.h"
#include "sim/refusal.h"

static ms_refusal find_refused_option(const msim_sim *sim) {
  if (ms_sim_selects(sim))
    return (ms_refusal){"integrator 'auto'", "name an explicit method, use precision = auto"};
  if (ms_sim_has_control(sim))
    return (ms_refusal){"error control (tol; dop853 without steps)", "use steps of h, without tol"};
  if (sim->part) return (ms_refusal){"ranks", "use one process"};
  if (sim->config.integrator->entry.implicit && sim->scene->ncolliders)
    return (ms_refusal){"colliders in implicit steps", "use planes only, an explicit method"};
  if (sim->config.integrator->entry.implicit && sim->scene->nplanes && sim->scene->planes_constrain)
    return (ms_refusal){"planes_constrain in implicit steps",
                        "set it to false, use an explicit method"};
  if (ms_scene_has_obstacles(sim->scene) && sim->config.opt.collision == MSIM_COLLISION_EVENT)
    return (ms_refusal){"collision = event at planes and colliders", "use collision = reflect"};
  return (ms_refusal){NULL, NULL};
}

static ms_refusal find_refused_feature(const ms_scene *s) {
  if (s->nmotions) return (ms_refusal){"motions of pinned particles", "remove the motions"};
  if (s->angles.n) return (ms_refusal){"angular springs", "remove the angles"};
  if (s->law) return (ms_refusal){"springs with a law", "remove the laws"};
  if (ms_scene_has_function(s)) return (ms_refusal){"force functions", "remove the function"};
  return (ms_refusal){NULL, NULL};
}

const char *ms_precision_find_obstacle(const ms_scene *scene) {
  const char *what = find_refused_feature(scene).what;
  if (what) return what;
  return ms_single_check_scene(scene, NULL) ? "masses or springs beyond the range of floats" : NULL;
}

/* Rounding errors of floats exceed the errors of methods of higher order at any step, and the
 * tolerance of Newton's method. */
int ms_precision_supports_method(const ms_integrator *method) {
  enum { HIGHEST_ORDER = 4 };
  return !method->nonlinear && !method->is_multirate && method->entry.order <= HIGHEST_ORDER;
}

msim_status ms_precision_check(const msim_sim *sim, msim_error *err) {
  const int32_t requested =
      ms_sim_selects(sim) ? sim->config.choice.precision : sim->config.opt.precision;
  if (requested != MSIM_PRECISION_SINGLE) return MSIM_OK;
  ms_refusal r = find_refused_option(sim);
  if (!r.what) r = find_refused_feature(sim->scene);
  if (r.what) return ms_refusal_report(r, "precision = single does", "use precision = double", err);
  if (!ms_precision_supports_method(sim->config.integrator))
    return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                        "precision = single does not support integrator '%s'; use velocity-verlet, "
                        "force-gradient or another explicit method up to order 4, "
                        "linearly-implicit-euler, or precision = double",
                        sim->config.integrator->entry.name);
  return ms_single_check_scene(sim->scene, err);
}
