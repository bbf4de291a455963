/* backend.h - the ABI of plugins that solve the linear systems of implicit methods.
 *
 * A backend includes this header (and status.h) only and links to its own solver library only:
 * services of msim arrive as function pointers. A plugin is one file, msim_backend_NAME.so, that
 * exports one symbol, msim_backend_entry:
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
 * Guarantees of the host: calls come in the order create, set_options, choose_format, order,
 * analyze, (factor, solve+)+, destroy, where factor may be repeated, and destroy may follow any
 * call; b, and A if there is a matrix, are finite; n >= 1. Calls for one `self` never overlap;
 * calls for different instances may, in different threads.
 *
 * Obligations of a backend: it writes to nothing but `self`, y, perm and info; it neither prints
 * nor ends the process; the same calls give the same bits, whatever other instances do; it returns
 * one of MSIM_OK, MSIM_NOT_SPD, MSIM_NOT_CONVERGED, MSIM_ERR_ARG, MSIM_ERR_MEMORY,
 * MSIM_ERR_BACKEND. With an error (< 0) it passes a message to host->fail, which is optional for
 * MSIM_ERR_MEMORY. An unsupported block size, format or number of right-hand sides is MSIM_ERR_ARG.
 *
 * The host verifies the results: that perm is a permutation, and the true residual of y.
 *
 * Rules of change: new members are appended to a struct, and `size` says which exist. Any other
 * change requires a new MSIM_BACKEND_ABI. The host refuses another ABI and never reads beyond
 * `size`. The ABI is not frozen before version 1.0.
 */
#ifndef MSIM_BACKEND_H
#define MSIM_BACKEND_H

#include "msim/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_BACKEND_ABI 1u

/* The format in which a backend receives A: by rows. A is symmetric, so that its columns have the
 * same content, unless factor() gets MSIM_FACTOR_UNSYMMETRIC. */
enum {
  MSIM_FORMAT_NONE = 0,  /* no matrix, only apply() and precondition() */
  MSIM_FORMAT_UPPER = 1, /* rows of the upper block triangle, with full diagonal blocks; the same
                            arrays read by columns are the lower triangle */
  MSIM_FORMAT_FULL = 2   /* both triangles */
};

enum {
  MSIM_BACKEND_SYMMETRIC = 1u << 0,   /* factor() supports MSIM_FACTOR_SYMMETRIC */
  MSIM_BACKEND_ITERATIVE = 1u << 1,   /* solve() respects its parameters and the initial guess */
  MSIM_BACKEND_UNSYMMETRIC = 1u << 2, /* factor() supports MSIM_FACTOR_UNSYMMETRIC; FULL or NONE */
  MSIM_BACKEND_RANKS = 1u << 3,       /* it solves systems that several ranks share; ITERATIVE, and
                                         FULL or NONE */
  MSIM_BACKEND_TWO_LEVEL = 1u << 4    /* with NONE it uses two_level() */
};

/* Kinds of factor(). */
enum {
  /* A should be positive definite. Return MSIM_NOT_SPD if it is found not to be, from factor() or
   * solve(): a factorization must detect this, an iterative method reports it when it meets
   * negative curvature (p.A p <= 0). */
  MSIM_FACTOR_SPD = 0,
  /* A is symmetric, possibly indefinite: MSIM_NOT_SPD only if it is singular. */
  MSIM_FACTOR_SYMMETRIC = 1,
  /* The pattern of A is symmetric, its values are not: MSIM_NOT_SPD only if it is singular. */
  MSIM_FACTOR_UNSYMMETRIC = 2
};

/* Definiteness of A, as far as the backend has found it out. */
enum { MSIM_DEFINITE_UNKNOWN = 0, MSIM_DEFINITE_POSITIVE = 1, MSIM_DEFINITE_NOT = -1 };

/* The system A y = b with n block rows of `block` scalars each. The host owns all arrays; addresses
 * and pattern are constant from analyze() to destroy(), only the values change.
 *
 * UPPER and FULL: scalar rows, interleaved vectors (block row i, component c at block * i + c).
 * NONE: component c of block row i of a vector is at c * stride + i; padding is zero. */
