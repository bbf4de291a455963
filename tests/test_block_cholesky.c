/* Tests of the sparse block Cholesky factorization against dense sums: pattern, factor, solutions,
 * indefinite matrices, memory. */
#include "linear/block_cholesky.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/isa.h"
#include "scene_check.h"

enum { GRID, STAR, COMPLETE, ISOLATED, RANDOM_GRAPH };

/* A symmetric positive definite matrix: the sum over all edges of E E^T, E = (E_i, -E_j) with
 * random blocks, plus 1e-3 I. */
typedef struct matrix {
  int32_t n, block, size; /* size = n block */
  uint8_t *linked;        /* n x n */
  int32_t *ptr, *ind;
  double *A; /* size x size, row by row */
} matrix;

static const msim_allocator *libc_memory(void) {
  static msim_allocator alloc;
  alloc = ms_memory_allocator(NULL);
  return &alloc;
}

static int is_linked(int kind, int32_t i, int32_t j, unsigned *seed) {
  enum { WIDTH = 14 };
  switch (kind) {
    case GRID:
      return j == i + WIDTH || (j == i + 1 && j % WIDTH);
    case STAR:
      return i == 0;
    case COMPLETE:
      return 1;
    case RANDOM_GRAPH:
      return uniform(seed) < 0.02;
    default:
      return 0;
  }
}

/* A += E E^T of one edge */
static void add_edge(matrix *m, int32_t i, int32_t j, unsigned *seed) {
  const int32_t b = m->block;
  double e[2][MS_BLOCK_CHOLESKY_MAX_BLOCK][MS_BLOCK_CHOLESKY_MAX_BLOCK];
  for (int32_t k = 0; k < 2 * b * b; k++) e[k % 2][k / 2 / b][k / 2 % b] = uniform(seed) - 0.5;
  for (int32_t at = 0; at < 4 * b * b; at++) {
    const int32_t p = at / b / b / 2, q = at / b / b % 2, r = at / b % b, c = at % b;
    double sum = 0;
    for (int32_t k = 0; k < b; k++) sum += e[p][r][k] * e[q][c][k];
    m->A[(b * (p ? j : i) + r) * m->size + b * (q ? j : i) + c] += p == q ? sum : -sum;
  }
}

static matrix make(int kind, int32_t n, int32_t block) {
  matrix m = {.n = n, .block = block, .size = n * block};
  unsigned seed = 5;
  int32_t edges = 0;
  m.linked = calloc((size_t)(n * n), 1);
  m.A = calloc((size_t)m.size * (size_t)m.size, sizeof *m.A);
  for (int32_t i = 0; i < m.size; i++) m.A[i * m.size + i] = 1e-3;
  for (int32_t i = 0; i < n; i++)
    for (int32_t j = i + 1; j < n; j++) {
      if (!is_linked(kind, i, j, &seed)) continue;
      m.linked[i * n + j] = m.linked[j * n + i] = 1, edges++;
      add_edge(&m, i, j, &seed);
    }
  m.ptr = calloc((size_t)n + 1, sizeof *m.ptr);
  m.ind = calloc(2 * (size_t)edges + 1, sizeof *m.ind);
  for (int32_t i = 0; i < n; i++) {
    m.ptr[i + 1] = m.ptr[i];
    for (int32_t j = 0; j < n; j++)
      if (m.linked[i * n + j]) m.ind[m.ptr[i + 1]++] = j;
  }
  return m;
}

static void free_matrix(matrix *m) { free(m->linked), free(m->ptr), free(m->ind), free(m->A); }

static ms_block_cholesky analyse(const matrix *m, int isa) {
  ms_block_cholesky chol;
  const ms_sparse_graph graph = {m->n, m->ptr, m->ind};
  assert_ok(ms_block_cholesky_create(libc_memory(), &graph, m->block, isa, INFINITY, &chol, err));
  chol.value = calloc(ms_block_cholesky_size(&chol), sizeof *chol.value);
  return chol;
}

static void discard(ms_block_cholesky *chol) {
  free(chol->value);
  ms_block_cholesky_destroy(libc_memory(), chol);
}

/* Entries that must not be read are NaN. */
static void fill(const matrix *m, ms_block_cholesky *chol) {
  const int32_t b = m->block;
  memset(chol->value, 0, (size_t)(b * b * chol->first[m->n]) * sizeof *chol->value);
  for (int32_t i = 0; i < m->n; i++)
    for (int32_t j = 0; j < m->n; j++) {
      if ((i != j && !m->linked[i * m->n + j]) || chol->position[i] < chol->position[j]) continue;
      double *to = chol->value + b * b * ms_block_cholesky_find(chol, i, j);
      for (int32_t at = 0; at < b * b; at++) {
        const int32_t r = at % b, c = at / b;
        to[at] = i == j && r < c ? NAN : m->A[(b * i + r) * m->size + b * j + c];
      }
    }
}

