/* cg - conjugate gradients (Hestenes and Stiefel 1952) with any preconditioner, matrix-free */
#ifndef MS_CG_H
#define MS_CG_H

#include "linear/linear.h"

/* z = B r, B ~ A^-1 symmetric positive definite */
typedef msim_status ms_cg_preconditioner(void *data, const double *r, double *z);

typedef struct ms_cg {
  double *r, *z, *p, *q; /* residual, preconditioned residual, direction, A p */
} ms_cg;

msim_status ms_cg_create(const ms_model *model, ms_cg *cg, msim_error *err);
void ms_cg_destroy(const ms_model *model, ms_cg *cg);

/* A y = b; y: 0 on input, the solution on output. MSIM_OK: the true residual ||b - A y|| has
 * reached the target or stagnates, which the caller must check. MSIM_NOT_SPD: a search direction
 * has p.A p <= 0. */
msim_status ms_cg_solve(const ms_cg *cg, const ms_linear_system *system,
                        ms_cg_preconditioner *precondition, void *data,
                        const ms_linear_target *target, const double *b, double *y,
                        int64_t *iterations, double *residual);

#endif
