/* control - error estimates and step-size control
 *
 * Error control keeps the error that a step adds below tol times its share of the run:
 *   E <= tol h/T,   E^2 = 1/(2 n) sum_i (|dx_i|^2/L^2 + |dv_i|^2/U^2)
 * for each connected part of the scene, with its n free particles, extent L and speed U
 * (physics/norm.h), and T the length of the run; the part with the largest error decides. So the
 * error at the end is about proportional to tol, by a factor that depends on the scene. A step may
 * use up to 3 shares where the steps before it, since the last impact, have left 5 shares more than
 * that: the sum of all E still is at most tol, and steps that stability limits, whose error
 * fluctuates, are rarely rejected.
 *
 * A step with an impact ends there: by dense output of the method, if that is accurate enough, or
 * else it is made anew. The particles bounce at the start of the next step.
 *
 * Where a particle on a plane is lifted, slips, stops or turns, forces have a kink. A step rejected
 * for that is divided: into one before the kink, a short one across it, and one as long as before.
 * A search by ever shorter steps, which then lengthen again, took up to three times as many. */
#ifndef MS_CONTROL_H
#define MS_CONTROL_H

#include "base/archive.h"
#include "integrate/integrator.h"
#include "physics/norm.h"
#include "physics/scales.h"

/* 1: the method has its own error estimate, or is a one-step method, for step doubling. */
int ms_control_is_supported(const ms_integrator *integrator);

/* The relative error of the step just made, from x to x_next, without reflection: the largest
 * E/max(allowed, rounding) of all connected parts; NaN if an estimate is. E is the method's own
 * estimate or Richardson's, (half - whole)/(2^p - 1), with two half steps in x_next, v_next and a
 * whole one in the second spare pair. Overwrites the first spare pair. dop853 combines the squares
 * of two estimates, E^2 = fine^2/(fine + coarse/100) (Hairer, Norsett and Wanner I, II.10). */
double ms_control_error(const ms_integrator *integrator, ms_stepper *s, const ms_norm *norm,
                        double allowed);

/* After ms_control_error(): the unknown with the largest error of its velocity. */
int32_t ms_control_find_offender(const ms_integrator *integrator, ms_stepper *s);

typedef struct ms_control {
  double tol, span; /* span: T, s */
  double order;     /* k: E/h is proportional to h^k */
  double h;         /* s: the step to try next */
  double growth;    /* largest ratio of a step to the one before */
  double safety;    /* ratio of a step to the longest one that the error allows */
  int limited;      /* 1: stability limits h, too */
  double previous;  /* relative error of the last accepted step, at least 1e-4; 0: unknown */
  double unused;    /* s: the sum of (1 - r) h since ms_control_reset(), r relative errors */
  double crossing;  /* s: the next step, while this one is to end before a change; else 0 */
  double usual;     /* s: the step after a change, as long as those before it; 0: none */
  int shrunk;       /* the last attempt was rejected */
} ms_control;

ms_control ms_control_make(const ms_integrator *integrator, double tol, double span);

/* The error that a step of h may add, if rounding is below it: tol h/T */
double ms_control_allowed_error(const ms_control *c, double h);

/* The first step to try in a scene, if the options name none */
double ms_control_first_step(const ms_control *c, const ms_scales *scales);

/* The step to try with `left` seconds of the run to go: the last one or two steps are shortened to
 * end with the run, so that no much shorter one remains. */
double ms_control_next_step(const ms_control *c, double left);

/* 1: the step of h, with the relative error r, is accepted: r <= 1, or r <= 3 where steps before it
 * have left enough. Sets the next step to try by a PI controller (Gustafsson 1991; Hairer and
 * Wanner, Solving ODEs II, IV.2). change: the share of the step before a contact changes, or
 * MS_NOWHERE: of a rejected step the parts before and after the change are made as steps. */
int ms_control_update(ms_control *c, double h, double r, double change);

/* The step that the error r of the last one alone would ask for, over the last one: s r^(-1/k), s
 * the safety factor; 1 if r is unknown */
double ms_control_expected_change(const ms_control *c);

/* The step of h failed: sets the next one to try. */
void ms_control_reject_failed(ms_control *c, double h);

/* A step under error control: it is attempted until its error is small enough, then it ends at its
 * first impact, if any, by dense output or made anew; the controller goes on as after the whole
 * step. */
typedef struct ms_attempt {
  double t, left;      /* s: the time at its start; its largest length */
  double planned;      /* s: the controller's step at the start or the last rejection */
  double h;            /* s: the length to try now */
  int times_shortened; /* how often it was shortened to an impact since the last rejection */
} ms_attempt;

typedef enum ms_verdict { MS_ACCEPTED, MS_SHORTENED, MS_TRY_AGAIN, MS_TOO_SHORT } ms_verdict;

ms_attempt ms_control_begin_attempt(const ms_control *c, double t, double left);

/* 1: a step with the first impact after that share of it, or MS_NOWHERE, is to end there. */
int ms_control_is_shortened(double impact);

/* What an attempt has shown. amplification: by which the impact amplifies errors; INFINITY: dense
 * output does not show the state there */
typedef struct ms_attempt_result {
  msim_status status;
  double error;  /* the relative one; NaN: not known, which no step needs that is shortened */
  double impact; /* the share of the step before the first impact, or MS_NOWHERE */
  double amplification;
  double change; /* the share before the first change of a contact, or MS_NOWHERE */
} ms_attempt_result;

/* Accepts or rejects the step of a->h just made, and sets the next a->h. MS_SHORTENED: the step is
 * accepted up to the impact, and ends at a->h. MS_TOO_SHORT: the next step would be lost in the
 * rounding of t. */
ms_verdict ms_control_judge_attempt(ms_control *c, ms_attempt *a, const ms_attempt_result *of);

/* Discards the errors of the steps before, as after an impact. */
void ms_control_reset(ms_control *c);

/* Passes all members to or from an archive (archive.h). */
void ms_control_archive(ms_archive *bytes, ms_control *c);

#endif
