/* cholmod - solver plugin: supernodal Cholesky and simplicial LDL' of SuiteSparse.
 *
 * The host's UPPER matrix, read by columns, is the lower triangle with full diagonal blocks, which
 * CHOLMOD accepts as stype = -1, ignoring entries above the diagonal. It is used without a copy.
 * The order is computed on the graph of the blocks, which has a third of the dimension, and the
 * host passes the matrix permuted, so that CHOLMOD uses the natural order and copies nothing. */
#define _GNU_SOURCE /* RTLD_DEFAULT */
#include <cholmod.h>
#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <string.h>

#include "msim/backend.h"
#include "panels.h"
#include "triangular.h"

#define STRING_(x) #x
#define STRING(x)  STRING_(x)

typedef struct cholesky {
  const msim_host *host;
  cholmod_common common;
  cholmod_sparse matrix;                   /* refers to the host's arrays */
  cholmod_factor *supernodal, *simplicial; /* LL', and LDL' after its first use */
  cholmod_factor *current;
  cholmod_dense *x, *y, *e;                /* workspace of CHOLMOD */
  double *work;                            /* workspace of triangular_solve */
  panels panels;                           /* packed copy of the factor, if it is used many times */
  enum { NOT_YET, PACKED, UNFIT } packing; /* state of the packed copy */
  int omp_levels;                          /* OpenMP setting of the caller before limit_threads */
} cholesky;

/*------------------------------------- threads --------------------------------------------------*/

/* CHOLMOD 3 starts 4 OpenMP threads on any machine, and BLAS its own threads: on two cores they
 * compete, and results would depend on their number. Use one thread during calls, and restore the
 * settings of the process afterwards. The functions are found at run time, so that any BLAS and any
 * OpenMP library will do. */
typedef struct thread_controls {
  void (*set_blas)(int);
  int (*get_blas)(void);
  void (*set_levels)(int);
  int (*get_levels)(void);
} thread_controls;

static thread_controls find_controls(void) {
  const struct {
    const char *name;
    size_t member;
  } symbols[] = {{"openblas_set_num_threads", offsetof(thread_controls, set_blas)},
                 {"openblas_get_num_threads", offsetof(thread_controls, get_blas)},
                 {"omp_set_max_active_levels", offsetof(thread_controls, set_levels)},
                 {"omp_get_max_active_levels", offsetof(thread_controls, get_levels)}};
  thread_controls controls = {0};
  for (size_t i = 0; i < sizeof symbols / sizeof *symbols; i++) {
    void *symbol = dlsym(RTLD_DEFAULT, symbols[i].name);
    memcpy((char *)&controls + symbols[i].member, &symbol, sizeof symbol);
  }
  return controls;
}

/* The number of OpenBLAS threads is global, so solvers in several threads share one change of it:
 * the first to enter sets it, the last to leave restores it. OpenMP's levels are per thread. */
static pthread_mutex_t blas_mutex = PTHREAD_MUTEX_INITIALIZER;
static int active_solvers, blas_threads_before;

static void limit_threads(cholesky *self) {
  const thread_controls c = find_controls();
  pthread_mutex_lock(&blas_mutex);
  if (active_solvers++ == 0 && c.get_blas && c.set_blas)
    blas_threads_before = c.get_blas(), c.set_blas(1);
  pthread_mutex_unlock(&blas_mutex);
  if (c.get_levels && c.set_levels) self->omp_levels = c.get_levels(), c.set_levels(0);
}

static void restore_threads(cholesky *self) {
  const thread_controls c = find_controls();
  if (c.get_levels && c.set_levels) c.set_levels(self->omp_levels);
  pthread_mutex_lock(&blas_mutex);
  if (--active_solvers == 0 && c.get_blas && c.set_blas) c.set_blas(blas_threads_before);
  pthread_mutex_unlock(&blas_mutex);
}

/*------------------------------------- status ---------------------------------------------------*/

