/* damper_strength - how much the non-symmetric damping term (physics/damping_derivative.h) matters
 * in Newton's matrix of an implicit stage */
#ifndef MS_DAMPER_STRENGTH_H
#define MS_DAMPER_STRENGTH_H

#include "physics/force.h"

/* The term is small, or may matter, or outweighs the stiffness of springs, so that dampers keep
 * their lengths. */
typedef enum ms_damper_strength {
  MS_DAMPERS_WEAK,
  MS_DAMPERS_STRONG,
  MS_DAMPERS_DOMINANT
} ms_damper_strength;

/* ah: the coefficient of the stage times h, s. Of all ranks */
ms_damper_strength ms_damper_strength_find(const ms_model *model, double ah);

#endif
