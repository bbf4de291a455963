/* scales - characteristic length, speed and time of a scene, to which errors are relative */
#ifndef MS_SCALES_H
#define MS_SCALES_H

#include "scene/scene.h"

typedef struct ms_scales {
  double extent; /* L, m: longest side of the bounding box at the start; if 0, U T + g T^2/2 with
                      U^2 = 2 (kinetic + elastic energy)/m */
  double speed; /* U, m/s: U^2 = 2 (kinetic + elastic energy)/m + g L at the start, as if all energy
                      became kinetic and the scene fell by its own extent; if 0, L/T */
  double mass;  /* m, kg: of the free particles */
  double rounding; /* relative rounding error of x and v */
  double time;     /* s: the shortest time in which the motion may change much */
} ms_scales;

/* extent, speed and rounding. extent: of the bounding box; speed2: the square of the speed without
 * g L; farthest: the largest magnitude of a coordinate; omega: a bound of the frequencies */
void ms_scales_set(double extent, double farthest, double speed2, double gravity, double omega,
                   double span, ms_scales *scales);

/* Scales of the state x, v (n x 3), for a run of length T = span (s). */
msim_status ms_scales_compute(const ms_scene *scene, const double *x, const double *v, double span,
                              ms_scales *scales, msim_error *err);

#endif
