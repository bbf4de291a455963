/* force_function - the force that the program computes (msim_force_function), for one island */
#ifndef MS_FORCE_FUNCTION_H
#define MS_FORCE_FUNCTION_H

#include "physics/model.h"

typedef struct ms_force_function {
  int32_t n;               /* free particles of the island */
  int32_t *particle, *row; /* n, in ascending order of particles, and their rows */
  double *x, *v, *f;       /* 3n: of the last call */
  double *dfdx, *dfdv;     /* 9n: of ms_force_function_linearize; NULL: there is no Jacobian */
  double *force;           /* a vector: model->force + f, of the last call */
  msim_status status;      /* of calls since it was cleared; after a failure none is made */
  int32_t code;            /* MSIM_FORCE_FAILED: what `evaluate` returned */
  int32_t offender;        /* MSIM_NOT_FINITE: index of the particle */
} ms_force_function;

/* *function: NULL if the scene has none, or the model no free particle */
msim_status ms_force_function_create(const ms_model *model, ms_force_function **function,
                                     msim_error *err);
void ms_force_function_destroy(const ms_scene *scene, ms_force_function *function);

/* These need model->function. */

/* function->force at t in the state x, v; model->force alone after a failure. v: only with
 * MSIM_FORCE_VELOCITY */
void ms_force_function_evaluate(const ms_model *model, double t, const double *x, const double *v);

/* dfdx and dfdv at t in the state x, v, for the matrix; nothing without a Jacobian */
void ms_force_function_linearize(const ms_model *model, double t, const double *x, const double *v);

/* b += by dfdx v, with the last linearization */
void ms_force_function_add_gradient(const ms_model *model, double by, const double *v, double *b);

/* The power of the force evaluated last at velocities v, W */
double ms_force_function_compute_power(const ms_model *model, const double *v);

/* 1: its work is to be integrated, as it has no potential. */
static inline int ms_force_function_does_work(const ms_model *model) {
  return model->function && !model->scene->force_function.potential;
}

/* The potential energy of the island in the state x, J; 0 without a potential */
double ms_force_function_compute_potential(const ms_model *model, const double *x);

/* Set the message of function->status. Returns it; *row: of the offending particle, or -1 */
msim_status ms_force_function_report(const ms_model *model, int32_t *row, msim_error *err);

#endif
