/* Tests of the vector arithmetic of each instruction set of this CPU: sums have the same bits, and
 * numbers with which no step may continue are found at any position, and no others. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/isa.h"
#include "base/vector.h"
#include "testing.h"

enum { ROWS = 37, STRIDE = 48, MOST = 3 * STRIDE };

static void bad_numbers_are_found(void **state) {
  (void)state;
  const double bad[] = {NAN, INFINITY, -INFINITY, nextafter(MS_LARGEST_VALID, INFINITY), -1e300};
  const double fine[] = {MS_LARGEST_VALID, -MS_LARGEST_VALID, 0.0, 5e-324, 1e100};
  double x[MOST];
  for (int k = 0; k < 2 * (ms_isa_choose() + 1); k++) {
    const ms_shape shape = {ROWS, STRIDE, 2 + k % 2, k / 2, 0, NULL};
    for (int32_t at = 0; at < shape.dims * STRIDE; at++)
      for (int i = 0; i < 5; i++) {
        const int counts = at % STRIDE < ROWS; /* padding does not count */
        for (int q = 0; q < MOST; q++) x[q] = 0.5;
        x[at] = bad[i];
        assert_int_equal(ms_vector_find_invalid(shape, x), counts ? at % STRIDE : -1);
        x[at] = fine[i];
        assert_int_equal(ms_vector_find_invalid(shape, x), -1);
      }
    for (int q = 0; q < MOST; q++) x[q] = q % 2 ? MS_LARGEST_VALID : -MS_LARGEST_VALID;
    assert_int_equal(ms_vector_find_invalid(shape, x), -1);
    assert_int_equal(ms_vector_find_invalid((ms_shape){0, STRIDE, 3, k / 2, 0, NULL}, x), -1);
  }
}

/* Terms are added in their order, row by row; padding is not changed. The sum may replace x or a
 * term. */
static void sums_have_the_same_bits(void **state) {
  enum { TERMS = 5, X = TERMS, NOWHERE };
  double y[TERMS + 1][MOST], z[TERMS + 2][MOST], w[TERMS];
  const double *of[TERMS];
  (void)state;
  for (int k = 0; k <= TERMS; k++)
    for (int q = 0; q < MOST; q++)
      y[k][q] = (k == X ? 1e3 : 1) * ms_vector_random_entry((uint32_t)(k * MOST + q));
  for (int k = 0; k < TERMS; k++) w[k] = ms_vector_random_entry((uint32_t)k), of[k] = z[k];
  for (int isa = 0; isa <= (int)ms_isa_choose(); isa++)
    for (int32_t rows = 0; rows <= ROWS; rows++)
      for (int to = 0; to <= NOWHERE; to++) {
        const int is_added = to == X || rows % 2;
        memcpy(z, y, sizeof y);
        for (int q = 0; q < MOST; q++) z[NOWHERE][q] = -1;
        ms_vector_linear_combination((ms_shape){rows, STRIDE, 3, isa, 0, NULL},
                                     is_added ? z[X] : NULL, TERMS, w, of, z[to]);
        for (int q = 0; q < MOST; q++) {
          double sum = 0;
          for (int i = 0; i < TERMS; i++) sum += w[i] * y[i][q];
          const double before = to == NOWHERE ? -1 : y[to][q];
          const double expected = q % STRIDE >= rows ? before : is_added ? y[X][q] + sum : sum;
          assert_true(z[to][q] == expected);
        }
      }
}

/* Both have the bits that each has alone, also if one of them replaces a term. */
static void two_sums_are_those_of_each(void **state) {
  enum { TERMS = 5 };
  double y[TERMS][MOST], first[MOST], second[MOST], in[MOST], w[2][TERMS];
  const double *of[TERMS];
  (void)state;
  for (int isa = 0; isa <= (int)ms_isa_choose(); isa++)
    for (int32_t rows = 0; rows <= ROWS; rows++) {
      const ms_shape shape = {rows, STRIDE, 3, isa, 0, NULL};
      for (int k = 0; k < TERMS; k++) {
        for (int j = 0; j < 2; j++) w[j][k] = ms_vector_random_entry((uint32_t)(2 * k + j));
        of[k] = y[k];
        for (int q = 0; q < MOST; q++) y[k][q] = ms_vector_random_entry((uint32_t)(k * MOST + q));
      }
      for (int q = 0; q < MOST; q++) first[q] = second[q] = in[q] = -1;
      ms_vector_linear_combination(shape, y[2], TERMS, w[0], of, first);
      ms_vector_linear_combination(shape, NULL, TERMS, w[1], of, second);
      const ms_combination sums[2] = {{y[2], w[0], in}, {NULL, w[1], y[3]}};
      ms_vector_two_combinations(shape, TERMS, of, sums);
      for (int q = 0; q < MOST; q++)
        assert_true(in[q] == first[q] && (q % STRIDE >= rows || y[3][q] == second[q]));
    }
}

