#include "problem.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/*------------------------------------- numbers --------------------------------------------------*/

/* Uniform in [-1, 1), by SplitMix64 (Steele, Lea and Flood 2014). */
static double draw(uint64_t *state) {
  uint64_t z = *state += 0x9e3779b97f4a7c15u;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
  z = (z ^ z >> 27) * 0x94d049bb133111ebu;
  return (double)((z ^ z >> 31) >> 11) * 0x1p-52 - 1;
}

double *random_vector(int32_t n, uint64_t seed) {
  double *x = malloc(((size_t)n + 1) * sizeof *x);
  for (int32_t i = 0; i < n; i++) x[i] = draw(&seed);
  return x;
}

/*------------------------------------- entries --------------------------------------------------*/

static problem *create(int32_t n, int32_t block) {
  problem *p = calloc(1, sizeof *p);
  p->n = n, p->block = block;
  return p;
}

void problem_free(problem *p) {
  free(p->entries);
  free(p);
}

static void add(problem *p, int32_t row, int32_t column, double value) {
  if (p->count == p->capacity) {
    p->capacity = 2 * p->capacity + 64;
    p->entries = realloc(p->entries, (size_t)p->capacity * sizeof *p->entries);
  }
  const int32_t first = row < column ? row : column, second = row < column ? column : row;
  p->entries[p->count++] = (entry){first, second, value, 0};
}

/* A spring between the block rows i and j with K = k w w^T + t I: + K on the diagonal, - K off
 * it. */
static void add_spring(problem *p, int32_t i, int32_t j, double k, double t, const double *w) {
  const int32_t m = p->block;
  for (int32_t r = 0; r < m; r++)
    for (int32_t c = 0; c < m; c++) {
      const double value = k * w[r] * w[c] + (r == c ? t : 0);
      add(p, m * i + r, m * j + c, -value);
      if (r > c) continue;
      add(p, m * i + r, m * i + c, value);
      add(p, m * j + r, m * j + c, value);
    }
}

/*------------------------------------- kinds ----------------------------------------------------*/

problem *random_dominant(int32_t n, int32_t block, uint64_t seed) {
  problem *p = create(n, block);
  double *sum = calloc((size_t)(block * n), sizeof *sum);
  for (int32_t i = 0; i < n; i++)
    for (int32_t hop = 1; i + hop < n && hop <= 40; hop = 3 * hop + i % 3) {
      const int32_t j = i + hop;
      for (int32_t r = block * i; r < block * (i + 1); r++)
        for (int32_t c = block * j; c < block * (j + 1); c++) {
          const double value = draw(&seed);
          add(p, r, c, value);
          sum[r] += fabs(value), sum[c] += fabs(value);
        }
    }
  for (int32_t r = 0; r < block * n; r++) {
    for (int32_t c = r + 1; c % block != 0; c++) {
      const double value = draw(&seed);
      add(p, r, c, value);
      sum[r] += fabs(value), sum[c] += fabs(value);
    }
  }
  for (int32_t r = 0; r < block * n; r++) add(p, r, r, sum[r] + 1.5 + 0.5 * draw(&seed));
  free(sum);
  return p;
}

/* A net of about sqrt(n) columns with springs along and across; the diagonal has the mass of each
 * row. */
static problem *net(int32_t n, int32_t block, uint64_t seed, double (*mass)(int32_t row)) {
  problem *p = create(n, block);
  const int32_t columns = (int32_t)ceil(sqrt(n)), hops[2] = {1, columns};
  for (int32_t r = 0; r < block * n; r++) add(p, r, r, mass(r / block));
  for (int32_t k = 0; k < 2 * n; k++) {
    const int32_t i = k / 2, j = i + hops[k % 2];
    if (j >= n || (k % 2 == 0 && j % columns == 0)) continue;
    const double w[3] = {draw(&seed), draw(&seed), draw(&seed)};
    add_spring(p, i, j, 50, 5, w);
  }
  return p;
}

static double equal_mass(int32_t row) {
  (void)row;
  return 0.05;
}

/* 1e-4, 1e5, 1e-4, ... */
static double unequal_mass(int32_t row) { return row % 2 ? 1e5 : 1e-4; }

problem *spring_net(int32_t n, int32_t block, uint64_t seed) {
  return net(n, block, seed, equal_mass);
}

problem *unequal_masses(int32_t n, int32_t block, uint64_t seed) {
  return net(n, block, seed, unequal_mass);
}

problem *one_negative(int32_t n, int32_t block, uint64_t seed) {
  problem *p = spring_net(n, block, seed);
  add(p, block * (n / 2), block * (n / 2), -1000);
  return p;
}

problem *strong_coupling(int32_t n, int32_t block, uint64_t seed) {
  problem *p = create(n, block);
  (void)seed;
  for (int32_t r = 0; r < block * n; r++) add(p, r, r, 1);
  for (int32_t r = 0; r < block * (n - 1); r++) add(p, r, r + block, 1.2);
  return p;
}

problem *negative_definite(int32_t n, int32_t block, uint64_t seed) {
  return scale_values(spring_net(n, block, seed), -1);
}

problem *free_chain(int32_t n, int32_t block, uint64_t seed) {
  problem *p = create(n, block);
  (void)seed;
  for (int32_t r = 0; r < block * n; r++) add(p, r, r, 0);
  for (int32_t i = 0; i + 1 < n; i++) add_spring(p, i, i + 1, 0, 1, (const double[3]){0});
  return p;
}

problem *zero_row(int32_t n, int32_t block, uint64_t seed) {
  problem *p = create(n, block);
  (void)seed;
  for (int32_t r = 0; r < block * n; r++) add(p, r, r, r == block * n / 2 ? 0 : 1);
  return p;
}

