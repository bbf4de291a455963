/* backend.h - the ABI of linear-solver plugins.
 *
 * This header (with status.h) is all a backend includes, and a backend links to its own solver
 * library only: what it needs from msim arrives as function pointers. A plugin is one file,
 * msim_backend_NAME.so, that exports one symbol, msim_backend_entry:
 *
 *     static const msim_backend table = {.abi = MSIM_BACKEND_ABI, .size = sizeof table, ...};
 *     MSIM_BACKEND_ENTRY(dense) { return &table; }
 *
 *     cc -shared -fPIC -DMSIM_PLUGIN $(pkg-config --cflags msim) dense.c -o msim_backend_dense.so
 *     MSIM_PLUGIN_PATH=$PWD msim_cli run scene.json --integrator linearly-implicit-euler \
 *         --solver dense
 *
 * Without MSIM_PLUGIN the same source can be linked into a program: the symbol is then
 * msim_backend_dense, and msim_options.backends takes the table it returns.
 *
 * What the host promises: calls come in the order create, order, analyze, (factor, solve+)+,
 * destroy, where factor may be repeated, and destroy may follow any call; b, and A where there is
 * one, are finite; n >= 1. Calls for one `self` never overlap, those for two may, in two threads.
 * What a backend promises: it writes nothing but `self`, y, perm and info; it neither prints nor
 * ends the process; it gives the same bits for the same calls, whatever other instances do; it
 * returns one of MSIM_OK, MSIM_NOT_SPD, MSIM_NOT_CONVERGED, MSIM_ERR_ARG, MSIM_ERR_MEMORY,
 * MSIM_ERR_BACKEND, after an error (< 0) with a sentence to host->fail, which MSIM_ERR_MEMORY may
 * spare. A block size, format or number of right sides that it cannot take is MSIM_ERR_ARG.
 * The host trusts none of it: perm is checked to be a permutation, y by its true residual.
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

/* How a backend wants A: by rows. Unless it takes MSIM_FACTOR_UNSYMMETRIC, A is symmetric, and
 * reads the same by columns. */
enum {
  MSIM_FORMAT_NONE = 0,  /* no matrix, only apply() and precondition() */
  MSIM_FORMAT_UPPER = 1, /* rows of the block-upper triangle, diagonal blocks full: read by columns
                            it is the lower triangle */
  MSIM_FORMAT_FULL = 2   /* both triangles */
};

enum {
  MSIM_BACKEND_SYMMETRIC = 1u << 0,  /* factor() knows MSIM_FACTOR_SYMMETRIC */
  MSIM_BACKEND_ITERATIVE = 1u << 1,  /* solve() honours its parameters and the initial guess */
  MSIM_BACKEND_UNSYMMETRIC = 1u << 2 /* factor() knows MSIM_FACTOR_UNSYMMETRIC; FULL or NONE */
};

/* What factor() is asked for. */
enum {
  /* A is expected to be positive definite: MSIM_NOT_SPD as soon as it is seen not to be, by
   * factor() or by solve(). A factorisation has to see it; an iteration says so when it meets
   * negative curvature. */
  MSIM_FACTOR_SPD = 0,
  /* A is symmetric, perhaps indefinite: MSIM_NOT_SPD only where it is singular too. */
  MSIM_FACTOR_SYMMETRIC = 1,
  /* The pattern of A is symmetric, its values are not: MSIM_NOT_SPD only where it is singular. */
  MSIM_FACTOR_UNSYMMETRIC = 2
};

/* What a backend has learnt of A. */
enum { MSIM_DEFINITE_UNKNOWN = 0, MSIM_DEFINITE_POSITIVE = 1, MSIM_DEFINITE_NOT = -1 };

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
  /* y = A x, y apart from x; NONE only. Vectors of any alignment; 64 bytes is fastest. */
  void (*apply)(const struct msim_system *A, const double *x, double *y);
  /* z = D^-1 r ~ A^-1 r, D the diagonal blocks of A, made positive definite where they are not; new
   * with each factor(); NONE only. z may be r. */
  void (*precondition)(const struct msim_system *A, const double *r, double *z);
  void *data; /* the host's */
} msim_system;

/* What one solve() has to reach. */
typedef struct msim_solve_params {
  size_t size;
  /* ||b - A y|| <= rtol ||b|| in the norm sqrt(r.D^-1 r), D the diagonal blocks of A; with NONE
   * its square is r.precondition(r). A factor may be applied in single precision where this is 1e-4
   * or more: the host asks for that of preconditioners. */
  double rtol;
  int32_t max_iterations;
} msim_solve_params;

/* What a call has to tell; zeroed by the host, every member optional. */
typedef struct msim_solve_info {
  size_t size;
  int64_t iterations;
  double residual;  /* ||b - A y|| / ||b||, as the backend finds it; the worst of the right sides */
  double fill;      /* nonzeros of the factor */
  double flops;     /* of one factorisation */
  int32_t definite; /* MSIM_DEFINITE_... */
} msim_solve_info;

/* Also declared by msim.h. */
typedef struct msim_backend msim_backend;

struct msim_backend {
  uint32_t abi;        /* MSIM_BACKEND_ABI */
  uint32_t size;       /* sizeof(msim_backend) */
  const char *name;    /* [a-z0-9_-]+: what the option `solver` selects */
  const char *library; /* the library behind it, with its version */
  const char *license; /* of that library, SPDX */
  uint32_t flags;      /* MSIM_BACKEND_... */
  int32_t format;      /* MSIM_FORMAT_... */

  /* self: the instance, not NULL where the status is MSIM_OK. */
  msim_status (*create)(const msim_host *host, void **self);

  /* The order in which the backend wants the block rows, from their graph: both triangles,
   * ascending in a row, without the diagonal. perm[k] = the row that comes k-th.
   * Nullable: the host's order is kept. */
  msim_status (*order)(void *self, int32_t n, const int32_t *ptr /* n+1 */, const int32_t *ind,
                       int32_t *perm /* n */);

  /* The pattern is new: called once. The values are not set yet. */
  msim_status (*analyze)(void *self, const msim_system *A, msim_solve_info *info);

  /* The values are new, or the kind is. A failure leaves `self` ready for another factor(). */
  msim_status (*factor)(void *self, const msim_system *A, int32_t kind, msim_solve_info *info);

  /* Solve for nrhs >= 1 right sides, one after the other in b and y, apart by the length of a
   * vector: block n, or NONE: block stride. y: initial guess in, solution out, the best so far with
   * MSIM_NOT_CONVERGED, scratch otherwise. May be called many times for one factor(), and belongs
   * to it: the host may have written new values since, which a factorisation does not look at. */
  msim_status (*solve)(void *self, const msim_system *A, const msim_solve_params *params,
                       int32_t nrhs, const double *b, double *y, msim_solve_info *info);

  void (*destroy)(void *self); /* accepts what create() left when it failed, and NULL */
};

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
