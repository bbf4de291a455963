#include "sim/self_contact_prepare.h"

/* What excludes self-contact, and what to use; NULL: nothing */
typedef struct refusal {
  const char *what, *remedy;
} refusal;

static refusal find_refused(const msim_sim *sim) {
  const ms_integrator *method = sim->config.integrator;
  if (ms_sim_selects(sim)) return (refusal){"integrator 'auto'", "name a method"};
  if (ms_sim_has_control(sim))
    return (refusal){"error control (tol; dop853 without steps)", "use steps of h, without tol"};
  if (sim->config.opt.collision == MSIM_COLLISION_EVENT)
    return (refusal){"collision = event", "use collision = reflect"};
  if (sim->config.opt.precision == MSIM_PRECISION_SINGLE)
    return (refusal){"precision = single", "use precision = double"};
  if (sim->part) return (refusal){"ranks", "use one process"};
  if (method->is_multirate || method->convert_state)
    return (refusal){method->entry.name, "use velocity-verlet"};
  return (refusal){NULL, NULL};
}

msim_status ms_self_contact_prepare(msim_sim *sim, msim_error *err) {
  if (!ms_scene_has_self_contact(sim->scene)) return MSIM_OK;
  const refusal r = find_refused(sim);
  if (r.what)
    return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                        "self_contact does not support %s; %s, or remove self_contact", r.what,
                        r.remedy);
  sim->config.opt.skip_off |= MSIM_SKIP_ISLANDS | MSIM_SKIP_TWO_D | MSIM_SKIP_AT_REST;
  return MSIM_OK;
}
