#include "sim/precision_check.h"

#include "physics/single.h"
#include "scene/laws.h"

/* What needs doubles, and what to use; NULL: nothing */
typedef struct refusal {
  const char *what, *remedy;
} refusal;

static refusal find_refused_option(const msim_sim *sim) {
  if (ms_sim_selects(sim)) return (refusal){"integrator 'auto'", "name an explicit method"};
  if (ms_sim_has_control(sim))
    return (refusal){"error control (tol; dop853 without steps)", "use steps of h, without tol"};
  if (sim->part) return (refusal){"ranks", "use one process"};
  return (refusal){NULL, NULL};
}

static refusal find_refused_feature(const msim_sim *sim) {
  const ms_scene *s = sim->scene;
  if (ms_scene_has_obstacles(s) && sim->config.opt.collision == MSIM_COLLISION_EVENT)
    return (refusal){"collision = event at planes and colliders", "use collision = reflect"};
  if (s->nmotions) return (refusal){"motions of pinned particles", "remove the motions"};
  if (s->angles.n) return (refusal){"angular springs", "remove the angles"};
  if (s->law) return (refusal){"springs with a law", "remove the laws"};
  if (ms_scene_has_function(s)) return (refusal){"force functions", "remove the function"};
  return (refusal){NULL, NULL};
}

/* Rounding errors of floats exceed the errors of methods of higher order at any step. */
static int is_supported_method(const ms_integrator *method) {
  enum { HIGHEST_ORDER = 4 };
  return !method->entry.implicit && !method->is_multirate && method->entry.order <= HIGHEST_ORDER;
}

msim_status ms_precision_check(const msim_sim *sim, msim_error *err) {
  if (sim->config.opt.precision != MSIM_PRECISION_SINGLE) return MSIM_OK;
  refusal r = find_refused_option(sim);
  if (!r.what) r = find_refused_feature(sim);
  if (r.what)
    return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                        "precision = single does not support %s; %s, or use precision = double",
                        r.what, r.remedy);
  if (!is_supported_method(sim->config.integrator))
    return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                        "precision = single does not support integrator '%s'; use velocity-verlet, "
                        "force-gradient or another explicit method up to order 4, or precision = "
                        "double",
                        sim->config.integrator->entry.name);
  return ms_single_check_scene(sim->scene, err);
}
