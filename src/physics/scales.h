/* scales - how large a scene is and how fast, so that errors can be told as shares of it */
#ifndef MS_SCALES_H
#define MS_SCALES_H

#include "scene/scene.h"

typedef struct ms_scales {
  double extent; /* L, m: longest side of the box around all particles, at the start. A scene in
                      one place: how far it may come in the run, U T + g T^2/2 */
  double speed; /* U, m/s: U^2 = 2 (kinetic + elastic energy)/m + g L, at the start: as if all of it
                      became motion, and the scene fell through its own extent. 0: L/T */
  double mass;  /* m, kg: of the free particles */
  double rounding; /* what the last bits of x and v come to, as such shares */
  double time;     /* s: the shortest time in which anything changes much */
} ms_scales;

/* Of the state x, v (flat 3n), for a run of length T = span (s). */
msim_status ms_scales_compute(const ms_scene *scene, const double *x, const double *v, double span,
                              ms_scales *scales, msim_error *err);

#endif
