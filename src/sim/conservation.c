#include "sim/conservation.h"

#include <math.h>

/* 1: energy is conserved. Planes that do not count yet (verification.planes_far) are left aside. */
static int is_conserved(const msim_sim *sim) {
  if (ms_scene_has_obstacles(sim->scene) && !sim->config.choice.verification.planes_far) return 0;
  return !sim->config.choice.damped;
}

static double total_energy(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  msim_sim_energy(sim, &e);
  return e.total;
}

void ms_conservation_start(msim_sim *sim) {
  const int is_used = is_conserved(sim) || sim->config.integrator->is_multirate;
  sim->config.choice.verification.energy = is_used ? total_energy(sim) : 0;
}

double ms_conservation_find_gain(msim_sim *sim) {
  const ms_step_verification *v = &sim->config.choice.verification;
  return (total_energy(sim) - v->energy) / (v->scales.mass * v->scales.speed * v->scales.speed);
}

static int is_last_step(const msim_sim *sim) {
  return ms_sim_has_control(sim) ? sim->run.t == sim->config.plan.t_end
                                 : sim->run.step - sim->run.step0 == sim->config.plan.steps;
}

void ms_conservation_check(msim_sim *sim) {
  enum { INTERVAL = 512 };
  const double TOO_MUCH = 10;
  ms_step_verification *v = &sim->config.choice.verification;
  if (!ms_sim_selects(sim) || v->warned || !is_conserved(sim)) return;
  if (sim->run.step % INTERVAL != 0 && !is_last_step(sim)) return;
  const double off = fabs(ms_conservation_find_gain(sim));
  if (!(off > TOO_MUCH * fmax(sim->config.choice.tol, v->scales.rounding))) return;
  v->warned = 1;
  ms_sim_warn(sim,
              "step %lld, t = %g s: the relative energy error is %.2g, so that the error exceeds "
              "tol = %g, for which %s was chosen; use a smaller tol",
              (long long)sim->run.step, ms_sim_time(sim), off, sim->config.choice.tol,
              sim->config.integrator->entry.name);
}
