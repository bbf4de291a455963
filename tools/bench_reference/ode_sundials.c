/* sundials - CVODE and ARKODE on the forces of msim, for `msim_bench precision`
 *
 * Only the final state is requested. Errors are weighted by the scene's own scales, so that a
 * tolerance means the same for all. Implicit methods use GMRES without a matrix or preconditioner;
 * J v is the library's difference quotient, at the cost of one evaluation. IMEX methods treat the
 * stiff part of the forces implicitly and the others explicitly. MRIStep, which in SUNDIALS 6 takes
 * fixed slow steps only, makes a fixed number of explicit fast steps for the stiff part in each. */
#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <arkode/arkode_mristep.h>
#include <cvode/cvode.h>
#include <math.h>
#include <string.h>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "ode.h"
#include "vectors.h"

#if SUNDIALS_VERSION_MAJOR < 7
#  define SUN_COMM_NULL NULL
#endif

enum { CVODE, EXPLICIT, IMPLICIT, IMEX, MULTIRATE };

static const struct sundials_method {
  ode_method info;
  int kind;
  int order; /* of CVODE: CV_ADAMS or CV_BDF, with variable order */
  int table; /* of EXPLICIT, 0: the default of the order; of MULTIRATE: for the fast steps */
  int fast;  /* of MULTIRATE: fast steps per slow step */
} methods[] = {
    {{"CVODE Adams", 0, 0}, CVODE, CV_ADAMS, 0, 0},
    {{"CVODE BDF", 0, 0}, CVODE, CV_BDF, 0, 0},
    {{"ARKODE ERK 4", 0, 0}, EXPLICIT, 4, 0, 0},
    {{"ARKODE ERK 5", 0, 0}, EXPLICIT, 5, 0, 0},
    {{"ARKODE Dormand-Prince", 0, 0}, EXPLICIT, 5, ARKODE_DORMAND_PRINCE_7_4_5, 0},
    {{"ARKODE ERK 8", 0, 0}, EXPLICIT, 8, 0, 0},
    {{"ARKODE DIRK 4", 0, 0}, IMPLICIT, 4, 0, 0},
    {{"ARKODE IMEX 3", SPLIT_SPRINGS | SPLIT_DAMPING, 0}, IMEX, 3, 0, 0},
    {{"ARKODE IMEX 4", SPLIT_SPRINGS | SPLIT_DAMPING, 0}, IMEX, 4, 0, 0},
    {{"ARKODE MRI 3, 12 fast", SPLIT_SPRINGS, 1}, MULTIRATE, 3, ARKODE_KNOTH_WOLKE_3_3, 12},
    {{"ARKODE MRI 3, 36 fast", SPLIT_SPRINGS, 1}, MULTIRATE, 3, ARKODE_KNOTH_WOLKE_3_3, 36},
    {{"ARKODE MRI 4, 15 fast", SPLIT_SPRINGS, 1}, MULTIRATE, 4, ARKODE_ZONNEVELD_5_3_4, 15},
    {{"ARKODE MRI 4, 45 fast", SPLIT_SPRINGS, 1}, MULTIRATE, 4, ARKODE_ZONNEVELD_5_3_4, 45},
};
enum { METHODS = sizeof methods / sizeof *methods };

typedef struct sundials_run {
  const ode_problem *problem;
  double setting; /* tol, or the length of slow steps, s */
  SUNContext context;
  N_Vector y; /* x, then v */
  SUNNonlinearSolver iteration;
  SUNLinearSolver gmres;
  void *integrator, *fast;     /* fast: integrator of the fast steps */
  MRIStepInnerStepper stepper; /* adapter of `fast` for MRIStep */
} sundials_run;

/*------------------------------------- what the methods call ------------------------------------*/

