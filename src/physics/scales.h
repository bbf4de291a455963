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

/* What the scales of a body follow from */
typedef struct ms_scale_sources {
  double extent, farthest; /* m: of the bounding box; largest magnitude of a coordinate */
  double speed2;           /* m^2/s^2: the square of the speed without g L */
  double gravity;          /* m/s^2 */
  double omega;            /* 1/s: a bound of the frequencies */
  double span;             /* s: the length of the run */
} ms_scale_sources;

/* extent, speed and rounding */
void ms_scales_set(const ms_scale_sources *from, ms_scales *scales);

/* Scales of the state x, v (n x 3), for a run of length T = span (s). */
msim_status ms_scales_compute(const ms_scene *scene, const double *x, const double *v, double span,
                              ms_scales *scales, msim_error *err);

#endif
