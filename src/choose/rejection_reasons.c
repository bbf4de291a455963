#include "choose/rejection_reasons.h"

const char *ms_rejection_reasons_text(int why) {
  static const char *const reasons[MS_REASON_COUNT] = {
      [MS_REASON_NO_IMPACTS_YET] =
          "the pilot run met no impact, so that its error at impacts is unknown",
      [MS_REASON_FEW_IMPACTS] = "impacts are few enough for locating them",
      [MS_REASON_TO_BE_LOCATED] = "impacts are to be located",
      [MS_REASON_NO_IMPACTS] = "there are no impacts to locate",
      [MS_REASON_NO_PLANES] = "it does not support planes",
      [MS_REASON_FEW_PARTICLES] = "with so few particles a single event determines the error",
      [MS_REASON_UNVERIFIED] =
          "its steps cannot be verified, and there are too few particles to do without",
      [MS_REASON_INDIVISIBLE] =
          "its steps cannot be halved, neither to verify them nor where a run has begun",
      [MS_REASON_DAMPED] = "forces depend on velocities",
      [MS_REASON_UNDAMPED] = "no force depends on velocities",
      [MS_REASON_WEAKLY_DAMPED] = "frequencies, not damping, limit its steps",
      [MS_REASON_STIFF_SPRINGS_NOT_FEW] = "the step is not limited by a few stiff springs",
      [MS_REASON_ERROR_TOO_LARGE] =
          "its error is too large at the steps at which it would be cost-effective",
      [MS_REASON_TRIAL_TOO_EXPENSIVE] = "a trial would cost more than it could save",
      [MS_REASON_ACCURACY_DECIDES] =
          "accuracy, not stability, limits the steps of the best method so far",
      [MS_REASON_TOO_EXPENSIVE] =
          "ten of its steps would cost more than a fifth of the run by the best method",
      [MS_REASON_COSTS_MORE] = "its first steps cost more than those of the best method",
      [MS_REASON_RUN_NOT_FINISHED] =
          "it did not finish the run at a fifth of the best method's cost",
      [MS_REASON_NEVER_STABLE] = "some spring is undamped, so that no step is stable",
      [MS_REASON_ANGLES] = "it does not support angular springs",
      [MS_REASON_LOW_ORDER] = "its order is too low for so small a tol",
      [MS_REASON_FEW_STAGES] = "damping is too weak for many stages",
      [MS_REASON_NOT_RELAXED] = "tol is large, or the run is short",
      [MS_REASON_RELAXED] = "tried only where a larger tolerance does not keep tol",
      [MS_REASON_RESONANCE] = "a resonance has added energy during the run",
      [MS_REASON_VERLET] = "verlet is as accurate for no more evaluations",
      [MS_REASON_FAST_TURNS] = "springs turn within few of its steps",
      [MS_REASON_LARGE_TOL] =
          "tol is so large that order 2 under error control is chosen without trials"};
  return reasons[why];
}
