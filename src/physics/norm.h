/* norm - the error norm of step-size control, with length and speed scales for each body of a scene
 *
 * A body is a set of free particles that springs connect, with the pinned ones they have springs
 * to. The rest of the scene, or of the island, does not affect its error:
 *   E^2 = 1/(2 n) sum_i (|dx_i|^2/L^2 + |dv_i|^2/U^2)
 * over its n free particles, without masses, so that errors of light particles count as those of
 * heavy ones. On several ranks all have the same norm, of the bodies of the scene. */
#ifndef MS_NORM_H
#define MS_NORM_H

#include "physics/model.h"

typedef struct ms_norm_body {
  int32_t n;     /* free particles */
  double extent; /* L, m: longest side of the body's bounding box at the start; if 0, U T + g T^2/2,
                    U without g L */
  double speed;  /* U, m/s: U^2 = mean of |v_i|^2 + g L at the start, |v_i|^2 increased as if each
                    spring gave its energy to its ends; if 0, L/T */
  double rounding;  /* rounding error of x and v, in this norm */
  double square[2]; /* E^2 of two estimates: scratch */
} ms_norm_body;

typedef struct ms_norm {
  int32_t n;                 /* bodies; 0: no particle is free */
  ms_norm_body *body;        /* n */
  int32_t *body_of;          /* nfree: the body of each unknown */
  struct ms_norm_sums *sums; /* n: scratch */
  struct ms_norm_sums *most; /* n: scratch of several ranks; NULL: one process */
} ms_norm;

/* Where ranks share the scene the norm is complete once it is connected, which is collective, with
 * the same status on all ranks. */
msim_status ms_norm_create(const ms_model *model, ms_norm *norm, msim_error *err);
msim_status ms_norm_connect(const ms_model *model, ms_norm *norm, msim_error *err);
void ms_norm_destroy(const ms_model *model, ms_norm *norm);

/* The scales of all bodies in the state x, v, for a run of length T = span (s); collective. */
void ms_norm_measure_scales(const ms_model *model, const double *x, const double *v, double span,
                            ms_norm *norm);

/* square[which] of each body = E^2 of the errors dx, dv; collective */
void ms_norm_square_errors(const ms_norm *norm, ms_shape shape, int which, const double *dx,
                           const double *dv);

/* The smallest extent, speed and rounding, each over all bodies; 0 if there is none. */
ms_norm_body ms_norm_find_smallest(const ms_norm *norm);

#endif
