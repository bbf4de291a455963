/* backend.h - the ABI of linear-solver plugins.
 *
 * This header (with status.h) is all a backend includes, and a backend links to its own solver
 * library only: what it needs from msim arrives as function pointers. A plugin is one file,
 * msim_backend_NAME.so, that exports one symbol, msim_backend_entry. The same source can be
 * linked into the host: then the symbol is msim_backend_NAME. MSIM_BACKEND_ENTRY writes either:
 *
 *     static const msim_backend table = {.abi = MSIM_BACKEND_ABI, .size = sizeof table, ...};
 *     MSIM_BACKEND_ENTRY(cholmod) { return &table; }
 *
 * Rules of change: new members go at the end of a struct, and `size` tells which exist. Anything
 * else is a new MSIM_BACKEND_ABI. The host refuses another ABI and never calls past `size`.
 * The ABI is not frozen before version 1.0.
 */
#ifndef MSIM_BACKEND_H
#define MSIM_BACKEND_H

#include "msim/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_BACKEND_ABI 1u

/* How a backend wants A. A is symmetric: by rows or by columns reads the same. */
enum {
  MSIM_FORMAT_NONE = 0,  /* no matrix, only apply() and precondition() */
  MSIM_FORMAT_UPPER = 1, /* rows of the block-upper triangle, diagonal blocks full: read by columns
                            it is the lower triangle */
  MSIM_FORMAT_FULL = 2   /* both triangles */
};

enum {
  MSIM_BACKEND_SYMMETRIC = 1u << 0, /* factor() knows MSIM_FACTOR_SYMMETRIC */
  MSIM_BACKEND_ITERATIVE = 1u << 1  /* solve() honours its parameters and the initial guess */
};

/* What factor() is asked for. */
enum {
  MSIM_FACTOR_SPD = 0, /* A is expected to be positive definite: MSIM_NOT_SPD where it is not */
  MSIM_FACTOR_SYMMETRIC = 1 /* A is symmetric, perhaps indefinite */
};

/* The system A y = b. n block rows of `block` scalars each. Every array belongs to the host; the
 * addresses hold from analyze() to destroy(), the pattern too, only the values change.
 *
 * UPPER and FULL: scalar rows, vectors interleaved (block row i, component c at block * i + c).
 * NONE: component c of block row i of a vector is at c * stride + i; padding is zero. */
typedef struct msim_system {
  size_t size;
  int32_t n;     /* block rows, >= 1 */
  int32_t block; /* scalars in a block row: 3, 2 or 1 */
  int32_t format;
  int32_t stride;          /* NONE: >= n */
  const int32_t *graphptr; /* n + 1; NULL if NONE: the pattern of the blocks */
  const int32_t *graphind; /* graphptr[n], ascending in a row */
  const int32_t *rowptr;   /* block n + 1; NULL if NONE: the pattern of the scalars */
  const int32_t *colind;   /* rowptr[block n], ascending in a row */
  const double *val;       /* rowptr[block n], 64-byte aligned; NULL if NONE */
  void (*apply)(const struct msim_system *A, const double *x, double *y); /* y = A x */
  /* z ~ A^-1 r, symmetric positive definite; NONE only. */
  void (*precondition)(const struct msim_system *A, const double *r, double *z);
  void *data; /* the host's */
} msim_system;

/* What one solve() has to reach. */
typedef struct msim_solve_params {
  size_t size;
  double rtol; /* ||b - A y|| <= rtol ||b||, 2-norm */
  int32_t max_iterations;
} msim_solve_params;

/* What a call has to tell; zeroed by the host, every member optional. */
typedef struct msim_solve_info {
  size_t size;
  int64_t iterations;
  double residual; /* ||b - A y|| / ||b||, as the backend knows it */
  double fill;     /* nonzeros of the factor */
  double flops;    /* of one factorisation */
} msim_solve_info;

/* Called in this order: create, order, analyze, (factor, solve+)+, destroy. */
typedef struct msim_backend {
  uint32_t abi;        /* MSIM_BACKEND_ABI */
  uint32_t size;       /* sizeof(msim_backend) */
  const char *name;    /* [a-z0-9_-]+: what the option `solver` selects */
  const char *library; /* the library behind it, with its version */
  const char *license; /* of that library, SPDX */
  uint32_t flags;      /* MSIM_BACKEND_... */
  int32_t format;      /* MSIM_FORMAT_... */

  msim_status (*create)(const msim_host *host, void **self);

  /* The order in which the backend wants the block rows, from their graph: both triangles,
   * ascending in a row, without the diagonal. perm[k] = the row that comes k-th.
   * Nullable: the host's order is kept. */
  msim_status (*order)(void *self, int32_t n, const int32_t *ptr /* n+1 */, const int32_t *ind,
                       int32_t *perm /* n */);

  msim_status (*analyze)(void *self, const msim_system *A, msim_solve_info *info);
  msim_status (*factor)(void *self, const msim_system *A, int32_t kind, msim_solve_info *info);

  /* Solve for nrhs right sides, one after the other in b and y, apart by the length of a vector.
   * y: initial guess in, solution out. May be called many times for one factor(). */
  msim_status (*solve)(void *self, const msim_system *A, const msim_solve_params *params,
                       int32_t nrhs, const double *b, double *y, msim_solve_info *info);

  void (*destroy)(void *self); /* accepts what create() left when it failed, and NULL */
} msim_backend;

/* The size of the table when this ABI began: the least a plugin must have. */
#define MSIM_BACKEND_SIZE_1 (offsetof(msim_backend, destroy) + sizeof(void (*)(void *)))

typedef const msim_backend *msim_backend_entry_fn(void);

#ifdef MSIM_PLUGIN
#  define MSIM_BACKEND_ENTRY(name)                                                       \
    __attribute__((visibility("default"))) const msim_backend *msim_backend_entry(void); \
    const msim_backend *msim_backend_entry(void)
#else
#  define MSIM_BACKEND_ENTRY(name)                 \
    const msim_backend *msim_backend_##name(void); \
    const msim_backend *msim_backend_##name(void)
#endif

#ifdef __cplusplus
}
#endif
#endif
