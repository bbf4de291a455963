#include "linear/bicgstab.h"

#include <float.h>
#include <math.h>

#include "linear/jacobi.h"

enum { DEGREE = MS_BICGSTAB_DEGREE, VECTORS = 2 * DEGREE + 6 };

static void list_vectors(ms_bicgstab *s, double **vectors[VECTORS]) {
  int n = 0;
  for (int k = 0; k <= DEGREE; k++) vectors[n++] = &s->r[k], vectors[n++] = &s->u[k];
  vectors[n++] = &s->shadow, vectors[n++] = &s->x, vectors[n++] = &s->z, vectors[n++] = &s->w;
}

msim_status ms_bicgstab_create(const ms_model *model, ms_bicgstab *s, msim_error *err) {
  double **vectors[VECTORS];
  list_vectors(s, vectors);
  const int fits = MS_NEW(&model->scene->alloc, s->roots, 6 * (size_t)model->unknowns.nfree) &&
                   ms_unknowns_new_vectors(model->scene, &model->unknowns, VECTORS, vectors);
  return fits ? MSIM_OK : ms_error_set_memory(err, "BiCGStab");
}

void ms_bicgstab_destroy(const ms_model *model, ms_bicgstab *s) {
  double **vectors[VECTORS];
  list_vectors(s, vectors);
  for (int k = 0; k < VECTORS; k++) ms_memory_free(&model->scene->alloc, *vectors[k]);
  ms_memory_free(&model->scene->alloc, s->roots);
  *s = (ms_bicgstab){0};
}

/* State of one solve */
typedef struct bicgstab_run {
  const ms_bicgstab *s;
  const ms_linear_system *system;
  ms_shape shape;
  ms_linear *by; /* the preconditioner */
  double rho, alpha, omega;
  int64_t *iterations, limit;
} bicgstab_run;

static double bicgstab_dot(const bicgstab_run *q, const double *x, const double *y) {
  return ms_vector_dot(q->shape, x, y);
}

/* z = B L v */
static msim_status bicgstab_precondition(const bicgstab_run *q, const double *v) {
  ms_vector_copy(q->shape, v, q->s->w);
  ms_jacobi_multiply_lower(q->system->model, q->s->roots, q->s->w);
  if (q->by->ops->precondition) {
    q->by->ops->precondition(q->by, q->s->w, q->s->z);
    return MSIM_OK;
  }
  const ms_linear_target rough = {.rtol = 1e-3, .max_iterations = 1};
  int64_t iterations = 0;
  return q->by->ops->solve(q->by, &rough, q->s->w, q->s->z, &iterations, NULL);
}

/* to = L^-1 A B L v */
static msim_status bicgstab_multiply(const bicgstab_run *q, const double *v, double *to) {
  const msim_status status = bicgstab_precondition(q, v);
  if (status) return status;
  ms_linear_system_apply(q->system, q->s->z, to);
  ms_jacobi_solve_lower(q->system->model, q->s->roots, to);
  ++*q->iterations;
  return MSIM_OK;
}

/* Step j of bi-conjugate gradients. MSIM_NOT_CONVERGED: breakdown. */
static msim_status bicg_step(bicgstab_run *q, int j) {
  const ms_bicgstab *s = q->s;
  const double rho = bicgstab_dot(q, s->r[j], s->shadow), beta = q->alpha * rho / q->rho;
  if (!isfinite(beta)) return MSIM_NOT_CONVERGED;
  q->rho = rho;
  for (int i = 0; i <= j; i++) ms_vector_add_scaled(q->shape, s->r[i], -beta, s->u[i], s->u[i]);
  msim_status status = bicgstab_multiply(q, s->u[j], s->u[j + 1]);
  if (status) return status;
  q->alpha = rho / bicgstab_dot(q, s->u[j + 1], s->shadow);
  if (!isfinite(q->alpha)) return MSIM_NOT_CONVERGED;
  for (int i = 0; i <= j; i++) ms_vector_axpy(q->shape, -q->alpha, s->u[i + 1], s->r[i]);
  ms_vector_axpy(q->shape, q->alpha, s->u[0], s->x);
  return bicgstab_multiply(q, s->r[j], s->r[j + 1]);
}