/* Vectors of 3 components with, if they are single, those of the errors behind them; all numbers
 * are written, so that padding is seen, too. */
typedef union numbers {
  double of[MOST];
  float singles[2 * MOST];
} numbers;

static void fill(int single, uint32_t first, numbers *x) {
  for (uint32_t q = 0; q < (single ? 2 : 1) * MOST; q++) {
    const double entry = ms_vector_random_entry(first + q);
    if (single) x->singles[q] = (float)(q < MOST ? entry : 1e-8 * entry);
    else x->of[q] = entry;
  }
}

/* All loops of one instruction set, one after the other; the sum is that of the dot products. */
static double run_loops(ms_shape shape, numbers v[4]) {
  ms_vector_scale(shape, 1.1, v[0].of);
  ms_vector_axpy(shape, -0.7, v[0].of, v[1].of);
  ms_vector_add_scaled(shape, v[1].of, 0.3, v[2].of, v[2].of);
  ms_vector_add_two_scaled(shape, v[2].of, 0.9, v[0].of, -1.3, v[1].of, v[3].of);
  ms_vector_three_term(shape, v[3].of, 0.6, v[1].of, 0.2, v[2].of, 0.1, v[0].of, v[1].of);
  return ms_vector_dot(shape, v[1].of, v[2].of) - ms_vector_dot(shape, v[3].of, v[3].of);
}

static void loops_have_the_bits_of_the_baseline(void **state) {
  (void)state;
  numbers expected[4], v[4];
  for (int k = 0; k < 2 * (ms_isa_choose() + 1); k++)
    for (int32_t rows = 0; rows <= ROWS; rows++) {
      const int single = k % 2;
      for (uint32_t i = 0; i < 4; i++) fill(single, 1000 * i, &expected[i]);
      memcpy(v, expected, sizeof v);
      const double sum = run_loops((ms_shape){rows, STRIDE, 3, 0, single, NULL}, expected);
      assert_true(run_loops((ms_shape){rows, STRIDE, 3, k / 2, single, NULL}, v) == sum);
      assert_memory_equal(v, expected, sizeof v);
    }
}

/* y = y0 + a (y1 - y0) + b (y2 - y0) + c f and the others, number by number */
static void loops_compute_their_formulas(void **state) {
  (void)state;
  const double x = 0.3, y = -0.4, z = 0.7, f = 0.9;
  const ms_shape shape = {1, 1, 1, ms_isa_choose(), 0, NULL};
  double to = x;
  ms_vector_scale(shape, 1.1, &to);
  assert_true(to == x * 1.1);
  to = y;
  ms_vector_axpy(shape, 2, &x, &to);
  assert_true(to == y + 2 * x);
  ms_vector_add_scaled(shape, &x, 3, &y, &to);
  assert_true(to == x + 3 * y);
  ms_vector_add_two_scaled(shape, &x, 3, &y, 5, &z, &to);
  assert_true(to == x + (3 * y + 5 * z));
  ms_vector_three_term(shape, &x, 3, &y, 5, &z, 7, &f, &to);
  assert_true(to == x + (3 * (y - x) + 5 * (z - x) + 7 * f));
  assert_true(ms_vector_dot(shape, &x, &y) == x * y);
}

static void the_largest_is_found(void **state) {
  (void)state;
  const ms_shape shape = {.n = 3, .stride = 4, .dims = 2};
  const double x[8] = {1, -2, 2, 9, 0, 1, -2, 9}; /* row 3 is padding */
  assert_int_equal(ms_vector_find_largest(shape, x), 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bad_numbers_are_found),
                                     cmocka_unit_test(sums_have_the_same_bits),
                                     cmocka_unit_test(two_sums_are_those_of_each),
                                     cmocka_unit_test(loops_have_the_bits_of_the_baseline),
                                     cmocka_unit_test(loops_compute_their_formulas),
                                     cmocka_unit_test(the_largest_is_found)};
  return cmocka_run_group_tests_name("vector", tests, NULL, NULL);
}
