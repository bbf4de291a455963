/* run_state - where a run is, and what decides how it goes on: two values that are copied to keep
 * them, and copied back to undo a step or a change */
#ifndef MS_RUN_STATE_H
#define MS_RUN_STATE_H

#include "integrate/control.h"
#include "scene/options.h"
#include "sim/choice.h"
#include "sim/plan.h"
#include "sim/step_limit.h"

/* Beside the state vectors, all that steps change. */
typedef struct ms_run_state {
  int64_t step, step0;  /* t = plan.t0 + (step - step0) h; under error control instead: */
  double t, t_rounding; /* s: the sum of all steps, and its rounding error */
  double t_shown;       /* s: time of the state that msim_sim_state returns, <= t */
  double h;             /* s: the step; under error control the next one to try, as in `control` */
  int64_t frame;        /* frame that msim_sim_run shows next, if frames have times of their own */
  double work;       /* J: energy that changes of forces, moving pins and colliders have supplied */
  double pin_energy; /* J: of pinned particles that move (physics/moving_pins.h) */
  double moved;  /* J: the sum of |work of moving pins on springs and of colliders| over steps */
  int64_t spent; /* steps that msim_sim_set_step has subtracted from options.steps */
  ms_control control;
} ms_run_state;

/* What does not change while steps are made. */
typedef struct ms_config {
  msim_options opt; /* its strings belong to the sim, or are static */
  ms_plan plan;
  const ms_integrator *integrator;
  ms_step_limit step_limit;
  ms_method_choice choice; /* result of integrator = auto */
} ms_config;

#endif
