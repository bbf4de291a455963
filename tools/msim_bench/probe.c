#include "probe.h"

#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"

/* The probe of the next create(), which has no argument to identify it. */
static probe *next;

/*------------------------------------- forwarding -----------------------------------------------*/

static msim_status create(const msim_host *host, void **self) {
  *self = next;
  return next->inner->create(host, &next->self);
}

static msim_status order(void *self, int32_t n, const int32_t *ptr, const int32_t *ind,
                         int32_t *perm) {
  probe *p = self;
  return p->inner->order(p->self, n, ptr, ind, perm);
}

static msim_status analyze(void *self, const msim_system *A, msim_solve_info *info) {
  probe *p = self;
  p->A = A;
  return p->inner->analyze(p->self, A, info);
}

static msim_status factor(void *self, const msim_system *A, int32_t kind, msim_solve_info *info) {
  probe *p = self;
  return p->inner->factor(p->self, A, kind, info);
}

/* Number of scalars in a vector. */
static size_t vector_length(const msim_system *A) {
  return (size_t)A->block * (size_t)(A->format == MSIM_FORMAT_NONE ? A->stride : A->n);
}

static void keep(probe *p, const msim_solve_params *params, const double *b, const double *guess) {
  const size_t bytes = vector_length(p->A) * sizeof(double);
  p->listens = 0;
  p->params = *params;
  if (!p->b) p->b = malloc(bytes);
  if (!p->guess) p->guess = malloc(bytes);
  if (!p->y) p->y = malloc(bytes);
  if (!p->b || !p->guess || !p->y) return;
  memcpy(p->b, b, bytes);
  memcpy(p->guess, guess, bytes);
  p->length = vector_length(p->A);
}

static msim_status solve(void *self, const msim_system *A, const msim_solve_params *params,
                         int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  probe *p = self;
  if (p->listens && nrhs == 1) keep(p, params, b, y);
  return p->inner->solve(p->self, A, params, nrhs, b, y, info);
}

static void destroy(void *self) {
  probe *p = self;
  if (p) p->inner->destroy(p->self);
}

/*------------------------------------- from outside ---------------------------------------------*/

void probe_init(probe *p, const msim_backend *inner) {
  *p = (probe){.table = {.abi = MSIM_BACKEND_ABI,
                         .size = sizeof p->table,
                         .name = inner->name,
                         .library = inner->library,
                         .license = inner->license,
                         .flags = inner->flags,
                         .format = inner->format,
                         .create = create,
                         .order = inner->order ? order : NULL,
                         .analyze = analyze,
                         .factor = factor,
                         .solve = solve,
                         .destroy = destroy},
               .inner = inner};
  next = p;
}

void probe_free(probe *p) {
  free(p->b);
  free(p->guess);
  free(p->y);
}

msim_status probe_replay(probe *p, double *factor_s, double *solve_s) {
  msim_solve_info info = {.size = sizeof info};
  if (p->length == 0) return MSIM_ERR_MEMORY;
  memcpy(p->y, p->guess, p->length * sizeof *p->y);
  const double start = wall_seconds();
  msim_status status = p->inner->factor(p->self, p->A, MSIM_FACTOR_SPD, &info);
  const double factored = wall_seconds();
  info = (msim_solve_info){.size = sizeof info};
  if (!status) status = p->inner->solve(p->self, p->A, &p->params, 1, p->b, p->y, &info);
  *factor_s = factored - start;
  *solve_s = wall_seconds() - factored;
  return status;
}
