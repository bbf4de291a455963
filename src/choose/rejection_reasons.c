#include "choose/rejection_reasons.h"

const char *ms_rejection_reasons_text(int why) {
  static const char *const reasons[MS_REASON_COUNT] = {
      [MS_REASON_NO_IMPACTS_YET] = "there was no impact to tell what it makes of it",
      [MS_REASON_FEW_IMPACTS] = "impacts are few enough to be located",
      [MS_REASON_TO_BE_LOCATED] = "impacts are to be located",
      [MS_REASON_NO_IMPACTS] = "there are no impacts",
      [MS_REASON_NO_PLANES] = "it takes no planes",
      [MS_REASON_ON_GRID] = "frames are at steps of the run as it began",
      [MS_REASON_FEW_PARTICLES] = "of so few particles one event decides on the error",
      [MS_REASON_UNVERIFIED] = "its steps cannot be verified, as particles are not many",
      [MS_REASON_DAMPED] = "forces depend on velocities",
      [MS_REASON_UNDAMPED] = "no force depends on velocities",
      [MS_REASON_STIFF_SPRINGS_NOT_FEW] = "no few springs hold the others up",
      [MS_REASON_ERROR_TOO_LARGE] = "its error is too large where it would pay",
      [MS_REASON_TRIAL_TOO_EXPENSIVE] = "to try it would cost more than it could save",
      [MS_REASON_ACCURACY_DECIDES] = "accuracy, not stability, sets the steps of the best so far",
      [MS_REASON_TOO_EXPENSIVE] = "ten of its steps would cost more than a fifth of the run",
      [MS_REASON_COSTS_MORE] = "its steps at the beginning cost more than those of the best",
      [MS_REASON_RUN_NOT_FINISHED] = "it is not through with the run at a fifth of the cost",
      [MS_REASON_NEVER_STABLE] = "a spring pulls without damping, so that no step is stable"};
  return reasons[why];
}