/* CHOLMOD returns TRUE even if the matrix is not positive definite: only its status shows that. */
static msim_status cholesky_status(cholesky *self, const char *what) {
  switch (self->common.status) {
    case CHOLMOD_OK:
    case CHOLMOD_DSMALL:
      return MSIM_OK;
    case CHOLMOD_NOT_POSDEF:
      return MSIM_NOT_SPD;
    case CHOLMOD_OUT_OF_MEMORY:
      self->host->fail(self->host, "CHOLMOD failed to %s: out of memory", what);
      return MSIM_ERR_MEMORY;
    case CHOLMOD_TOO_LARGE:
      self->host->fail(self->host,
                       "the factor is too large for CHOLMOD's 32-bit indices; use solver = pcg");
      return MSIM_ERR_BACKEND;
    default:
      self->host->fail(self->host, "CHOLMOD failed to %s: status %d", what, self->common.status);
      return MSIM_ERR_BACKEND;
  }
}

static msim_status cholesky_refuse(cholesky *self, const char *why) {
  self->host->fail(self->host, "%s", why);
  return MSIM_ERR_ARG;
}

/*------------------------------------- plugin functions -----------------------------------------*/

static msim_status cholesky_create(const msim_host *host, void **result) {
  cholesky *self = host->alloc(host, sizeof *self);
  *result = self;
  if (!self) return MSIM_ERR_MEMORY;
  memset(self, 0, sizeof *self);
  self->host = host;
  cholmod_start(&self->common);
  self->common.print = 0;
  self->common.nmethods = 1;
  self->common.quick_return_if_not_posdef = 1;
  return MSIM_OK;
}

/* Minimum degree is fast, and best for small systems and for cloths. Above this number of flops of
 * the factorization nested dissection is tried, too: it costs about as much as one factorization,
 * and saves up to two thirds of each for solids. */
#define MIN_DISSECTION_FLOPS 3e9

/* Order the vertices of the graph by one method, with postordering; *flops: of the
 * factorization. */
static cholmod_factor *order_with_method(cholesky *self, cholmod_sparse *graph, int method,
                                         double *flops) {
  cholmod_common *c = &self->common;
  c->method[0].ordering = method;
  c->postorder = 1;
  c->supernodal = CHOLMOD_SUPERNODAL;
  cholmod_factor *order = cholmod_analyze(graph, c);
  *flops = order ? c->fl : INFINITY;
  return order;
}

static msim_status cholesky_order(void *data, int32_t n, const int32_t *ptr, const int32_t *ind,
                                  int32_t *perm) {
  cholesky *self = data;
  cholmod_common *c = &self->common;
  cholmod_sparse graph = {.nrow = (size_t)n,
                          .ncol = (size_t)n,
                          .nzmax = (size_t)ptr[n],
                          .p = (void *)(uintptr_t)ptr,
                          .i = (void *)(uintptr_t)ind,
                          .stype = 1,
                          .itype = CHOLMOD_INT,
                          .xtype = CHOLMOD_PATTERN,
                          .sorted = 1,
                          .packed = 1};
  limit_threads(self);
  double flops, fewer;
  cholmod_factor *best = order_with_method(self, &graph, CHOLMOD_AMD, &flops);
  msim_status status = cholesky_status(self, "order the matrix");
  if (!status && 27 * flops > MIN_DISSECTION_FLOPS) {
    cholmod_factor *other = order_with_method(self, &graph, CHOLMOD_NESDIS, &fewer);
    cholmod_factor *worse = fewer < flops ? best : other;
    best = fewer < flops ? other : best;
    cholmod_free_factor(&worse, c);
  }
  if (best) memcpy(perm, best->Perm, (size_t)n * sizeof *perm);
  cholmod_free_factor(&best, c);
  restore_threads(self);
  return status;
}

/* The order is postordered already: neither postorder again nor permute columns. */
static cholmod_factor *analyze_symbolic(cholesky *self, int supernodal) {
  cholmod_common *c = &self->common;
  c->method[0].ordering = CHOLMOD_NATURAL;
  c->postorder = 0;
  c->supernodal = supernodal;
  return cholmod_analyze(&self->matrix, c);
}

