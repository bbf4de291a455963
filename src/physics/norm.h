/* norm - the norm that error control measures by: each connected part of a scene has its own scales
 *
 * A part is a set of free particles that springs connect, and the pinned ones they are tied to.
 * What else there is in the scene, or in the same island, does not change its error:
 *   E^2 = 1/(2 n) sum_i (|dx_i|^2/L^2 + |dv_i|^2/U^2)
 * over its n free particles, without masses, so that an error of a light particle counts beside a
 * heavy one. */
#ifndef MS_NORM_H
#define MS_NORM_H

#include "physics/model.h"

typedef struct ms_part {
  int32_t n; /* free particles */
  double
      extent;   /* L, m: longest side of the box around the part, at the start. A part in one place:
                    how far it may come in the run, U T + g T^2/2 */
  double speed; /* U, m/s: U^2 = mean of |v_i|^2 + g L at the start, with the speeds that both ends
                    of each spring have once it has given them all its energy; 0: L/T */
  double rounding;  /* what the last bits of x and v come to, in this norm */
  double square[2]; /* E^2 of two estimates: scratch */
} ms_part;

typedef struct ms_norm {
  int32_t n;                    /* parts; 0: no particle is free */
  ms_part *part;                /* n */
  int32_t *of;                  /* nfree: the part of each unknown row */
  struct ms_gathered *gathered; /* n: scratch */
} ms_norm;

msim_status ms_norm_create(const ms_model *model, ms_norm *norm, msim_error *err);
void ms_norm_destroy(const ms_model *model, ms_norm *norm);

/* The scales of all parts in the state x, v, for a run of length T = span (s). */
void ms_norm_measure(const ms_model *model, const double *x, const double *v, double span,
                     ms_norm *norm);

/* square[which] of each part = E^2 */
void ms_norm_square(const ms_norm *norm, ms_shape shape, int which, const double *dx,
                    const double *dv);

/* The smallest extent, speed and rounding of any part; 0 where there is none. */
ms_part ms_norm_least(const ms_norm *norm);

#endif
