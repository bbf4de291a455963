/* error_control - options and comparisons for runs under error control (option tol) */
#ifndef TEST_ERROR_CONTROL_H
#define TEST_ERROR_CONTROL_H

#include <math.h>
#include <string.h>

#include "scenes.h"

enum { SIDE = 5, N = SIDE * SIDE };

static inline msim_options control_options(const char *method, double tol, double t_end) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = t_end, opt.solver = "pcg";
  return opt;
}

/* 1 if the method takes the option tol. */
static inline int takes_tol(const char *method) {
  static const char *const without[] = {"verlet", "respa", "takahashi-imada"};
  for (size_t i = 0; i < sizeof without / sizeof *without; i++)
    if (strcmp(method, without[i]) == 0) return 0;
  return 1;
}

/* Root mean square of the distances between the particles of two states. */
static inline double rms_distance(const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < 3 * N; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sqrt(sum / N);
}

static inline void same_state(msim_sim *a, msim_sim *b) {
  const msim_state s = state_of(a), t = state_of(b);
  assert_int_equal(s.step, t.step);
  assert_true(s.t == t.t);
  expect_same_motion(a, b);
}

#endif