/* moves: 1 if x' = v belongs to this part, else x' = 0 */
static int derive(const sundials_run *r, int part, int moves, N_Vector y, N_Vector to) {
  const ode_problem *p = r->problem;
  const double *x = value_of(y), *v = x + p->n;
  double *dx = value_of(to), *dv = dx + p->n;
  if (!p->force(p->data, part, x, v, dv)) return -1;
  if (moves) memcpy(dx, v, p->n * sizeof *dx);
  else memset(dx, 0, p->n * sizeof *dx);
  multiply(p->n, p->inverse, dv);
  return 0;
}

static int derivative(double t, N_Vector y, N_Vector to, void *data) {
  (void)t;
  return derive(data, ALL_FORCES, 1, y, to);
}

static int stiff_part(double t, N_Vector y, N_Vector to, void *data) {
  const sundials_run *r = data;
  (void)t;
  return derive(r, STIFF_FORCES, r->problem->split == SPLIT_SPRINGS, y, to);
}

static int other_part(double t, N_Vector y, N_Vector to, void *data) {
  const sundials_run *r = data;
  (void)t;
  return derive(r, OTHER_FORCES, r->problem->split != SPLIT_SPRINGS, y, to);
}

static int weigh(N_Vector y, N_Vector weights, void *data) {
  const sundials_run *r = data;
  const size_t n = r->problem->n;
  for (int part = 0; part < 2; part++) {
    const double weight = 1 / (r->setting * r->problem->scales[part]);
    double *w = value_of(weights) + (size_t)part * n;
    for (size_t i = 0; i < n; i++) w[i] = weight;
  }
  (void)y;
  return 0;
}

#if SUNDIALS_VERSION_MAJOR < 7
static void ignore_error_message(int code, const char *module, const char *function, char *text,
                                 void *data) {
  (void)code, (void)module, (void)function, (void)text, (void)data;
}
#  define SILENCE(Prefix, integrator) \
    Prefix##SetErrHandlerFn(integrator, ignore_error_message, NULL)
#else
#  define SILENCE(Prefix, integrator) 0
#endif

/*------------------------------------- the methods ----------------------------------------------*/

