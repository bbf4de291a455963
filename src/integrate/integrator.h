/* integrator - a time integration method is one const table in one file */
#ifndef MS_INTEGRATOR_H
#define MS_INTEGRATOR_H

#include "linear/solver.h"
#include "physics/bernstein.h"
#include "physics/bounds.h"
#include "physics/step.h"

enum { MS_MAX_WORK = 16 };

/* What a method sees. A step reads x, v and writes x_next, v_next; the driver accepts it by
 * swapping the pointers, so that a step refused costs nothing.
 *
 * Force kernels want the pinned rows right: in x and x_next they hold the pinned positions, in v,
 * v_next and every work vector they are 0. So stages
 * keep their positions in x_next. The spare pairs are as x and v. */
typedef struct ms_stepper {
  const ms_model *model;
  const msim_options *opt;
  ms_solver *solver; /* NULL where the method needs none */
  double *x, *v;
  double *x_next, *v_next;
  double *work[MS_MAX_WORK]; /* nwork vectors */
  double *scratch;           /* holds nothing between calls */
  int warm, warm_next;       /* the method's own note, as on what its work vectors hold: 0, none.
                                As with x, a step reads warm and writes warm_next */
  double h;                  /* of the step to be made; start() may rely on it, and who looks
                                between the ends of a step finds that of the last one */
  double h_before;           /* of the step that led to the present state, or its last part */
  int64_t parts;             /* of the step being made */
  ms_bounds bounds;          /* of the island, where the method has stages() */
  double *x_spare[2];        /* where errors are controlled, or steps retried, for the driver */
  double *v_spare[2];
  int one_part;           /* a step is not cut at its first impact, but tells where that is */
  double impact;          /* ... the share of the step; beyond 1: nowhere */
  double x_tolerance;     /* m: under error control, what an event may add to the error of x */
  double v_tolerance;     /* m/s: ... of v */
  double path_error;      /* m/s: the largest of v, of particles on paths of their own (locate.h) */
  int32_t path_row;       /* which has it */
  int32_t npaths;         /* how many there were in all parts of the step */
  int looked;             /* what is kept for those who look inside the last step; 0: nothing */
  double noise;           /* relative error of v that solves may leave; 0: as options say */
  int32_t culprit;        /* row to blame when step() fails; -1: none in particular */
  struct ms_split *split; /* NULL where the method needs none, or where none pays */
  int finite;             /* 1: no number of x_next and v_next is NaN or huge; 0: unknown */
  msim_stats *stats;
  struct ms_events *events; /* of collision = event, where there are planes; NULL: none of that */
} ms_stepper;

typedef struct ms_integrator {
  msim_integrator_entry entry; /* order: a test measures it and compares */
  int nonlinear;               /* a step solves a nonlinear equation, by Newton's method */
  int separable; /* needs forces that do not depend on velocities: no damping, no drag */
  int splits;    /* keeps stiff springs apart: stepper.split, which belongs to h and the springs */
  int replays;   /* handles impacts and contact itself, under collision = event (replay.h) */
  int one_step;  /* a step depends on x and v alone, so that two halves tell its error */
  int32_t nwork;
  int32_t carried, carried_at; /* work vectors that steps to come read: so many, where warm = 1 + k
                                  from number carried_at + k carried on. 0: none */
  /* From x and the velocity at t in v to the velocity that the method carries; called with warm = 0
   * at the start and after a state was set. Nullable. */
  void (*start)(ms_stepper *s);
  /* One step of s->h. */
  msim_status (*step)(ms_stepper *s, msim_error *err);
  /* The longest h with which every mode within the bounds stays bounded: a scene has many, and
   * which pairs of frequency and damping it has changes as it moves. 0: none does; INFINITY: any
   * h. NULL: any h is stable where forces are linear, or the method splits. */
  double (*limit)(const ms_bounds *b);
  /* Evaluations in a step, where h decides that. Nullable. */
  int32_t (*stages)(double h, ms_bounds bounds);
  /* The error of the step just made, from x to x_next before any reflection, by the method's own
   * estimates: which = 0, the finer; 1, a coarser, where there are two. Nullable. */
  void (*estimate)(ms_stepper *s, int which, double *dx, double *dv);
  int two_estimates; /* which together go like h^order; one alone goes like h^(order + 1) */
  int chooses_steps; /* by a tol of its own, unless `steps` is given */
  double growth;     /* under control, of a step over the one before, at most; 0: the usual */
  double safety;     /* the same, of the longest step that the error allows; 0: the usual share */
  /* The state a share theta into the step that was accepted last; see interpolate.h. Nullable: by
   * cubics. */
  void (*interpolate)(ms_stepper *s, double theta, double *x, double *v);
  /* One entry of x over the step just made and not accepted, under collision = event. Nullable: by
   * cubics. */
  void (*path)(ms_stepper *s, size_t at, ms_bernstein *to);
  /* x and v at t, where the method carries other variables, which belong to h. Nullable. */
  void (*show)(const ms_stepper *s, double *x, double *v);
  /* v = the velocity at t, where the method carries another one. Nullable: it carries v(t). */
  void (*sync)(const ms_stepper *s, double *v, double *scratch);
} ms_integrator;

/* Vectors are never copied to be kept: they change names. */
static inline void ms_swap(double **a, double **b) {
  double *between = *a;
  *a = *b, *b = between;
}

/* What its stages follow from, where the method or the springs are others than before. */
void ms_bound_stages(const ms_integrator *method, ms_stepper *s);

/* Let a vector of the method's own take stages in turn with x_next: forces want its pinned rows. */
void ms_hold_stages(const ms_stepper *s, double *stage);

/* One evaluation of forces and what the step makes of it, counted and timed. */
void ms_evaluate(ms_stepper *s, const ms_pass *pass);

/* The same of a model with some of the springs */
void ms_evaluate_on(ms_stepper *s, const ms_model *model, const ms_pass *pass);

/* v_next = v + h a(x, v),  x_next = x + h v_next */
ms_pass ms_kick_drift(const ms_stepper *s);

/* a = F(x, v)/m, counted and timed. */
void ms_acceleration(ms_stepper *s, const double *x, const double *v, double *a);

/* Reflect x, v at the planes, where there are any; how many particles were. Under collision = event
 * nothing is reflected here. */
int64_t ms_reflect(ms_stepper *s, double *x, double *v);

/* 1 where particles rest on planes, which then push in every evaluation, against v too. */
int ms_rests(const ms_stepper *s);
/* ... and hold rows of the matrix */
void ms_hold_rows(ms_stepper *s, ms_request *request);

/* No force depends on velocities. */
int ms_is_separable(const ms_stepper *s);

/* The i-th method of this version; NULL past the end. */
const ms_integrator *ms_integrator_at(int32_t i);

/* That one of them is to be chosen */
#define MS_AUTO "auto"

/* By name */
msim_status ms_integrator_find(const char *name, const ms_integrator **integrator, msim_error *err);

#endif
