/* control - the error of a step, and the step that keeps it small enough
 *
 * Error control keeps what a step adds to the error below tol times the step's share of the run:
 *   E <= tol h/T,   E^2 = 1/(2 n) sum_i (|dx_i|^2/L^2 + |dv_i|^2/U^2)
 * for each connected part of the scene, with its extent L and speed U (physics/norm.h) and the
 * length of the run T; the part with the largest error decides. So a tenth of tol makes about a
 * tenth of the error at the end; how much of it grows or fades on the way is up to the scene.
 *
 * A step that meets a plane is made anew to end at the impact, where particles bounce at the start
 * of the next one. */
#ifndef MS_CONTROL_H
#define MS_CONTROL_H

#include "base/bytes.h"
#include "integrate/integrator.h"
#include "physics/norm.h"
#include "physics/scales.h"

/* 1: the method has an estimate of its own, or is one whose steps may be halved. */
int ms_has_control(const ms_integrator *integrator);

/* The error of the step just made, from x to x_next, without reflection: the largest E of a part
 * over what it may add, max(allowed, rounding). By the method's own estimate, or by Richardson's,
 * of two half steps against a whole one that lies in the second spare pair,
 * (half - whole)/(2^p - 1). The first spare pair is used up. dop853 has two estimates, and makes
 * one of them: E^2 = fine^2/(fine + coarse/100), of squares (Hairer, Norsett and Wanner II.10). */
double ms_error_of(const ms_integrator *integrator, ms_stepper *s, const ms_norm *norm,
                   double allowed);

/* After that, the row whose velocity is farthest off. */
int32_t ms_error_culprit(const ms_integrator *integrator, ms_stepper *s);

typedef struct ms_control {
  double tol, span; /* span: T, s */
  double order;     /* k: E/h goes like h^k */
  double h;         /* s: the step to try next */
  double growth;    /* of a step over the one before, at most */
  double safety;    /* the share that is taken of the longest step that the error allows */
  double previous;  /* E T/(tol h) of the last step accepted; 0: not known */
  int shrunk;       /* the last attempt was too long */
} ms_control;

ms_control ms_control_of(const ms_integrator *integrator, double tol, double span);

/* What a step may add to the error of a part, where rounding is below that. */
double ms_control_allowed(const ms_control *c, double h);

/* A first step for the scene, where nobody named one. */
double ms_control_first(const ms_control *c, const ms_scales *scales);

/* The step to try where so much of the run is left (s): one or two before the end are made to meet
 * it, so that no sliver remains. */
double ms_control_next(const ms_control *c, double left);

/* Was the step of h good enough, with r = E over what is allowed? And the next one to try, by a
 * proportional and integral controller (Gustafsson 1991; Hairer and Wanner, Solving ODEs II, IV.2).
 */
int ms_control_accepts(ms_control *c, double h, double r);

/* The step of h could not be made. */
void ms_control_fail(ms_control *c, double h);

/* A step under error control is attempted until its error is small enough, then made anew to end at
 * its first impact, if it has one; the controller goes on as after the whole step. */
typedef struct ms_attempt {
  double t, left; /* s: the time at its start; its length at most */
  double planned; /* s: the length that was to be tried after the last rejection */
  double h;       /* s: the length to try now */
  int cuts;       /* at impacts, since the last rejection */
} ms_attempt;

typedef enum ms_verdict { MS_ACCEPTED, MS_TRY_AGAIN, MS_TOO_SHORT } ms_verdict;

ms_attempt ms_control_begin(const ms_control *c, double t, double left);

/* The verdict on the step of a->h just made, and the next a->h. error: over what is allowed;
 * impact: the first, as a share of the step, or MS_NOWHERE. MS_TOO_SHORT: no shorter step could be
 * told from none. */
ms_verdict ms_control_judge(ms_control *c, ms_attempt *a, msim_status status, double error,
                            double impact);

/* What is to come has little to do with the step before. */
void ms_control_forget(ms_control *c);

/* All of it. */
void ms_control_history(ms_bytes *bytes, ms_control *c);

#endif