problem *badly_scaled(int32_t n, int32_t block, uint64_t seed) {
  problem *p = random_dominant(n, block, seed);
  double *d = random_vector(unknowns(p), seed + 1);
  for (int32_t r = 0; r < unknowns(p); r++) d[r] = pow(10, 6 * d[r]);
  for (int32_t e = 0; e < p->count; e++)
    p->entries[e].value *= d[p->entries[e].row] * d[p->entries[e].column];
  free(d);
  return p;
}

problem *small_pivots(int32_t n, int32_t block, uint64_t seed) {
  static const double L[3][3] = {{1, 0, 0}, {1, 1e-4, 0}, {0, 1, 1}};
  problem *p = create(n, block);
  (void)seed;
  for (int32_t r = 0; r < block * n; r++)
    for (int32_t c = r; c < block * n && c / 3 == r / 3; c++)
      for (int k = 0; k < 3; k++) add(p, r, c, L[r % 3][k] * L[c % 3][k]);
  return p;
}

problem *set_diagonal(problem *p, double value) {
  for (int32_t e = 0; e < p->count; e++)
    if (p->entries[e].row == p->entries[e].column) p->entries[e].value = value;
  return p;
}

problem *add_skew_part(problem *p, uint64_t seed) {
  for (int32_t e = 0; e < p->count; e++)
    if (p->entries[e].row != p->entries[e].column)
      p->entries[e].skew = 0.5 * draw(&seed) * p->entries[e].value;
  return p;
}

problem *scale_values(problem *p, double factor) {
  for (int32_t e = 0; e < p->count; e++) p->entries[e].value *= factor;
  return p;
}

/*------------------------------------- products and norms ---------------------------------------*/

void problem_apply(const problem *p, const double *x, double *y) {
  memset(y, 0, (size_t)unknowns(p) * sizeof *y);
  for (int32_t e = 0; e < p->count; e++) {
    const entry *a = &p->entries[e];
    y[a->row] += (a->value + a->skew) * x[a->column];
    if (a->row != a->column) y[a->column] += (a->value - a->skew) * x[a->row];
  }
}

/* In place, by Gauss-Jordan elimination; 0 if a pivot is not positive. */
static int invert(int32_t m, double *a) {
  for (int32_t k = 0; k < m; k++) {
    const double pivot = a[m * k + k];
    if (!(pivot > 0)) return 0;
    a[m * k + k] = 1;
    for (int32_t c = 0; c < m; c++) a[m * k + c] /= pivot;
    for (int32_t i = 0; i < m; i++) {
      const double f = a[m * i + k];
      if (i == k) continue;
      a[m * i + k] = 0;
      for (int32_t c = 0; c < m; c++) a[m * i + c] -= f * a[m * k + c];
    }
  }
  return 1;
}

void problem_invert_blocks(const problem *p, double *inverse) {
  const int32_t m = p->block;
  memset(inverse, 0, (size_t)(m * m * p->n) * sizeof *inverse);
  for (int32_t e = 0; e < p->count; e++) {
    const entry *a = &p->entries[e];
    if (a->row / m != a->column / m) continue;
    double *block = inverse + m * m * (a->row / m);
    block[m * (a->row % m) + a->column % m] += a->value;
    if (a->row != a->column) block[m * (a->column % m) + a->row % m] += a->value;
  }
  for (int32_t i = 0; i < p->n; i++) {
    double *block = inverse + m * m * i;
    if (invert(m, block)) continue;
    for (int32_t c = 0; c < m * m; c++) block[c] = c % (m + 1) == 0;
  }
}

/* sqrt(r.D^-1 r) */
static long double norm(const problem *p, const double *inverse, const long double *r) {
  const int32_t m = p->block;
  long double sum = 0;
  for (int32_t i = 0; i < p->n; i++)
    for (int32_t c = 0; c < m * m; c++)
      sum += inverse[m * m * i + c] * r[m * i + c / m] * r[m * i + c % m];
  return sqrtl(fmaxl(0, sum));
}

/* residual, right: of b - A y and b in the norm of the blocks; left, size: of b - A y and |A| |y| +
 * |b| in the 2-norm. */
typedef struct norms {
  long double residual, right, left, size;
} norms;

static norms measure(const problem *p, const double *b, const double *y) {
  const size_t n = (size_t)unknowns(p);
  long double *r = calloc(3 * n + 1, sizeof *r), *size = r + n, *right = r + 2 * n;
  double *inverse = malloc((size_t)p->block * n * sizeof *inverse + 1);
  for (size_t i = 0; i < n; i++) r[i] = right[i] = b[i], size[i] = fabsl(b[i]);
  for (int32_t e = 0; e < p->count; e++) {
    const entry *a = &p->entries[e];
    const long double upper = a->value + a->skew, lower = a->value - a->skew;
    r[a->row] -= upper * y[a->column], size[a->row] += fabsl(upper * y[a->column]);
    if (a->row == a->column) continue;
    r[a->column] -= lower * y[a->row], size[a->column] += fabsl(lower * y[a->row]);
  }
  problem_invert_blocks(p, inverse);
  norms all = {.residual = norm(p, inverse, r), .right = norm(p, inverse, right)};
  for (size_t i = 0; i < n; i++) all.left += r[i] * r[i], all.size += size[i] * size[i];
  free(r), free(inverse);
  return all;
}

static double quotient(long double a, long double b) { return a == 0 ? 0 : (double)(a / b); }

double residual(const problem *p, const double *b, const double *y) {
  const norms m = measure(p, b, y);
  return quotient(m.residual, m.right);
}

double backward_error(const problem *p, const double *b, const double *y) {
  const norms m = measure(p, b, y);
  return quotient(sqrtl(m.left), sqrtl(m.size));
}
