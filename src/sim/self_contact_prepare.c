#include "sim/self_contact_prepare.h"

#include "sim/refusal.h"

static ms_refusal find_refused(const msim_sim *sim) {
  const ms_integrator *method = sim->config.integrator;
  if (ms_sim_selects(sim)) return (ms_refusal){"integrator 'auto'", "name a method"};
  if (ms_sim_has_control(sim))
    return (ms_refusal){"error control (tol; dop853 without steps)", "use steps of h, without tol"};
  if (sim->config.opt.collision == MSIM_COLLISION_EVENT)
    return (ms_refusal){"collision = event", "use collision = reflect"};
  if (sim->config.opt.precision == MSIM_PRECISION_SINGLE)
    return (ms_refusal){"precision = single", "use precision = double"};
  if (sim->part) return (ms_refusal){"ranks", "use one process"};
  if (method->is_multirate || method->convert_state)
    return (ms_refusal){method->entry.name, "use velocity-verlet"};
  return (ms_refusal){NULL, NULL};
}

msim_status ms_self_contact_prepare(msim_sim *sim, msim_error *err) {
  if (!ms_scene_has_self_contact(sim->scene)) return MSIM_OK;
  const msim_status status =
      ms_refusal_report(find_refused(sim), "self_contact does", "remove self_contact", err);
  if (status) return status;
  sim->config.opt.skip_off |= MSIM_SKIP_ISLANDS | MSIM_SKIP_TWO_D | MSIM_SKIP_AT_REST;
  return MSIM_OK;
}
