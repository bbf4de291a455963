/* integrator - the interface of time integration methods, and the state that steps work on */
#ifndef MS_INTEGRATOR_H
#define MS_INTEGRATOR_H

#include "linear/solver.h"
#include "physics/bernstein.h"
#include "physics/bounds.h"
#include "physics/fused_step.h"

enum { MS_MAX_WORK = 16 };

/* The state and the work vectors of a method in one island. A step reads x, v and writes x_next,
 * v_next; the driver accepts it by swapping the pointers, so that a rejected step costs nothing.
 *
 * Force sweeps read the entries of pinned particles: x and x_next have the pinned positions; v,
 * v_next and work vectors are 0 there. So stages keep their positions in x_next. The spare pairs
 * are as x and v. Before a sweep the entries of particles with a motion are set to those at
 * t + c h; the method sets c, which is 0 at the start of a step. */
typedef struct ms_stepper {
  const ms_model *model;
  const msim_options *opt;
  ms_solver *solver; /* NULL: the method needs none */
  double *x, *v;
  double *x_next, *v_next;
  double *work[MS_MAX_WORK]; /* nwork vectors */
  double *scratch;           /* holds nothing between calls */
  /* cached-stage tag: which work vectors hold results for the present state; 0: none. A step reads
   * cached_stage and writes cached_stage_next */
  int cached_stage, cached_stage_next;
  double h;            /* of the step to be made, or, for dense output, of the last one */
  double t;            /* at the start of that step; where pinned particles or colliders move */
  double c;            /* the next force sweep is at t + c h */
  double work_in_step; /* of moving pins on springs, moving colliders and a force function, in the
                          step, J */
  double h_before;     /* of the step that led to the present state, or its last substep */
  int64_t parts;       /* substeps of equal length in the step being made */
  int64_t part;        /* the one being made, from 0 */
  ms_bounds bounds;    /* of the island, if the method or obstacles need them */
  double *x_spare[2];  /* for the driver, under error control or if steps may be retried */
  double *v_spare[2];
  int one_substep;        /* 1: the step is not divided at impacts, but sets `impact` */
  double impact;          /* the share of the step before its first impact; > 1: no impact */
  double change;          /* the same before the first change of a contact; > 1: none */
  double impact_speed;    /* m/s: that of the particle towards the plane */
  int32_t impact_row;     /* its unknown */
  double x_tolerance;     /* m: under error control, the error of x that an event may add */
  double v_tolerance;     /* m/s: ... of v */
  double path_tolerance;  /* m: ... that the turning of curved surfaces may add in the step */
  double path_error;      /* m/s: the largest error of v on particle paths (impact_location.h) */
  int32_t path_row;       /* the unknown with that error */
  int32_t npaths;         /* number of particle paths in all substeps of the step */
  int dense_output;       /* what dense output of the last step is available; 0: none yet */
  double h_made;          /* s: dense output is that of a step so long, of which the last one is the
                             beginning; its end is in the second spare pair. 0: of the last step */
  double solve_tolerance; /* relative error of v that solves may leave; 0: that of the options */
  int32_t offender;       /* the offending unknown if step() fails; -1: none in particular */
  struct ms_multirate *split; /* NULL: the method needs none, or none is cost-effective */
  int incomplete; /* 1: in this step iterations ended at their limit, and incomplete = accept */
  int finite; /* 1: no number of x_next and v_next is NaN or beyond MS_LARGEST_VALID; 0: unknown */
  msim_stats *stats;
  int64_t sweeps;                     /* force sweeps so far; some are timed */
  int64_t paths;                      /* particle paths computed so far */
  struct ms_contact_log *contact_log; /* of the step being made; NULL: contacts are not recorded */
  /* for collision = event in scenes with planes or colliders; for implicit methods also for
   * collision = reflect in scenes with colliders (events.h); else NULL */
  struct ms_contact_set *events;
} ms_stepper;