static void factor(const matrix *m, ms_block_cholesky *chol) {
  fill(m, chol);
  assert_int_equal(ms_block_cholesky_factor(chol), MSIM_OK);
}

/* ||A x - b|| / (||A|| ||x||) in the Frobenius norm: independent of the condition number */
static double backward_error(const matrix *m, const double *x, const double *b) {
  double aa = 0, xx = 0, rr = 0;
  for (int32_t i = 0; i < m->size; i++) {
    double r = -b[i];
    for (int32_t j = 0; j < m->size; j++) {
      const double a = m->A[i * m->size + j];
      r += a * x[j], aa += a * a;
    }
    rr += r * r, xx += x[i] * x[i];
  }
  return sqrt(rr / (aa * xx));
}

static double *random_vector(int32_t n) {
  double *v = calloc((size_t)n, sizeof *v);
  unsigned seed = 11;
  for (int32_t i = 0; i < n; i++) v[i] = uniform(&seed) - 0.5;
  return v;
}

/*------------------------------------- checks ---------------------------------------------------*/

/* Symbolic elimination in the chosen order, as in textbooks: find() finds exactly these blocks,
 * each once. */
static void check_pattern(const matrix *m, const ms_block_cholesky *chol) {
  const int32_t n = m->n;
  uint8_t *full = malloc((size_t)(n * n)), *met = calloc((size_t)chol->first[n], 1);
  int32_t *at = calloc((size_t)n, sizeof *at), blocks = 0;
  for (int32_t i = 0; i < n; i++) at[chol->position[i]] = i;
  memcpy(full, m->linked, (size_t)(n * n));
  for (int32_t k = 0; k < n; k++)
    for (int32_t i = k + 1; i < n; i++)
      for (int32_t j = k + 1; j < n && full[at[i] * n + at[k]]; j++)
        full[at[i] * n + at[j]] |= full[at[j] * n + at[k]];
  for (int32_t i = 0; i < n; i++)
    for (int32_t j = 0; j <= i; j++) {
      const int32_t b = ms_block_cholesky_find(chol, i, j);
      assert_int_equal(b, ms_block_cholesky_find(chol, j, i));
      assert_int_equal(b >= 0, i == j || full[i * n + j]);
      if (b < 0) continue;
      assert_in_range(b, 0, chol->first[n] - 1);
      assert_int_equal(met[b]++, 0);
      blocks++;
    }
  assert_int_equal(blocks, chol->first[n]);
  free(full), free(met), free(at);
}

/* L (L^T x) = A x with L as it is before it is rounded to single precision */
static void check_factor(const matrix *m, const ms_block_cholesky *chol) {
  const int32_t b = m->block;
  double *x = random_vector(m->size), *y = calloc((size_t)m->size, sizeof *y);
  double *Ax = calloc((size_t)m->size, sizeof *Ax);
  for (int32_t i = 0; i < m->n; i++)
    for (int32_t r = 0; r < b; r++)
      for (int32_t j = 0; j < m->size; j++)
        Ax[b * chol->position[i] + r] += m->A[(b * i + r) * m->size + j] * x[j];
  double *px = calloc((size_t)m->size, sizeof *px), *Lx = calloc((size_t)m->size, sizeof *Lx);
  for (int32_t i = 0; i < m->size; i++) px[b * chol->position[i / b] + i % b] = x[i];
  for (int pass = 0; pass < 2; pass++)
    for (int32_t k = 0; k < m->n; k++)
      for (int32_t e = chol->first[k]; e < chol->first[k + 1]; e++)
        for (int32_t at = 0; at < b * b; at++) {
          const int32_t row = b * chol->row[e] + at % b, column = b * k + at / b;
          if (row < column) continue;
          const double l = chol->value[b * b * e + at];
          if (pass == 0) y[column] += l * px[row];
          else Lx[row] += l * y[column];
        }
  for (int32_t i = 0; i < m->size; i++) assert_close(Lx[i], Ax[i], 1e-13 * m->size);
  free(x), free(y), free(Ax), free(px), free(Lx);
}

/* Dense, in double precision: x = A^-1 x; returns the quotient of the largest and the least
 * pivot. */
