/* reasons - why a method was passed over by integrator = auto, for people */
#ifndef MS_REASONS_H
#define MS_REASONS_H

enum {
  NOT_PASSED_OVER,
  NO_IMPACTS_YET,
  FEW_IMPACTS,
  TO_BE_LOCATED,
  NO_IMPACTS,
  NO_PLANES,
  ON_GRID,
  FEW_PARTICLES,
  UNVERIFIED,
  DAMPED,
  UNDAMPED,
  NO_FEW,
  TOO_LARGE,
  NOT_WORTH_IT,
  ACCURACY,
  TOO_DEAR,
  COSTS_MORE,
  NOT_THROUGH,
  NEVER_STABLE,
  MS_REASONS
};

const char *ms_reason(int why);

#endif