/* r[0] -= gamma1 r[1] + gamma2 r[2], of minimal norm, by modified Gram-Schmidt */
static msim_status minimize_residual(bicgstab_run *q) {
  const ms_bicgstab *s = q->s;
  const double first = bicgstab_dot(q, s->r[1], s->r[1]),
               tau = bicgstab_dot(q, s->r[2], s->r[1]) / first;
  ms_vector_axpy(q->shape, -tau, s->r[1], s->r[2]);
  const double part1 = bicgstab_dot(q, s->r[0], s->r[1]) / first;
  const double gamma2 = bicgstab_dot(q, s->r[0], s->r[2]) / bicgstab_dot(q, s->r[2], s->r[2]);
  const double gamma1 = part1 - tau * gamma2;
  if (!isfinite(gamma1) || !isfinite(gamma2)) return MSIM_NOT_CONVERGED;
  ms_vector_axpy(q->shape, gamma1, s->r[0], s->x);
  ms_vector_axpy(q->shape, gamma2, s->r[1], s->x);
  ms_vector_axpy(q->shape, -part1, s->r[1], s->r[0]);
  ms_vector_axpy(q->shape, -gamma2, s->r[2], s->r[0]);
  ms_vector_axpy(q->shape, -gamma1, s->u[1], s->u[0]);
  ms_vector_axpy(q->shape, -gamma2, s->u[2], s->u[0]);
  q->omega = gamma2;
  return MSIM_OK;
}

/* Iterate from r[0] = L^-1 (b - A y) until the norm of the recursively updated r[0] is <= goal, or
 * until a breakdown; then add the accumulated solution to y. */
static msim_status bicgstab_iterate(bicgstab_run *q, double goal, double *y) {
  const ms_bicgstab *s = q->s;
  msim_status status = MSIM_OK;
  ms_vector_clear_all(q->shape, s->x);
  ms_vector_clear_all(q->shape, s->u[0]);
  ms_vector_copy(q->shape, s->r[0], s->shadow);
  q->rho = 1, q->alpha = 0, q->omega = 1;
  while (!status && sqrt(bicgstab_dot(q, s->r[0], s->r[0])) > goal && *q->iterations < q->limit) {
    q->rho *= -q->omega;
    for (int j = 0; j < DEGREE && !status; j++) status = bicg_step(q, j);
    if (!status) status = minimize_residual(q);
  }
  if (status && status != MSIM_NOT_CONVERGED) return status;
  status = bicgstab_precondition(q, s->x);
  if (!status) ms_vector_axpy(q->shape, 1, s->z, y);
  return status;
}

/* The recursively updated residual drifts from the true one, and the recurrence may break down: the
 * iteration restarts from the true residual until that reaches the goal or stagnates. */
msim_status ms_bicgstab_solve(const ms_bicgstab *s, ms_linear *by, const ms_linear_target *target,
                              const double *b, double *y, int64_t *iterations) {
  const ms_linear_system *system = by->system;
  const ms_model *model = system->model;
  const double goal = fmax(target->rtol, DBL_EPSILON / 4) * target->size;
  int64_t count = 0;
  bicgstab_run q = {.s = s,
                    .system = system,
                    .shape = model->shape,
                    .by = by,
                    .iterations = &count,
                    .limit = target->max_iterations};
  double last = INFINITY;
  msim_status status = MSIM_OK;
  ms_jacobi_factor_blocks(model, &system->a, s->roots);
  ms_vector_copy(model->shape, b, s->r[0]);
  while (!status) {
    ms_jacobi_solve_lower(model, s->roots, s->r[0]);
    const double left = sqrt(bicgstab_dot(&q, s->r[0], s->r[0]));
    if (left <= goal || !(left < 0.9 * last)) break;
    last = left;
    status = count < q.limit ? bicgstab_iterate(&q, goal, y) : MSIM_NOT_CONVERGED;
    ms_linear_system_apply(system, y, s->r[0]);
    ms_vector_add_scaled(model->shape, b, -1, s->r[0], s->r[0]);
  }
  *iterations += count;
  return status;
}
