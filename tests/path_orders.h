/* path_orders - methods with which a particle without springs follows its own path, of order 2 */
#ifndef TEST_PATH_ORDERS_H
#define TEST_PATH_ORDERS_H

#include <math.h>

#include "testing.h"

static const char *const path_methods[] = {"velocity-verlet",  "heun", "rk4", "rkn6", "dop853",
                                           "implicit-midpoint"};
enum { NMETHODS = sizeof path_methods / sizeof *path_methods };

/* Errors at n, 2n, ... decrease with at least order `least` on average. */
static inline void expect_order(const char *label, const double *error, int count, double least) {
  const double order = log2(error[0] / error[count - 1]) / (count - 1);
  if (!(order >= least))
    fail_msg("%s: order %.2f, from %g to %g", label, order, error[0], error[count - 1]);
}

#endif
