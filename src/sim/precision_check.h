/* precision_check - what precision = single does not support */
#ifndef MS_PRECISION_CHECK_H
#define MS_PRECISION_CHECK_H

#include "sim/sim.h"

/* MSIM_ERR_UNSUPPORTED: precision = single with a method, an option or a scene that needs doubles.
 * MSIM_ERR_ARG: a number of the scene does not fit. */
msim_status ms_precision_check(const msim_sim *sim, msim_error *err);

/* What of the scene needs doubles with any method, "angular springs"; NULL: nothing */
const char *ms_precision_find_obstacle(const ms_scene *scene);

int ms_precision_supports_method(const ms_integrator *method);

#endif
