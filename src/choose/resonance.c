#include "choose/resonance.h"

#include <math.h>

#include "choose/rejection_reasons.h"
#include "methods/methods.h"
#include "sim/conservation.h"
#include "sim/energy_monitor.h"

/* Steps between two checks, each of which costs about one evaluation, half a step. In so many an
 * unstable vibration gains some 3 times its energy. */
enum { INTERVAL = 32 };

int ms_resonance_may_occur(const msim_sim *sim) {
  return ms_sim_selects(sim) && sim->config.integrator->is_multirate;
}

int ms_resonance_is_there(msim_sim *sim) {
  const ms_method_choice *s = &sim->config.choice;
  if (!ms_resonance_may_occur(sim) || sim->run.step % INTERVAL != 0) return 0;
  return ms_conservation_find_gain(sim) > fmax(s->tol, s->verification.scales.rounding);
}

static int find_candidate(const ms_method_choice *s, const ms_integrator *method) {
  int i = 0;
  while (s->candidates[i].method != method) i++;
  return i;
}

msim_status ms_resonance_leave(msim_sim *sim, msim_error *err) {
  const ms_config before = sim->config;
  const ms_integrator *method = &ms_velocity_verlet;
  const double gain = ms_conservation_find_gain(sim);
  ms_bounds bounds;
  msim_status status = ms_bounds_compute(sim->scene, 1, &bounds, err);
  if (status) return status;
  const double limit = method->limit(&bounds);
  ms_method_choice *s = &sim->config.choice;
  s->candidates[s->best].rejection = MS_REASON_RESONANCE;
  s->best = find_candidate(s, method);
  s->substeps = (int64_t)ceil(sim->run.h / (MS_STABLE_FRACTION * limit));
  ms_candidate *c = &s->candidates[s->best];
  c->rejection = MS_REASON_NONE;
  c->precision = MSIM_PRECISION_DOUBLE;
  c->h = sim->run.h / (double)s->substeps;
  c->cost_rate = c->step_cost / c->h;
  sim->config.integrator = method;
  sim->config.opt.integrator = method->entry.name;
  sim->config.step_limit.limit = limit;
  status = ms_sim_rebuild_islands(sim, err);
  if (status) {
    sim->config = before;
    return status;
  }
  ms_energy_monitor_start(sim);
  ms_sim_warn(sim,
              "step %lld, t = %g s: a resonance of respa has added %.2g of the energy of the "
              "motion; the run continues by velocity-verlet",
              (long long)sim->run.step, ms_sim_time(sim), gain);
  return MSIM_OK;
}