typedef struct ms_integrator {
  msim_integrator_entry entry; /* a test measures the order */
  int nonlinear;               /* a step solves a nonlinear equation, by Newton's method */
  int needs_bounds;            /* a step depends on stepper.bounds, as nonlinear ones do */
  int separable;       /* needs forces that do not depend on velocities: no damping, no drag */
  int is_multirate;    /* multirate: uses stepper.split, which depends on h and the springs */
  int counts_work;     /* a step adds the work of moving pins; 0: the trapezoidal rule is enough */
  int handles_contact; /* impacts and contact, under collision = event (verlet_contact.h) */
  int one_step;        /* a step depends on x and v alone: step doubling estimates its error */
  int32_t nwork;
  /* work vectors that later steps read: with cached_stage = 1 + k, `carried` of them from number
   * carried_at + k carried on. carried 0: none */
  int32_t carried, carried_at;
  /* Replaces x, v at t by the variables that the method carries; called with cached_stage = 0 at
   * the start and after a state was set. Nullable. */
  void (*start)(ms_stepper *s);
  /* One step of s->h. Explicit methods return MSIM_OK, others the status of a solve that failed. */
  msim_status (*step)(ms_stepper *s, msim_error *err);
  /* The longest h for which every mode within the bounds stays bounded, with any pair of frequency
   * and damping, as the pairs that occur change with time. 0: none; INFINITY: any. NULL: any h is
   * stable for linear forces, or the method is multirate. */
  double (*limit)(const ms_bounds *b);
  /* Number of force evaluations in a step of h. Nullable: it does not depend on h. */
  int32_t (*stages)(double h, ms_bounds bounds);
  /* The method's own error estimates of the step just made, from x to x_next before reflection:
   * which = 0, the finer; 1, the coarser, if there are two. Nullable. */
  void (*estimate)(ms_stepper *s, int which, double *dx, double *dv);
  int two_estimates; /* 1: two estimates, combined O(h^order); 0: one */
  int low_estimate;  /* 1: the one is O(h^order); 0: O(h^(order + 1)) */
  int chooses_steps; /* by a default tol, unless the option `steps` is given */
  double growth; /* under error control, largest ratio of a step to the one before; 0: default */
  double safety; /* ... ratio of a step to the longest that the error allows; 0: default */
  /* Dense output of the step that was accepted last (interpolate.h). Nullable: cubics. */
  void (*interpolate)(ms_stepper *s, double theta, double *x, double *v);
  /* Dense output of entry `at` of x over the step just made and not yet accepted. Nullable: a
   * quintic. */
  void (*path)(ms_stepper *s, size_t at, ms_bernstein *to);
  /* x and v at t, for a method that carries transformed variables, which depend on h. Nullable. */
  void (*convert_state)(const ms_stepper *s, double *x, double *v);
  /* v = the velocity at t, for a method that carries that of another time. Nullable: v(t). */
  void (*sync)(const ms_stepper *s, double *v, double *scratch);
} ms_integrator;

/* Exchanges two vectors without a copy. */
static inline void ms_stepper_swap(double **a, double **b) {
  double *between = *a;
  *a = *b, *b = between;
}

/* Sets s->bounds, on which the number of stages, extrapolations, the location of impacts and the
 * rounding errors of Newton's method depend, after the method, springs or forces changed. */
void ms_stepper_set_bounds(const ms_integrator *method, ms_stepper *s);

/* Copies the state, pinned particles included, to work vectors that will hold stages, as another
 * method may have left other values there. v: NULL if the method has no stages of velocities */
void ms_stepper_init_stage(const ms_stepper *s, double *x, double *v);

/* work_in_step += weight h times the power of moving pins in x, v at t + c h, v NULL: without
 * damping; and that of the force function at velocities v, as the last force sweep evaluated it */
void ms_stepper_add_work(ms_stepper *s, double weight, const double *x, const double *v);

/* Evaluate the force function at t + c h in x, v for ms_stepper_add_work(), without a sweep. */
void ms_stepper_evaluate_function(ms_stepper *s, const double *x, const double *v);

/* work_in_step += the work of moving pins and of a force function in a step from s->x, v to x_next,
 * v_next, by the trapezoidal rule */
void ms_stepper_add_trapezoidal_work(ms_stepper *s, const double *v);

/* Compute the derivatives of the force function at t + c h in x, v for the next matrix. */
void ms_stepper_linearize(const ms_stepper *s, const double *x, const double *v);

/* A force sweep with the updates of `sweep` and the reactions of planes, counted and timed */
void ms_stepper_evaluate(ms_stepper *s, const ms_fused_step *sweep);

/* A force sweep of `model`, which has some of the springs, without reactions */
void ms_stepper_evaluate_model(ms_stepper *s, const ms_model *model, const ms_fused_step *sweep);

/* The force sweep v_next = v + h a(x, v),  x_next = x + h v_next */
ms_fused_step ms_stepper_kick_drift(const ms_stepper *s);

/* a = F(x, v)/m, with reactions of planes; v NULL: without forces that depend on it */
void ms_stepper_acceleration(ms_stepper *s, const double *x, const double *v, double *a);

/* Reflects x, v, the result of the step, at planes and colliders, but not under collision = event;
 * adds the work of moving colliders; returns the number of particles reflected, on all ranks. */
int64_t ms_stepper_reflect(ms_stepper *s, double *x, double *v);

/* The same for a stage of the step, whose impulses do not act on its result. */
void ms_stepper_reflect_stage(ms_stepper *s, double *x, double *v);

/* Reflects the particles that a step with contacts in its matrix has left inside. Nullable: log */
void ms_stepper_reflect_remaining(ms_stepper *s, struct ms_contact_log *log);

/* 1: particles of any rank are in contact with planes (contact_set.h); forces then depend on v. */
int ms_stepper_has_contacts(const ms_stepper *s);
/* 1: contacts may still reject the step, in which they are asked once. */
int ms_stepper_may_be_rejected(const ms_stepper *s);
/* 1: they do: the step, whose x_next is roughly known, is to be made anew with other contacts, and
 * need not be solved further. Only if it may be rejected; collective */
int ms_stepper_is_rejected(ms_stepper *s);
/* Copies the velocities of these particles from v to v_to: they have those that the contacts
 * prescribe, which solves keep. */
void ms_stepper_copy_contacts(const ms_stepper *s, const double *v, double *v_to);
/* Sets the components of a vector to 0 along which these contacts prescribe the velocity. */
void ms_stepper_remove_constrained(const ms_stepper *s, double *vec);
/* Adds the constraints of these contacts to a linear system. */
void ms_stepper_add_constraints(ms_stepper *s, ms_linear_system_spec *spec);

/* 1: no force depends on velocities. */
int ms_stepper_is_separable(const ms_stepper *s);

#endif
