/* pins - the pinned particles of a sim that move */
#include <math.h>

#include "physics/moving_pins.h"
#include "sim/sim.h"

/* The time up to which steps were made */
static double time_of_steps(const msim_sim *sim) {
  return ms_sim_has_control(sim) ? sim->run.t : ms_sim_time(sim);
}

void ms_sim_set_pins(msim_sim *sim) {
  const ms_instant now = {.t = time_of_steps(sim)};
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    ms_stepper *s = &m->stepper;
    if (!m->model.pins) continue;
    ms_moving_pins_set(&m->model, now, s->x, s->v);
    for (int i = 0; i < 2; i++)
      if (s->x_spare[i]) ms_moving_pins_set(&m->model, now, s->x_spare[i], NULL);
  }
}

void ms_sim_start_pins(msim_sim *sim) {
  const ms_instant now = {.t = time_of_steps(sim)};
  if (sim->scene->nmotions == 0) return;
  ms_moving_pins_set_arrays(sim->scene, now, sim->state_x, sim->state_v);
  sim->run.pin_energy = ms_moving_pins_compute_energy(sim->scene, sim->state_x, sim->state_v);
}

void ms_sim_move_pins(msim_sim *sim, double t) {
  const double before = sim->run.pin_energy;
  if (sim->scene->nmotions == 0) return;
  if (ms_moving_pins_next_time(sim->scene, t) <= time_of_steps(sim) * (1 + 1e-12))
    for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
      if (m->model.pins || sim->ranks) m->stepper.cached_stage = 0; /* the same on all ranks */
  ms_sim_set_pins(sim);
  ms_sim_start_pins(sim);
  sim->run.work += sim->run.pin_energy - before;
}