static void free_panels(cholesky *self) {
  void *arrays[] = {self->panels.value, self->panels.y, self->panels.w};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
    self->host->free(self->host, arrays[i]);
  self->panels = (panels){0};
}

static msim_status allocate_panels(cholesky *self, int single) {
  const msim_host *host = self->host;
  const cholmod_factor *L = self->supernodal;
  const size_t size = single ? sizeof(float) : sizeof(double);
  self->panels = (panels){.factor = L,
                          .single = single,
                          .value = host->alloc(host, panels_value_count(L) * size),
                          .y = host->alloc(host, LANES * L->n * sizeof(double)),
                          .w = host->alloc(host, panels_work_size(L) * sizeof(double))};
  const panels *p = &self->panels;
  if (p->value && p->y && p->w) return MSIM_OK;
  free_panels(self);
  return MSIM_ERR_MEMORY;
}

static msim_status cholesky_analyze(void *data, const msim_system *A, msim_solve_info *info) {
  cholesky *self = data;
  if (A->n < 1 || A->block < 1 || A->block > 3 || A->format != MSIM_FORMAT_UPPER)
    return cholesky_refuse(
        self, "A must have MSIM_FORMAT_UPPER and at least one block row, of 1 to 3 scalars");
  const size_t n = (size_t)A->block * (size_t)A->n;
  self->matrix = (cholmod_sparse){.nrow = n,
                                  .ncol = n,
                                  .nzmax = (size_t)A->rowptr[n],
                                  .p = (void *)(uintptr_t)A->rowptr,
                                  .i = (void *)(uintptr_t)A->colind,
                                  .x = (void *)(uintptr_t)A->val,
                                  .stype = -1,
                                  .itype = CHOLMOD_INT,
                                  .xtype = CHOLMOD_REAL,
                                  .dtype = CHOLMOD_DOUBLE,
                                  .sorted = 1,
                                  .packed = 1};
  /* limits of relaxed supernodes: CHOLMOD's defaults, counted in block rows */
  const size_t relaxed[3] = {4, 16, 48};
  for (int i = 0; i < 3; i++)
    self->common.nrelax[i] = relaxed[i] * (A->block == 1 ? 1 : (size_t)A->block);
  limit_threads(self);
  self->supernodal = analyze_symbolic(self, CHOLMOD_SUPERNODAL);
  info->fill = self->common.lnz;
  info->flops = self->common.fl;
  restore_threads(self);
  msim_status status = cholesky_status(self, "analyse the matrix");
  if (status) return status;
  /* a matrix with scalar blocks is constant, so one factorization is used for a whole run */
  if (A->block == 1 && panels_are_faster()) return allocate_panels(self, 0);
  self->work =
      self->host->alloc(self->host, triangular_work_size(self->supernodal) * sizeof(double));
  return self->work ? MSIM_OK : MSIM_ERR_MEMORY;
}

/* LL' exists only if A is positive definite; for LDL', the signs of D show it. */
static int32_t cholesky_definiteness(const cholmod_factor *L) {
  const int32_t *column = L->p;
  const double *value = L->x;
  if (L->is_ll) return MSIM_DEFINITE_POSITIVE;
  for (size_t j = 0; j < L->n; j++)
    if (!(value[column[j]] > 0)) return MSIM_DEFINITE_NOT;
  return MSIM_DEFINITE_POSITIVE;
}

static msim_status cholesky_factor(void *data, const msim_system *A, int32_t kind,
                                   msim_solve_info *info) {
  (void)A;
  cholesky *self = data;
  limit_threads(self);
  msim_status status = MSIM_OK;
  self->packing = NOT_YET;
  if (kind == MSIM_FACTOR_SYMMETRIC && !self->simplicial) {
    self->simplicial = analyze_symbolic(self, CHOLMOD_SIMPLICIAL);
    status = cholesky_status(self, "analyse the matrix");
  }
  self->current = kind == MSIM_FACTOR_SYMMETRIC ? self->simplicial : self->supernodal;
  if (!status) {
    cholmod_factorize(&self->matrix, self->current, &self->common);
    status = cholesky_status(self, "factor the matrix");
    info->definite = status ? MSIM_DEFINITE_UNKNOWN : cholesky_definiteness(self->current);
  }
  restore_threads(self);
  return status;
}