static double solve_dense(const matrix *m, double *x) {
  const int32_t n = m->size;
  double *l = malloc((size_t)n * (size_t)n * sizeof *l), largest = 0, least = INFINITY;
  memcpy(l, m->A, (size_t)n * (size_t)n * sizeof *l);
  for (int32_t j = 0; j < n; j++) {
    for (int32_t i = j; i < n; i++) {
      for (int32_t k = 0; k < j; k++) l[i * n + j] -= l[i * n + k] * l[j * n + k];
      l[i * n + j] /= i == j ? sqrt(l[i * n + i]) : l[j * n + j];
    }
    largest = fmax(largest, l[j * n + j]), least = fmin(least, l[j * n + j]);
  }
  for (int32_t i = 0; i < n; i++) {
    for (int32_t k = 0; k < i; k++) x[i] -= l[i * n + k] * x[k];
    x[i] /= l[i * n + i];
  }
  for (int32_t i = n - 1; i >= 0; i--) {
    for (int32_t k = i + 1; k < n; k++) x[i] -= l[k * n + i] * x[k];
    x[i] /= l[i * n + i];
  }
  free(l);
  return largest * largest / (least * least);
}

/* The residual is at the level of single precision; the error of x is that times the condition
 * number. */
static void check_solve(const matrix *m, const ms_block_cholesky *chol) {
  double *b = random_vector(m->size), *x = random_vector(m->size), *exact = random_vector(m->size);
  ms_block_cholesky_solve(chol, x);
  assert_close(backward_error(m, x, b), 0, FLT_EPSILON);
  if (m->size <= 500) {
    const double condition = solve_dense(m, exact);
    double apart = 0, size = 0;
    for (int32_t i = 0; i < m->size; i++)
      apart += (x[i] - exact[i]) * (x[i] - exact[i]), size += exact[i] * exact[i];
    assert_close(sqrt(apart / size), 0, FLT_EPSILON * condition);
  }
  free(b), free(x), free(exact);
}

static const struct {
  int kind;
  int32_t n;
} graphs[] = {{GRID, 200},   {STAR, 200},   {COMPLETE, 30}, {ISOLATED, 12}, {RANDOM_GRAPH, 100},
              {ISOLATED, 1}, {COMPLETE, 2}, {GRID, 30},     {STAR, 30}};

static void it_is_the_cholesky_factor(void **state) {
  (void)state;
  for (int32_t block = 8; block <= 12; block += 4)
    for (size_t g = 0; g < sizeof graphs / sizeof *graphs; g++) {
      matrix m = make(graphs[g].kind, graphs[g].n, block);
      ms_block_cholesky chol = analyse(&m, ms_isa_choose());
      check_pattern(&m, &chol);
      factor(&m, &chol);
      check_factor(&m, &chol);
      check_solve(&m, &chol);
      discard(&chol);
      free_matrix(&m);
    }
}

/* Minimum degree eliminates the hub last. */
static void a_star_fills_nothing(void **state) {
  (void)state;
  matrix m = make(STAR, 200, 8);
  ms_block_cholesky chol = analyse(&m, ms_isa_choose());
  assert_int_equal(chol.first[m.n], m.n + m.n - 1);
  discard(&chol);
  free_matrix(&m);
}

static void factors_that_are_too_large_are_not_created(void **state) {
  (void)state;
  matrix m = make(GRID, 60, 12);
  const ms_sparse_graph graph = {m.n, m.ptr, m.ind};
  ms_block_cholesky chol = analyse(&m, ms_isa_choose());
  const double size = (double)ms_block_cholesky_size(&chol);
  discard(&chol);
  for (int more = -1; more <= 1; more++) {
    assert_ok(ms_block_cholesky_create(libc_memory(), &graph, m.block, ms_isa_choose(), size + more,
                                       &chol, err));
    assert_int_equal(chol.n, more < 0 ? 0 : m.n);
    assert_true((double)ms_block_cholesky_size(&chol) == (more < 0 ? 0 : size));
    ms_block_cholesky_destroy(libc_memory(), &chol);
  }
  free_matrix(&m);
}

/* The matrix of many separate bodies of two block rows each. */
static double seconds_for_pairs(int32_t n) {
  int32_t *ptr = calloc((size_t)n + 1, sizeof *ptr), *ind = calloc((size_t)n, sizeof *ind);
  ms_block_cholesky chol;
  for (int32_t i = 0; i < n; i++) ptr[i + 1] = i + 1, ind[i] = i ^ 1;
  const clock_t start = clock();
  const ms_sparse_graph graph = {n, ptr, ind};
  assert_ok(
      ms_block_cholesky_create(libc_memory(), &graph, 8, ms_isa_choose(), INFINITY, &chol, err));
  const double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
  assert_int_equal(chol.first[n], n + n / 2);
  ms_block_cholesky_destroy(libc_memory(), &chol);
  free(ptr), free(ind);
  return seconds;
}

/* The least of several runs, as other programs use the machine. */
static double least_seconds_for_pairs(int32_t n) {
  double least = seconds_for_pairs(n);
  for (int i = 0; i < 4; i++) least = fmin(least, seconds_for_pairs(n));
  return least;
}

/* The time is linear: 16 times as many bodies take about 16 times as long, not 256 times. */
static void many_bodies_take_no_time(void **state) {
  (void)state;
  const double few = least_seconds_for_pairs(6250), many = least_seconds_for_pairs(100000);
  assert_close(many, 0, 64 * few + 0.1);
}

