/* choice - what integrator = auto has chosen for a sim, and the candidates (choose/method_choice.h)
 * */
#ifndef MS_CHOICE_H
#define MS_CHOICE_H

#include "sim/step_verification.h"

enum { MS_CANDIDATES = 16 };

typedef struct ms_candidate {
  const ms_integrator *method;
  int32_t collision;  /* MSIM_COLLISION_...: how impacts are treated */
  int32_t precision;  /* MSIM_PRECISION_DOUBLE or _SINGLE: of its steps */
  double control_tol; /* tolerance of error control; 0: steps are fixed */
  double step_cost;   /* evaluations per step */
  double cost_rate;   /* evaluations with doubles per simulated second, or a lower bound; INFINITY:
                        rejected */
  double h;           /* s: its step */
  double error;       /* at the end of the run; 0: it was not tried */
  int tried;          /* 1: a trial has confirmed h */
  int rejection;      /* MS_REASON_...: why it was rejected; 0: it was not */
} ms_candidate;

typedef struct ms_method_choice {
  double tol;          /* as requested; 0: the method was named */
  int32_t collision;   /* as requested */
  int32_t precision;   /* as requested */
  double single_error; /* of floats at the end of the run (choose/precision_choice.h); INFINITY:
                          they are not supported here, or doubles were requested */
  double pilot_time;   /* s: length of the pilot run */
  double total_cost;   /* cost of the whole choice, in evaluations */
  int32_t best;        /* index of the candidate that was chosen */
  int damped;          /* 1: forces depend on velocities, and candidates are methods for that */
  int64_t substeps;    /* substeps: steps of the method in each step of the sim */
  int out_of_date;     /* 1: the islands were built for another method, or for other springs */
  ms_step_verification verification;
  ms_candidate candidates[MS_CANDIDATES];
} ms_method_choice;

static inline const ms_candidate *ms_choice_best(const ms_method_choice *choice) {
  return &choice->candidates[choice->best];
}

#endif
