/* two_level - sims whose solver pcg has a coarse space or none, as the test chooses */
#ifndef TWO_LEVEL_H
#define TWO_LEVEL_H

#include <math.h>

#include "linear/pcg.h"
#include "linear/solver.h"
#include "scenes.h"
#include "sim/sim.h"

/* Linearly implicit Euler with pcg, h = 1/60 s, clamped stiffness matrices. */
static inline msim_options two_level_options(void) {
  msim_options opt = options("linearly-implicit-euler", 1.0 / 60);
  opt.solver = "pcg";
  opt.jacobian = MSIM_JACOBIAN_CLAMP;
  return opt;
}

static inline ms_pcg *pcg_of(msim_sim *sim) {
  return (ms_pcg *)sim->islands->stepper.solver->linear;
}

static inline msim_sim *make_sim_with_coarse(const msim_scene *scene, const msim_options *opt,
                                             ms_coarse_size size) {
  msim_sim *sim = make_sim(scene, opt);
  ms_solver *solver = sim->islands->stepper.solver;
  assert_string_equal(solver->linear->name, "pcg");
  solver->linear->ops->destroy(solver->linear);
  solver->linear = NULL;
  assert_ok(ms_pcg_create(&solver->system, &sim->config.opt, size, &solver->linear, err));
  if (sim->config.integrator->nonlinear || sim->islands->stepper.events)
    assert_ok(ms_solver_prepare_descent(solver, err));
  if (!solver->linear->work[0]) return sim; /* the solver has its own */
  solver->residual = solver->linear->work[0];
  solver->correction = solver->linear->work[1];
  solver->magnitude = solver->linear->work[2];
  return sim;
}

/* aggregate: block rows per aggregate of the coarse space; 0: block Jacobi only */
static inline msim_sim *make_two_level_sim(const msim_scene *scene, const msim_options *opt,
                                           int32_t aggregate) {
  return make_sim_with_coarse(scene, opt, (ms_coarse_size){.aggregate = aggregate});
}

/* A cube that hangs from its top face, which is pinned. */
static inline msim_scene *hanging_cube(int32_t side, double k) {
  return pinned_block(side, 0.3, k, side - 1);
}

/* Mean number of iterations per step in the 5 steps after the first `steps`. */
static inline double iterations_after(msim_sim *sim, int64_t steps) {
  assert_ok(msim_sim_step(sim, steps, err));
  const int64_t before = stats_of(sim).iterations;
  assert_ok(msim_sim_step(sim, 5, err));
  return (double)(stats_of(sim).iterations - before) / 5;
}

#endif