/*------------------------------------- refusals -------------------------------------------------*/

/* One pivot of -1, 0 or NaN, in any row: MSIM_NOT_SPD; the next factorization is not affected. */
static void what_is_not_positive_definite_is_refused(void **state) {
  (void)state;
  static const double pivots[] = {-1, 0, NAN};
  matrix m = make(GRID, 30, 12);
  ms_block_cholesky chol = analyse(&m, ms_isa_choose());
  for (int32_t i = 0; i < m.size; i += 7)
    for (size_t p = 0; p < 3; p++) {
      fill(&m, &chol);
      chol.value[144 * ms_block_cholesky_find(&chol, i / 12, i / 12) + 13 * (i % 12)] = pivots[p];
      assert_int_equal(ms_block_cholesky_factor(&chol), MSIM_NOT_SPD);
    }
  factor(&m, &chol);
  check_factor(&m, &chol);
  check_solve(&m, &chol);
  discard(&chol);
  free_matrix(&m);
}

/* Every diagonal block is positive definite, and the whole matrix is not. */
static void the_whole_matrix_is_examined(void **state) {
  (void)state;
  matrix m = make(COMPLETE, 2, 8);
  memset(m.A, 0, (size_t)(m.size * m.size) * sizeof *m.A);
  for (int beyond = 0; beyond < 2; beyond++) {
    for (int32_t i = 0; i < m.size; i++) m.A[i * m.size + i] = 1;
    m.A[2 * m.size + 13] = m.A[13 * m.size + 2] = beyond ? 1.001 : 0.999;
    ms_block_cholesky chol = analyse(&m, ms_isa_choose());
    fill(&m, &chol);
    assert_int_equal(ms_block_cholesky_factor(&chol), beyond ? MSIM_NOT_SPD : MSIM_OK);
    discard(&chol);
  }
  free_matrix(&m);
}

/*------------------------------------- bits and memory ------------------------------------------*/

static void expect_bits(const matrix *m, const ms_block_cholesky *p, const ms_block_cholesky *q) {
  const size_t blocks = (size_t)(m->block * m->block * p->first[m->n]);
  double *x = random_vector(m->size), *y = random_vector(m->size);
  assert_memory_equal(p->factor, q->factor, blocks * sizeof *p->factor);
  ms_block_cholesky_solve(p, x), ms_block_cholesky_solve(q, y);
  assert_memory_equal(x, y, (size_t)m->size * sizeof *x);
  free(x), free(y);
}

static void instruction_sets_agree(void **state) {
  (void)state;
  static const char *const sets[] = {"baseline", "avx2", "avx512"};
  for (int32_t block = 8; block <= 12; block += 4) {
    matrix m = make(RANDOM_GRAPH, 60, block);
    ms_block_cholesky first = analyse(&m, ms_isa_find("baseline"));
    factor(&m, &first);
    for (size_t i = 0; i < 3; i++) {
      if (ms_isa_find(sets[i]) < 0) continue; /* not supported by this CPU */
      ms_block_cholesky chol = analyse(&m, ms_isa_find(sets[i]));
      for (int repeat = 0; repeat < 2; repeat++) {
        factor(&m, &chol);
        expect_bits(&m, &first, &chol);
      }
      discard(&chol);
    }
    discard(&first);
    free_matrix(&m);
  }
}

static msim_status factor_within(const msim_allocator *alloc, void *data) {
  const matrix *m = data;
  const ms_sparse_graph graph = {m->n, m->ptr, m->ind};
  ms_block_cholesky chol;
  msim_error why = {0, ""};
  const msim_status status =
      ms_block_cholesky_create(alloc, &graph, m->block, ms_isa_choose(), INFINITY, &chol, &why);
  if (status) assert_non_null(strstr(why.text, "coarse"));
  ms_block_cholesky_destroy(alloc, &chol);
  return status;
}

static void memory_that_ends_is_reported(void **state) {
  (void)state;
  matrix m = make(GRID, 40, 8);
  assert_true(expect_memory_errors(factor_within, &m) >
              m.n); /* each row allocates at least one array */
  free_matrix(&m);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(it_is_the_cholesky_factor),
                                     cmocka_unit_test(a_star_fills_nothing),
                                     cmocka_unit_test(factors_that_are_too_large_are_not_created),
                                     cmocka_unit_test(many_bodies_take_no_time),
                                     cmocka_unit_test(what_is_not_positive_definite_is_refused),
                                     cmocka_unit_test(the_whole_matrix_is_examined),
                                     cmocka_unit_test(instruction_sets_agree),
                                     cmocka_unit_test(memory_that_ends_is_reported)};
  return cmocka_run_group_tests_name("block_cholesky", tests, NULL, NULL);
}