/* Calls that all integrators have under different prefixes; the result is 0 or a status. */
#define PREPARE(Prefix, integrator, r)                                  \
  (SILENCE(Prefix, integrator) || Prefix##SetUserData(integrator, r) || \
   Prefix##WFtolerances(integrator, weigh) || Prefix##SetMaxNumSteps(integrator, -1))
#define PREPARE_TO_END(Prefix, r) \
  (PREPARE(Prefix, (r)->integrator, r) || Prefix##SetStopTime((r)->integrator, (r)->problem->t_end))

static int make_gmres(sundials_run *r) {
  enum { LONGEST = 30 }; /* iterations; more than any of these systems needs */
  r->gmres = SUNLinSol_SPGMR(r->y, SUN_PREC_NONE, LONGEST, r->context);
  return r->gmres ? 0 : -1;
}

static int run_cvode(sundials_run *r, const struct sundials_method *m) {
  double t;
  r->integrator = CVodeCreate(m->order, r->context);
  if (!r->integrator || CVodeInit(r->integrator, derivative, 0, r->y) || PREPARE_TO_END(CVode, r))
    return -1;
  if (m->order == CV_ADAMS) {
    r->iteration = SUNNonlinSol_FixedPoint(r->y, 0, r->context);
    if (!r->iteration || CVodeSetNonlinearSolver(r->integrator, r->iteration)) return -1;
  } else if (make_gmres(r) || CVodeSetLinearSolver(r->integrator, r->gmres, NULL)) {
    return -1;
  }
  return CVode(r->integrator, r->problem->t_end, r->y, &t, CV_NORMAL);
}

static int run_explicit(sundials_run *r, const struct sundials_method *m) {
  double t;
  r->integrator = ERKStepCreate(derivative, 0, r->y, r->context);
  if (!r->integrator || PREPARE_TO_END(ERKStep, r)) return -1;
  if (m->table == 0 ? ERKStepSetOrder(r->integrator, m->order)
                    : ERKStepSetTableNum(r->integrator, (ARKODE_ERKTableID)m->table))
    return -1;
  return ERKStepEvolve(r->integrator, r->problem->t_end, r->y, &t, ARK_NORMAL);
}

static int run_implicit(sundials_run *r, const struct sundials_method *m) {
  const int is_split = m->kind == IMEX;
  double t;
  r->integrator = ARKStepCreate(is_split ? other_part : NULL, is_split ? stiff_part : derivative, 0,
                                r->y, r->context);
  if (!r->integrator || PREPARE_TO_END(ARKStep, r) || ARKStepSetOrder(r->integrator, m->order) ||
      make_gmres(r) || ARKStepSetLinearSolver(r->integrator, r->gmres, NULL) ||
      ARKStepSetDeduceImplicitRhs(r->integrator, SUNTRUE))
    return -1;
  return ARKStepEvolve(r->integrator, r->problem->t_end, r->y, &t, ARK_NORMAL);
}

static int make_fast(sundials_run *r, const struct sundials_method *m, double h) {
  r->fast = ARKStepCreate(stiff_part, NULL, 0, r->y, r->context);
  if (!r->fast || PREPARE(ARKStep, r->fast, r) ||
      ARKStepSetTableNum(r->fast, ARKODE_DIRK_NONE, (ARKODE_ERKTableID)m->table) ||
      ARKStepSetFixedStep(r->fast, h))
    return -1;
  return ARKStepCreateMRIStepInnerStepper(r->fast, &r->stepper);
}

static int run_multirate(sundials_run *r, const struct sundials_method *m) {
  const double end = r->problem->t_end, h = end / ceil(end / r->setting * (1 - 1e-12));
  double t;
  if (make_fast(r, m, h / m->fast)) return -1;
  r->integrator = MRIStepCreate(other_part, NULL, 0, r->y, r->stepper, r->context);
  if (!r->integrator || PREPARE_TO_END(MRIStep, r) || MRIStepSetOrder(r->integrator, m->order) ||
      MRIStepSetFixedStep(r->integrator, h))
    return -1;
  return MRIStepEvolve(r->integrator, end, r->y, &t, ARK_NORMAL);
}

static void free_sundials_run(sundials_run *r, int kind) {
  if (r->integrator && kind == CVODE) CVodeFree(&r->integrator);
  if (r->integrator && kind == EXPLICIT) ERKStepFree(&r->integrator);
  if (r->integrator && (kind == IMPLICIT || kind == IMEX)) ARKStepFree(&r->integrator);
  if (r->integrator && kind == MULTIRATE) MRIStepFree(&r->integrator);
  if (r->stepper) MRIStepInnerStepper_Free(&r->stepper);
  if (r->fast) ARKStepFree(&r->fast);
  if (r->iteration) SUNNonlinSolFree(r->iteration);
  if (r->gmres) SUNLinSolFree(r->gmres);
  if (r->y) N_VDestroy(r->y);
  if (r->context) SUNContext_Free(&r->context);
}

static int solve_with_sundials(int i, const ode_problem *p, double setting, double *x, double *v) {
  static int (*const runs[])(sundials_run *, const struct sundials_method *) = {
      [CVODE] = run_cvode,
      [EXPLICIT] = run_explicit,
      [IMPLICIT] = run_implicit,
      [IMEX] = run_implicit,
      [MULTIRATE] = run_multirate};
  const size_t bytes = p->n * sizeof(double);
  sundials_run r = {.problem = p, .setting = setting};
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
  free_sundials_run(&r, methods[i].kind);
  return status > 0 ? 0 : status; /* > 0: stopped at t_end, as requested */
}

static const ode_method *info(int i) { return i >= 0 && i < METHODS ? &methods[i].info : NULL; }

__attribute__((visibility("default"))) const ode_methods msim_bench_ode = {
    .library = "SUNDIALS " SUNDIALS_VERSION, .info = info, .solve = solve_with_sundials};
