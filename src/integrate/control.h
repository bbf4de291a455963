/* control - the error of a step, and the step that keeps it small enough
 *
 * Error control keeps what a step adds to the error below tol times the step's share of the run:
 *   E <= tol h/T,   E^2 = 1/(2 m) sum_i m_i (|dx_i|^2/L^2 + |dv_i|^2/U^2)
 * over all free particles, with the scene's extent L and speed U (physics/scales.h) and the length
 * of the run T. So a tenth of tol makes about a tenth of the error at the end; how much of it
 * grows or fades on the way is up to the scene. Sums of squares of islands add.
 *
 * Reflection at the end of a step is off by as much as the step leads into planes. So no step may
 * lead deeper than tol in the same norm: one that lands is shortened to end at the impact. */
#ifndef MS_CONTROL_H
#define MS_CONTROL_H

#include "base/bytes.h"
#include "integrate/integrator.h"
#include "physics/scales.h"

/* Squares of E, summed over some islands. dop853 has two estimates, and makes one of them:
 * E = fine/sqrt(fine + coarse/100) (Hairer, Norsett and Wanner II.10); others have the fine one. */
typedef struct ms_error {
  double fine, coarse;
} ms_error;

/* 1: the method has an estimate of its own, or is one whose steps may be halved. */
int ms_has_control(const ms_integrator *integrator);

/* The error of the step just made, from x to x_next, without reflection: by the method's own
 * estimate, or by Richardson's, of two half steps against a whole one that lies in the second
 * spare pair, (half - whole)/(2^p - 1). The first spare pair is used up. */
ms_error ms_error_of(const ms_integrator *integrator, ms_stepper *s, const ms_scales *scales);

/* E */
double ms_error_size(ms_error error);

/* After that, the row whose velocity is farthest off. */
int32_t ms_error_culprit(const ms_integrator *integrator, ms_stepper *s);

typedef struct ms_control {
  double tol, span; /* span: T, s */
  double order;     /* k: E/h goes like h^k */
  double h;         /* s: the step to try next */
  double growth;    /* of a step over the one before, at most */
  double previous;  /* E T/(tol h) of the last step accepted; 0: not known */
  int shrunk;       /* the last attempt was too long */
} ms_control;

ms_control ms_control_of(const ms_integrator *integrator, double tol, double span);

/* What a step may add. */
double ms_control_limit(const ms_control *c, const ms_scales *scales, double h);

/* A first step for the scene, where nobody named one. */
double ms_control_first(const ms_control *c, const ms_scales *scales);

/* The step to try where so much of the run is left (s): one or two before the end are made to meet
 * it, so that no sliver remains. */
double ms_control_next(const ms_control *c, double left);

/* Was the step of h good enough? And the next one to try, by a proportional and integral controller
 * (Gustafsson 1991; Hairer and Wanner, Solving ODEs II, IV.2). */
int ms_control_accepts(ms_control *c, const ms_scales *scales, double h, ms_error error);

/* The step of h led too deep into planes: by `ratio` times what is allowed, and met the first after
 * a share of a straight way. */
void ms_control_land(ms_control *c, double h, double ratio, double share);

/* The step of h could not be made. */
void ms_control_fail(ms_control *c, double h);

/* What is to come has little to do with the step before. */
void ms_control_forget(ms_control *c);

/* All of it. */
void ms_control_history(ms_bytes *bytes, ms_control *c);

#endif
