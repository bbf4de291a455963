/* Numbers that no step may go on with are found wherever they stand, and no others. */
#include <math.h>
#include <stdlib.h>

#include "base/vector.h"
#include "testing.h"

enum { ROWS = 37, STRIDE = 48, MOST = 3 * STRIDE };

static void bad_numbers_are_found(void **state) {
  (void)state;
  const double bad[] = {NAN, INFINITY, -INFINITY, nextafter(MS_HUGE, INFINITY), -1e300};
  const double fine[] = {MS_HUGE, -MS_HUGE, 0.0, 5e-324, 1e100};
  double x[MOST];
  for (int32_t dims = 2; dims <= 3; dims++)
    for (int32_t at = 0; at < dims * STRIDE; at++)
      for (int i = 0; i < 5; i++) {
        const ms_shape shape = {ROWS, STRIDE, dims};
        const int counts = at % STRIDE < ROWS; /* what stands behind the rows does not */
        for (int q = 0; q < MOST; q++) x[q] = 0.5;
        x[at] = bad[i];
        assert_int_equal(ms_find_bad(shape, x), counts ? at % STRIDE : -1);
        x[at] = fine[i];
        assert_int_equal(ms_find_bad(shape, x), -1);
      }
  for (int q = 0; q < MOST; q++) x[q] = q % 2 ? MS_HUGE : -MS_HUGE;
  assert_int_equal(ms_find_bad((ms_shape){ROWS, STRIDE, 3}, x), -1);
  assert_int_equal(ms_find_bad((ms_shape){0, STRIDE, 3}, x), -1);
}

static void the_largest_is_found(void **state) {
  (void)state;
  const ms_shape shape = {3, 4, 2};
  const double x[8] = {1, -2, 2, 9, 0, 1, -2, 9}; /* row 3 is no row */
  assert_int_equal(ms_find_largest(shape, x), 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bad_numbers_are_found),
                                     cmocka_unit_test(the_largest_is_found)};
  return cmocka_run_group_tests_name("vector", tests, NULL, NULL);
}