typedef struct msim_system {
  size_t size;
  int32_t n;     /* block rows, >= 1 */
  int32_t block; /* scalars in a block row: 3, 2 or 1 */
  int32_t format;
  int32_t stride;          /* NONE: >= n */
  const int32_t *graphptr; /* n + 1; pattern of the blocks; NULL if NONE */
  const int32_t *graphind; /* graphptr[n], ascending in each row */
  const int32_t *rowptr;   /* block n + 1; pattern of the scalars; NULL if NONE */
  const int32_t *colind;   /* rowptr[block n], ascending in each row */
  const double *val;       /* rowptr[block n], 64-byte aligned; NULL if NONE */
  /* y = A x, y must not overlap x; NONE only. Any alignment of x and y; 64 bytes is fastest. Where
   * ranks share the system, collective, and the padding of x is overwritten. */
  void (*apply)(const struct msim_system *A, const double *x, double *y);
  /* z = D^-1 r, an approximation of A^-1 r. D: the diagonal blocks of A, modified to be positive
   * definite if they are not; updated before each factor(). NONE only. z may be r. */
  void (*precondition)(const struct msim_system *A, const double *r, double *z);
  void *data; /* private to the host */
  /* block n; UPPER and FULL: positions of the block rows when the sim was created, interleaved as
   * vectors are, of which rigid-body modes can be made; NULL where block = 1, or unknown. */
  const double *x;
  /* Several ranks share the system (MSIM_BACKEND_RANKS), each with its own block rows: analyze(),
   * factor(), solve() and destroy() are collective, norms and statistics are those of the whole
   * system, and so are statuses. NULL: one process. */
  const struct msim_comm *comm;
  int64_t first;        /* number of the first own block row in the whole system: rank by rank */
  int32_t nghosts;      /* block columns n to n + nghosts - 1 are block rows of other ranks, */
  const int64_t *ghost; /* nghosts: with these numbers in the whole system; NONE: no such columns */
  /* z = B r, B = D^-1 + P (P^T A P)^-1 P^T with coarse spaces of each rank and of all ranks, an
   * approximation of A^-1: the preconditioner of the solver pcg, positive definite, updated before
   * each factor(). z may be r. Collective. NONE with MSIM_BACKEND_TWO_LEVEL only, else NULL. */
  void (*two_level)(const struct msim_system *A, const double *r, double *z);
} msim_system;

/* Stopping criteria of one solve(). */
typedef struct msim_solve_params {
  size_t size;
  /* ||b - A y|| <= rtol ||b|| in the norm ||r|| = sqrt(r.D^-1 r), D the diagonal blocks of A; with
   * NONE ||r||^2 = r.precondition(r). If rtol >= 1e-4, which the host requests from
   * preconditioners, a factor may be applied in single precision. */
  double rtol;
  int32_t max_iterations;
} msim_solve_params;

/* Statistics of a call; initialized to zero by the host, every member is optional. */
typedef struct msim_solve_info {
  size_t size;
  int64_t iterations;
  double residual;  /* ||b - A y|| / ||b|| as computed by the backend; the largest of all y */
  double fill;      /* nonzeros of the factor */
  double flops;     /* of one factorization */
  int32_t definite; /* MSIM_DEFINITE_... */
} msim_solve_info;

/* Also declared by msim.h. */
typedef struct msim_backend msim_backend;

struct msim_backend {
  uint32_t abi;        /* MSIM_BACKEND_ABI */
  uint32_t size;       /* sizeof(msim_backend) */
  const char *name;    /* [a-z0-9_-]+: what the option `solver` selects */
  const char *library; /* the library behind it, with its version */
  const char *license; /* license of that library, SPDX */
  uint32_t flags;      /* MSIM_BACKEND_... */
  int32_t format;      /* MSIM_FORMAT_... */

  /* self: the instance, not NULL if the status is MSIM_OK. */
  msim_status (*create)(const msim_host *host, void **self);

  /* Choose an order of the block rows (to reduce fill-in) from their graph: both triangles,
   * ascending in each row, without the diagonal. perm[k] = the row at position k. Nullable: then
   * the host's order is used. */
  msim_status (*order)(void *self, int32_t n, const int32_t *ptr /* n+1 */, const int32_t *ind,
                       int32_t *perm /* n */);

  /* Analyze the pattern: called once, before the values are set. */
  msim_status (*analyze)(void *self, const msim_system *A, msim_solve_info *info);

  /* Factor A, whose values (or `kind`) have changed. May be called again after a failure. */
  msim_status (*factor)(void *self, const msim_system *A, int32_t kind, msim_solve_info *info);

  /* Solve for nrhs >= 1 right-hand sides. They are consecutive in b and y; a vector has length
   * block * n, or with NONE block * stride. y: on input the initial guess, on output the solution;
   * with MSIM_NOT_CONVERGED the best iterate; undefined otherwise. May be called repeatedly after
   * one factor() and solves with its values: the host may have changed A->val since then, so a
   * direct solver must not read it here. */
  msim_status (*solve)(void *self, const msim_system *A, const msim_solve_params *params,
                       int32_t nrhs, const double *b, double *y, msim_solve_info *info);

  void (*destroy)(void *self); /* accepts NULL and what a failed create() left in *self */

  /* Take the text of option solver.options, once, right after create(); not called without that
   * option. Nullable: there are none, and the host refuses the option. MSIM_ERR_ARG: invalid. */
  msim_status (*set_options)(void *self, const char *text);

  /* The format in which this instance receives A in place of `format`, asked once, after
   * set_options. Nullable: `format`. */
  int32_t (*choose_format)(void *self);
};

/* Size of the table in the first version of this ABI, the minimum for a plugin. */
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
