/* Tests of the coefficients of rk6: they satisfy all conditions of order 6, those of the estimate
 * the conditions of order 5, and sums and products that are tabulated are those of the others. */
#include <math.h>
#include <string.h>

#include "../tools/bench_reference/amplification.h"
#include "methods/rk6_table.h"
#include "testing.h"

enum { ORDER = 6 };

/* A rooted tree of n nodes as the levels of its nodes in preorder, the root's is 0 */
typedef struct tree {
  int n, level[ORDER];
} tree;

static int parent_of(const tree *t, int node) {
  int p = node - 1;
  while (t->level[p] >= t->level[node]) p--;
  return p;
}

/* The next one of all trees of n nodes, which begin with a chain; 0: there is none (Beyer and
 * Hedetniemi, SIAM J. Comput. 9 (1980) 706) */
static int go_to_next(tree *t) {
  int last = t->n - 1;
  while (last > 0 && t->level[last] <= 1) last--;
  if (last <= 0) return 0;
  const int back = last - parent_of(t, last);
  for (int i = last; i < t->n; i++) t->level[i] = t->level[i - back];
  return 1;
}

/* The residual of the condition sum_i b_i phi_i = 1/gamma of the tree: phi of a node is the product
 * of A phi of its children, gamma the product of the sizes of all subtrees (Butcher 1963). */
static double residual_of(const tree *t, const double b[STAGES]) {
  double phi[ORDER][STAGES], gamma = 1, sum = 0;
  int size[ORDER];
  for (int k = 0; k < t->n; k++) {
    size[k] = 1;
    for (int i = 0; i < STAGES; i++) phi[k][i] = 1;
  }
  for (int k = t->n - 1; k >= 0; k--) {
    gamma *= size[k];
    if (k == 0) break;
    const int p = parent_of(t, k);
    size[p] += size[k];
    for (int i = 0; i < STAGES; i++) {
      double product = 0;
      for (int j = 0; j < i; j++) product += A[i][j] * phi[k][j];
      phi[p][i] *= product;
    }
  }
  for (int i = 0; i < STAGES; i++) sum += b[i] * phi[0][i];
  return fabs(sum - 1 / gamma);
}

static int count_trees(int n, const double b[STAGES], double *largest) {
  tree t = {.n = n};
  int count = 0;
  for (int i = 0; i < n; i++) t.level[i] = i;
  *largest = 0;
  do {
    *largest = fmax(*largest, residual_of(&t, b));
    count++;
  } while (go_to_next(&t));
  return count;
}

static void conditions_of_order_are_met(void **state) {
  (void)state;
  static const int trees[ORDER + 1] = {0, 1, 1, 2, 4, 9, 20};
  double estimate[STAGES], largest;
  for (int i = 0; i < STAGES; i++) estimate[i] = A[RESULT][i] - E[i];
  for (int n = 1; n <= ORDER; n++) {
    assert_int_equal(count_trees(n, A[RESULT], &largest), trees[n]);
    assert_true(largest < 1e-15);
    count_trees(n, estimate, &largest);
    print_message("  order %d: the estimate is off by %.2g\n", n, largest);
    assert_true(n < ORDER ? largest < 1e-15 : largest > 1e-6);
  }
}

static void sums_and_products_are_those_of_the_table(void **state) {
  (void)state;
  for (int i = 0; i < STAGES; i++) {
    double sum = 0;
    for (int j = 0; j < STAGES; j++) {
      double product = 0, in_estimate = 0;
      sum += A[i][j];
      for (int k = 0; k < STAGES; k++) product += A[i][k] * A[k][j], in_estimate += E[k] * A[k][j];
      assert_true(fabs(product - AA[i][j]) < 1e-15);
      assert_true(fabs(in_estimate - EE[j]) < 1e-15);
      if (j >= i) assert_true(A[i][j] == 0 && AA[i][j] == 0);
    }
    assert_true(fabs(sum - C[i]) < 1e-15);
  }
}

/* The benchmarks' theory has the polynomial of stability, b A^(k-1) 1. */
static void the_polynomial_is_that_of_the_theory(void **state) {
  (void)state;
  double power[STAGES];
  for (int i = 0; i < STAGES; i++) power[i] = 1;
  for (int k = 1; k <= RESULT; k++) {
    double sum = 0, next[STAGES] = {0};
    for (int i = 0; i < STAGES; i++) {
      sum += A[RESULT][i] * power[i];
      for (int j = 0; j < i; j++) next[i] += A[i][j] * power[j];
    }
    assert_true(
        fabs(sum / (k <= ORDER ? 1 / tgamma(k + 1) : amplification_rk6_terms[k - ORDER - 1]) - 1) <
        1e-13);
    memcpy(power, next, sizeof power);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(conditions_of_order_are_met),
                                     cmocka_unit_test(sums_and_products_are_those_of_the_table),
                                     cmocka_unit_test(the_polynomial_is_that_of_the_theory)};
  return cmocka_run_group_tests_name("rk6", tests, NULL, NULL);
}