/* Whether to solve by panels. With a coarse tolerance the factor is a preconditioner, for which
 * panels in single precision suffice, which halve the time of a solve. */
static int use_panels(cholesky *self, double rtol) {
  const double ROUGH = 1e-4;
  panels *p = &self->panels;
  const int rough = rtol >= ROUGH;
  if (rough && !p->value && panels_are_faster())
    allocate_panels(self, 1); /* a failure is harmless: the panels are optional */
  if (!p->value || (p->single && !rough)) return 0;
  if (self->packing == NOT_YET) self->packing = panels_pack(p) ? PACKED : UNFIT;
  return self->packing == PACKED;
}

/* y = (L L')^-1 b, right-hand sides n apart */
static void solve_supernodal(cholesky *self, size_t n, int32_t nrhs, const double *b, double *y,
                             double rtol) {
  const int packed = use_panels(self, rtol);
  const int32_t most = packed && self->panels.single ? 1 : MAX_SIDES;
  for (int32_t done = 0; done < nrhs; done += most, b += (size_t)most * n, y += (size_t)most * n) {
    const int32_t count = nrhs - done < most ? nrhs - done : most;
    if (packed) {
      panels_solve(&self->panels, b, y, count);
      continue;
    }
    memcpy(y, b, n * (size_t)count * sizeof *y);
    triangular_solve(self->supernodal, y, count, self->work);
  }
}

static msim_status cholesky_solve(void *data, const msim_system *A, const msim_solve_params *params,
                                  int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  (void)info;
  cholesky *self = data;
  if (nrhs < 1) return cholesky_refuse(self, "nrhs must be at least 1");
  const size_t n = (size_t)A->block * (size_t)A->n, columns = (size_t)nrhs;
  if (self->current == self->supernodal) {
    solve_supernodal(self, n, nrhs, b, y, params->rtol);
    return MSIM_OK;
  }
  cholmod_dense right = {.nrow = n,
                         .ncol = columns,
                         .nzmax = n * columns,
                         .d = n,
                         .x = (void *)(uintptr_t)b,
                         .xtype = CHOLMOD_REAL,
                         .dtype = CHOLMOD_DOUBLE};
  limit_threads(self);
  cholmod_solve2(CHOLMOD_A, self->current, &right, NULL, &self->x, NULL, &self->y, &self->e,
                 &self->common);
  restore_threads(self);
  msim_status status = cholesky_status(self, "solve");
  if (!status) memcpy(y, self->x->x, n * columns * sizeof *y);
  return status;
}

static void cholesky_destroy(void *data) {
  cholesky *self = data;
  if (!self) return;
  cholmod_free_factor(&self->supernodal, &self->common);
  cholmod_free_factor(&self->simplicial, &self->common);
  cholmod_free_dense(&self->x, &self->common);
  cholmod_free_dense(&self->y, &self->common);
  cholmod_free_dense(&self->e, &self->common);
  cholmod_finish(&self->common);
  free_panels(self);
  self->host->free(self->host, self->work);
  self->host->free(self->host, self);
}

MSIM_BACKEND_ENTRY(cholmod) {
  static const msim_backend table = {
      .abi = MSIM_BACKEND_ABI,
      .size = sizeof(msim_backend),
      .name = "cholmod",
      .library = "CHOLMOD " STRING(CHOLMOD_MAIN_VERSION) "." STRING(CHOLMOD_SUB_VERSION) "." STRING(
          CHOLMOD_SUBSUB_VERSION),
      .license = "GPL-2.0-or-later (Supernodal), LGPL-2.1-or-later (Cholesky, Core)",
      .flags = MSIM_BACKEND_SYMMETRIC,
      .format = MSIM_FORMAT_UPPER,
      .create = cholesky_create,
      .order = cholesky_order,
      .analyze = cholesky_analyze,
      .factor = cholesky_factor,
      .solve = cholesky_solve,
      .destroy = cholesky_destroy};
  return &table;
}
