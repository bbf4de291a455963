/* sundials - CVODE and ARKODE on the forces of msim, for `msim_bench precision`
 *
 * Nothing is asked for but the end. Errors are weighed by the scene's own scales, so that a
 * tolerance means the same for all. Implicit methods solve by GMRES without a matrix or a
 * preconditioner; its J v is the library's difference quotient, which costs one evaluation, as one
 * of ours would. */
#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <string.h>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "../ode.h"
#include "vectors.h"

#if SUNDIALS_VERSION_MAJOR < 7
#  define SUN_COMM_NULL NULL
#endif

enum { CVODE, EXPLICIT, IMPLICIT };

static const struct method {
  const char *name;
  int kind;
  int order; /* of CVODE: CV_ADAMS or CV_BDF, whose order is chosen in each step */
  int table; /* of EXPLICIT; -1: that of the order */
} methods[] = {
    {"CVODE Adams", CVODE, CV_ADAMS, -1},
    {"CVODE BDF", CVODE, CV_BDF, -1},
    {"ARKODE ERK 4", EXPLICIT, 4, -1},
    {"ARKODE ERK 5", EXPLICIT, 5, -1},
    {"ARKODE Dormand-Prince", EXPLICIT, 5, ARKODE_DORMAND_PRINCE_7_4_5},
    {"ARKODE ERK 8", EXPLICIT, 8, -1},
    {"ARKODE DIRK 4", IMPLICIT, 4, -1},
};
enum { METHODS = sizeof methods / sizeof *methods };

typedef struct run {
  const ode_problem *problem;
  double tol;
  SUNContext context;
  N_Vector y; /* x, then v */
  SUNNonlinearSolver iteration;
  SUNLinearSolver gmres;
  void *integrator;
} run;

/*------------------------------------- what the methods call ------------------------------------*/

static int derivative(double t, N_Vector y, N_Vector to, void *data) {
  const ode_problem *p = ((run *)data)->problem;
  const double *x = value_of(y), *v = x + p->n;
  double *dx = value_of(to), *dv = dx + p->n;
  (void)t;
  if (!p->force(p->data, x, v, dv)) return -1;
  memcpy(dx, v, p->n * sizeof *dx);
  multiply(p->n, p->inverse, dv);
  return 0;
}

static int weigh(N_Vector y, N_Vector weights, void *data) {
  const run *r = data;
  double *w = value_of(weights);
  (void)y;
  for (size_t i = 0; i < 2 * r->problem->n; i++)
    w[i] = 1 / (r->tol * r->problem->scales[i >= r->problem->n]);
  return 0;
}

#if SUNDIALS_VERSION_MAJOR < 7
static void say_nothing(int code, const char *module, const char *function, char *text,
                        void *data) {
  (void)code, (void)module, (void)function, (void)text, (void)data;
}
#  define SILENCE(Prefix, integrator) Prefix##SetErrHandlerFn(integrator, say_nothing, NULL)
#else
#  define SILENCE(Prefix, integrator) 0
#endif

/*------------------------------------- the methods ----------------------------------------------*/

/* What all three have under names of their own; they return 0 or a status. */
#define PREPARE(Prefix, r)                                                                        \
  (SILENCE(Prefix, (r)->integrator) || Prefix##SetUserData((r)->integrator, r) ||                 \
   Prefix##WFtolerances((r)->integrator, weigh) || Prefix##SetMaxNumSteps((r)->integrator, -1) || \
   Prefix##SetStopTime((r)->integrator, (r)->problem->t_end))

static int make_gmres(run *r) {
  enum { LONGEST = 30 }; /* iterations; more than any of these systems needs */
  r->gmres = SUNLinSol_SPGMR(r->y, SUN_PREC_NONE, LONGEST, r->context);
  return r->gmres ? 0 : -1;
}

static int run_cvode(run *r, const struct method *m) {
  double t;
  r->integrator = CVodeCreate(m->order, r->context);
  if (!r->integrator || CVodeInit(r->integrator, derivative, 0, r->y) || PREPARE(CVode, r))
    return -1;
  if (m->order == CV_ADAMS) {
    r->iteration = SUNNonlinSol_FixedPoint(r->y, 0, r->context);
    if (!r->iteration || CVodeSetNonlinearSolver(r->integrator, r->iteration)) return -1;
  } else if (make_gmres(r) || CVodeSetLinearSolver(r->integrator, r->gmres, NULL)) {
    return -1;
  }
  return CVode(r->integrator, r->problem->t_end, r->y, &t, CV_NORMAL);
}

static int run_explicit(run *r, const struct method *m) {
  double t;
  r->integrator = ERKStepCreate(derivative, 0, r->y, r->context);
  if (!r->integrator || PREPARE(ERKStep, r)) return -1;
  if (m->table < 0 ? ERKStepSetOrder(r->integrator, m->order)
                   : ERKStepSetTableNum(r->integrator, (ARKODE_ERKTableID)m->table))
    return -1;
  return ERKStepEvolve(r->integrator, r->problem->t_end, r->y, &t, ARK_NORMAL);
}

static int run_implicit(run *r, const struct method *m) {
  double t;
  r->integrator = ARKStepCreate(NULL, derivative, 0, r->y, r->context);
  if (!r->integrator || PREPARE(ARKStep, r) || ARKStepSetOrder(r->integrator, m->order) ||
      make_gmres(r) || ARKStepSetLinearSolver(r->integrator, r->gmres, NULL) ||
      ARKStepSetDeduceImplicitRhs(r->integrator, SUNTRUE))
    return -1;
  return ARKStepEvolve(r->integrator, r->problem->t_end, r->y, &t, ARK_NORMAL);
}

static void release(run *r, int kind) {
  if (r->integrator && kind == CVODE) CVodeFree(&r->integrator);
  if (r->integrator && kind == EXPLICIT) ERKStepFree(&r->integrator);
  if (r->integrator && kind == IMPLICIT) ARKStepFree(&r->integrator);
  if (r->iteration) SUNNonlinSolFree(r->iteration);
  if (r->gmres) SUNLinSolFree(r->gmres);
  if (r->y) N_VDestroy(r->y);
  if (r->context) SUNContext_Free(&r->context);
}

static int solve(int i, const ode_problem *p, double tol, double *x, double *v) {
  static int (*const runs[])(run *, const struct method *) = {
      [CVODE] = run_cvode, [EXPLICIT] = run_explicit, [IMPLICIT] = run_implicit};
  const size_t bytes = p->n * sizeof(double);
  run r = {.problem = p, .tol = tol};
  int status = SUNContext_Create(SUN_COMM_NULL, &r.context);
  if (!status) r.y = fast_vector(2 * p->n, r.context);
  if (r.y) {
    memcpy(value_of(r.y), p->x, bytes);
    memcpy(value_of(r.y) + p->n, p->v, bytes);
    status = runs[methods[i].kind](&r, &methods[i]);
    memcpy(x, value_of(r.y), bytes);
    memcpy(v, value_of(r.y) + p->n, bytes);
  } else {
    status = -1;
  }
  release(&r, methods[i].kind);
  return status > 0 ? 0 : status; /* > 0: that it stopped where it was asked to */
}

static const char *name(int i) { return i >= 0 && i < METHODS ? methods[i].name : NULL; }

__attribute__((visibility("default"))) const ode_methods msim_bench_ode = {
    .library = "SUNDIALS " SUNDIALS_VERSION, .name = name, .solve = solve};
