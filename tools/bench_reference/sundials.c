/* SUNLinSol_PCG with N_Vector_Serial, a block Jacobi preconditioner and a product A x of our own.
 *
 * The product determines much of the speed, so there are two: by scalar rows, as the matrix is
 * received, and by 3 x 3 blocks, which loads one index for nine numbers; compare with the fastest.
 * Both start from 0. */
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_pcg.h>

#include "../common/clock.h"
#include "solver.h"

#if SUNDIALS_VERSION_MAJOR < 7
#  define SUN_COMM_NULL NULL
#endif

enum { BLOCKS, ROWS };

static const csr_system *given;
static double *blocks;  /* 9 for each 3 x 3 block, by rows */
static double *inverse; /* of the diagonal blocks, 9 each */
static double tolerance;
static SUNContext context;
static SUNLinearSolver pcg;
static N_Vector x, b;

/*------------------------------------- products -------------------------------------------------*/

static int multiply_rows(void *data, N_Vector from, N_Vector to) {
  const csr_system *s = data;
  const double *v = N_VGetArrayPointer(from);
  double *y = N_VGetArrayPointer(to);
  for (int32_t i = 0; i < s->n; i++) {
    double sum = 0;
    for (int32_t e = s->rowptr[i]; e < s->rowptr[i + 1]; e++) sum += s->val[e] * v[s->colind[e]];
    y[i] = sum;
  }
  return 0;
}

/* Block row i / 3 has a third of the entries of row i; every third one begins a block. */
static int multiply_blocks(void *data, N_Vector from, N_Vector to) {
  const csr_system *s = data;
  const double *v = N_VGetArrayPointer(from), *a = blocks;
  double *y = N_VGetArrayPointer(to);
  for (int32_t i = 0; i < s->n; i += 3) {
    double s0 = 0, s1 = 0, s2 = 0;
    for (int32_t e = s->rowptr[i]; e < s->rowptr[i + 1]; e += 3, a += 9) {
      const double *u = v + s->colind[e];
      s0 += a[0] * u[0] + a[1] * u[1] + a[2] * u[2];
      s1 += a[3] * u[0] + a[4] * u[1] + a[5] * u[2];
      s2 += a[6] * u[0] + a[7] * u[1] + a[8] * u[2];
    }
    y[i] = s0, y[i + 1] = s1, y[i + 2] = s2;
  }
  return 0;
}

static void copy_blocks(const csr_system *s) {
  double *to = blocks;
  for (int32_t i = 0; i < s->n; i += 3)
    for (int32_t e = 0; e < s->rowptr[i + 1] - s->rowptr[i]; e += 3)
      for (int32_t r = 0; r < 3; r++, to += 3)
        memcpy(to, s->val + s->rowptr[i + r] + e, 3 * sizeof *to);
}

/*------------------------------------- preconditioner -------------------------------------------*/

/* Inverts a 3 x 3 matrix by cofactors. */
static void invert_3x3(const double m[9], double to[9]) {
  const double c0 = m[4] * m[8] - m[5] * m[7], c1 = m[5] * m[6] - m[3] * m[8],
               c2 = m[3] * m[7] - m[4] * m[6];
  const double d = 1 / (m[0] * c0 + m[1] * c1 + m[2] * c2);
  to[0] = c0 * d, to[3] = c1 * d, to[6] = c2 * d;
  to[1] = (m[2] * m[7] - m[1] * m[8]) * d;
  to[4] = (m[0] * m[8] - m[2] * m[6]) * d;
  to[7] = (m[1] * m[6] - m[0] * m[7]) * d;
  to[2] = (m[1] * m[5] - m[2] * m[4]) * d;
  to[5] = (m[2] * m[3] - m[0] * m[5]) * d;
  to[8] = (m[0] * m[4] - m[1] * m[3]) * d;
}

