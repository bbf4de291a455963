#include "sim/reasons.h"

const char *ms_reason(int why) {
  static const char *const reasons[MS_REASONS] = {
      [NO_IMPACTS_YET] = "there was no impact to tell what it makes of it",
      [FEW_IMPACTS] = "impacts are few enough to be located",
      [TO_BE_LOCATED] = "impacts are to be located",
      [NO_IMPACTS] = "there are no impacts",
      [NO_PLANES] = "it takes no planes",
      [ON_GRID] = "frames are at steps of the run as it began",
      [FEW_PARTICLES] = "of so few particles one event decides on the error",
      [UNVERIFIED] = "its steps cannot be verified, as particles are not many",
      [DAMPED] = "forces depend on velocities",
      [UNDAMPED] = "no force depends on velocities",
      [NO_FEW] = "no few springs hold the others up",
      [TOO_LARGE] = "its error is too large where it would pay",
      [NOT_WORTH_IT] = "to try it would cost more than it could save",
      [ACCURACY] = "accuracy, not stability, sets the steps of the best so far",
      [TOO_DEAR] = "ten of its steps would cost more than a fifth of the run",
      [COSTS_MORE] = "its steps at the beginning cost more than those of the best",
      [NOT_THROUGH] = "it is not through with the run at a fifth of the cost",
      [NEVER_STABLE] = "a spring pulls without damping, so that no step is stable"};
  return reasons[why];
}
