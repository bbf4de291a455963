#include "backend_proxy.h"

#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"

/* The proxy of the next proxy_create(), which has no argument to identify it. */
static backend_proxy *next;

/*------------------------------------- forwarding -----------------------------------------------*/

static msim_status proxy_create(const msim_host *host, void **self) {
  *self = next;
  return next->backend->create(host, &next->self);
}

static msim_status proxy_order(void *self, int32_t n, const int32_t *ptr, const int32_t *ind,
                               int32_t *perm) {
  backend_proxy *p = self;
  return p->backend->order(p->self, n, ptr, ind, perm);
}

static msim_status proxy_analyze(void *self, const msim_system *A, msim_solve_info *info) {
  backend_proxy *p = self;
  p->A = A;
  return p->backend->analyze(p->self, A, info);
}

static msim_status proxy_factor(void *self, const msim_system *A, int32_t kind,
                                msim_solve_info *info) {
  backend_proxy *p = self;
  return p->backend->factor(p->self, A, kind, info);
}

/* Number of scalars in a vector. */
static size_t vector_length(const msim_system *A) {
  return (size_t)A->block * (size_t)(A->format == MSIM_FORMAT_NONE ? A->stride : A->n);
}

static void copy_solve_arguments(backend_proxy *p, const msim_solve_params *params, const double *b,
                                 const double *guess) {
  const size_t bytes = vector_length(p->A) * sizeof(double);
  p->copy_next = 0;
  p->params = *params;
  if (!p->b) p->b = malloc(bytes);
  if (!p->guess) p->guess = malloc(bytes);
  if (!p->y) p->y = malloc(bytes);
  if (!p->b || !p->guess || !p->y) return;
  memcpy(p->b, b, bytes);
  memcpy(p->guess, guess, bytes);
  p->length = vector_length(p->A);
}

static msim_status proxy_solve(void *self, const msim_system *A, const msim_solve_params *params,
                               int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  backend_proxy *p = self;
  if (p->copy_next && nrhs == 1) copy_solve_arguments(p, params, b, y);
  return p->backend->solve(p->self, A, params, nrhs, b, y, info);
}

static void proxy_destroy(void *self) {
  backend_proxy *p = self;
  if (p) p->backend->destroy(p->self);
}

/*------------------------------------- from outside ---------------------------------------------*/

void backend_proxy_init(backend_proxy *p, const msim_backend *inner) {
  *p = (backend_proxy){.table = {.abi = MSIM_BACKEND_ABI,
                                 .size = sizeof p->table,
                                 .name = inner->name,
                                 .library = inner->library,
                                 .license = inner->license,
                                 .flags = inner->flags,
                                 .format = inner->format,
                                 .create = proxy_create,
                                 .order = inner->order ? proxy_order : NULL,
                                 .analyze = proxy_analyze,
                                 .factor = proxy_factor,
                                 .solve = proxy_solve,
                                 .destroy = proxy_destroy},
                       .backend = inner};
  next = p;
}

void backend_proxy_free(backend_proxy *p) {
  free(p->b);
  free(p->guess);
  free(p->y);
}

msim_status backend_proxy_repeat(backend_proxy *p, double *factor_s, double *solve_s) {
  msim_solve_info info = {.size = sizeof info};
  if (p->length == 0) return MSIM_ERR_MEMORY;
  memcpy(p->y, p->guess, p->length * sizeof *p->y);
  const double start = clock_seconds();
  msim_status status = p->backend->factor(p->self, p->A, MSIM_FACTOR_SPD, &info);
  const double factored = clock_seconds();
  info = (msim_solve_info){.size = sizeof info};
  if (!status) status = p->backend->solve(p->self, p->A, &p->params, 1, p->b, p->y, &info);
  *factor_s = factored - start;
  *solve_s = clock_seconds() - factored;
  return status;
}