static void invert_diagonal(const csr_system *s) {
  const double *a = blocks;
  for (int32_t i = 0; i < s->n; i += 3)
    for (int32_t e = s->rowptr[i]; e < s->rowptr[i + 1]; e += 3, a += 9)
      if (s->colind[e] == i) invert_3x3(a, inverse + 3 * (size_t)i);
}

static int apply_block_jacobi(void *data, N_Vector residual, N_Vector to, sunrealtype goal,
                              int side) {
  (void)goal, (void)side;
  const csr_system *s = data;
  const double *r = N_VGetArrayPointer(residual), *d = inverse;
  double *z = N_VGetArrayPointer(to);
  for (int32_t i = 0; i < s->n; i += 3, d += 9) {
    z[i] = d[0] * r[i] + d[1] * r[i + 1] + d[2] * r[i + 2];
    z[i + 1] = d[3] * r[i] + d[4] * r[i + 1] + d[5] * r[i + 2];
    z[i + 2] = d[6] * r[i] + d[7] * r[i + 1] + d[8] * r[i + 2];
  }
  return 0;
}

/*------------------------------------- the solver -----------------------------------------------*/

static void free_sundials_objects(void) {
  if (pcg) SUNLinSolFree(pcg);
  if (x) N_VDestroy(x);
  if (b) N_VDestroy(b);
  free(blocks);
  free(inverse);
  pcg = NULL, x = b = NULL, blocks = inverse = NULL;
}

static double euclidean_norm(int32_t n, const double *v) {
  double sum = 0;
  for (int32_t i = 0; i < n; i++) sum += v[i] * v[i];
  return sqrt(sum);
}

static int sundials_reference_prepare(const csr_system *system) {
  free_sundials_objects();
  given = system;
  if (!context && SUNContext_Create(SUN_COMM_NULL, &context) != 0) return 0;
  const size_t n = (size_t)system->n;
  blocks = malloc((size_t)system->rowptr[n] * sizeof *blocks);
  inverse = malloc(3 * n * sizeof *inverse);
  x = N_VNew_Serial(system->n, context);
  b = N_VNew_Serial(system->n, context);
  if (!blocks || !inverse || !x || !b) return 0;
  memcpy(N_VGetArrayPointer(b), system->b, n * sizeof(double));
  copy_blocks(system);
  tolerance = system->rtol * euclidean_norm(system->n, system->b); /* it takes an absolute one */
  pcg = SUNLinSol_PCG(x, SUN_PREC_LEFT, system->max_iterations, context);
  return pcg && SUNLinSolSetATimes(pcg, (void *)system, multiply_rows) == 0 &&
         SUNLinSolSetPreconditioner(pcg, (void *)system, NULL, apply_block_jacobi) == 0 &&
         SUNLinSolInitialize(pcg) == 0;
}

static int sundials_reference_solve(int variant, double *solution, reference_reply *reply) {
  const size_t bytes = (size_t)given->n * sizeof(double);
  SUNLinSolSetATimes(pcg, (void *)given, variant == ROWS ? multiply_rows : multiply_blocks);
  memset(N_VGetArrayPointer(x), 0, bytes);
  double start = clock_seconds();
  invert_diagonal(given);
  SUNLinSolSetup(pcg, NULL);
  double ready = clock_seconds();
  SUNLinSolSetZeroGuess(pcg, 1);
  int status = SUNLinSolSolve(pcg, NULL, x, b, tolerance);
  reply->solve_s = clock_seconds() - ready;
  reply->factor_s = ready - start;
  reply->iterations = SUNLinSolNumIters(pcg);
  memcpy(solution, N_VGetArrayPointer(x), bytes);
  if (status)
    snprintf(reply->reason, sizeof reply->reason, "SUNDIALS failed with status %d", status);
  return status == 0;
}

const reference_solver solver = {.hello = {.library = "SUNDIALS " SUNDIALS_VERSION,
                                           .nvariants = REFERENCE_VARIANTS,
                                           .variants = {"stock 3x3", "stock csr"}},
                                 .prepare = sundials_reference_prepare,
                                 .solve = sundials_reference_solve};
