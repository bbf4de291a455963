/* The oscillator x'' = -2 zeta w x' - w^2 x: a spring of rest length 0, which makes the force
 * linear. w = 1/s, so that h in seconds is z = h w. */
#include "stability_limits.h"

#include <math.h>
#include <stdio.h>

#include "../common/interrupt.h"
#include "msim/msim.h"
#include "../bench_reference/theory.h"

enum { MOST_SPRINGS = 9 };

/* Two particles with springs between them; pinned: the first one is. NULL: it cannot be made. */
static msim_sim *make_pair(const double x[6], const double v[6], const double mass[2], int springs,
                           const double *k, const double *rest, const double *damping, int pinned,
                           const msim_options *opt) {
  const int32_t first = 0;
  int32_t ij[2 * MOST_SPRINGS];
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  for (int e = 0; e < springs; e++) ij[2 * e] = 0, ij[2 * e + 1] = 1;
  if (!msim_scene_create(NULL, &scene, NULL) &&
      !msim_scene_add_particles(scene, 2, x, v, mass, NULL) &&
      !msim_scene_add_springs(scene, springs, ij, k, rest, damping, NULL) &&
      (!pinned || !msim_scene_pin(scene, 1, &first, NULL)))
    msim_sim_create(scene, opt, &sim, NULL);
  msim_scene_destroy(scene);
  return sim;
}

/* A particle of 1 kg at 1 m, on a spring of 1 N/m to a pinned one at the origin. The soft stiffness
 * is divided among 8 springs, so that short steps for the stiff one alone are cost-effective. */
static msim_sim *make_oscillator(const theory *t, double zeta, double z) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, rest[MOST_SPRINGS] = {0};
  double k[MOST_SPRINGS] = {1}, damping[MOST_SPRINGS] = {2 * zeta};
  msim_options opt;
  for (int e = 1; e < MOST_SPRINGS; e++) k[e] = t->soft / (MOST_SPRINGS - 1);
  msim_options_init(&opt, sizeof opt);
  opt.integrator = t->method, opt.h = z, opt.steps = 1000000000, opt.watch = MSIM_WATCH_OFF;
  opt.threads = 1, opt.solver_rtol = opt.newton_rtol = 1e-13;
  return make_pair(x, NULL, mass, t->soft > 0 ? MOST_SPRINGS : 1, k, rest, damping, 1, &opt);
}

/* Advances by `steps`. Returns ln of the largest amplitude over the last `period` steps; INFINITY
 * if the run fails. */
static double amplitude(msim_sim *sim, int64_t steps, int64_t period) {
  msim_state s = {.size = sizeof s};
  double size = 0;
  if (!sim) return NAN;
  if (msim_sim_step(sim, steps - period, NULL) != MSIM_OK) return INFINITY;
  for (int64_t i = 0; i <= period; i++) {
    if (i > 0 && msim_sim_step(sim, 1, NULL) != MSIM_OK) return INFINITY;
    msim_sim_state(sim, &s);
    size = fmax(size, hypot(s.x[3], s.v[3]));
  }
  return log(size);
}

static double amplitude_after(const theory *t, double zeta, double z, int64_t steps) {
  msim_sim *sim = make_oscillator(t, zeta, z);
  const double size = amplitude(sim, steps, 0);
  msim_sim_destroy(sim);
  return size;
}

/* Whether the amplitude grows from the first half of the steps to the second, by more than that
 * factor, whose logarithm is `least`; below e^-300 it is rounding error. */
static int amplitude_grows(const theory *t, double zeta, double z, double least, int64_t steps) {
  msim_sim *sim = make_oscillator(t, zeta, z);
  const double half = amplitude(sim, steps / 2, 64);
  const double whole = isfinite(half) ? amplitude(sim, steps / 2, 64) : half;
  msim_sim_destroy(sim);
  return whole == INFINITY || (whole > -300 && whole - half > least);
}

/* 1: stable steps reduce the amplitude, so that it grows beyond the limit alone. */
static int reduces_amplitude(const theory *t, double zeta, double limit) {
  return zeta > 0 || (t->step && theory_rate(t, 0.9 * limit) < -1e-7);
}

/* Bisects below a z at which the amplitude is known to grow; INFINITY: it does not. Where stable
 * steps keep the amplitude, it oscillates by less than a factor e^5. */
static double bisect_stability_limit(const theory *t, double zeta, double limit, double known,
                                     int quick) {
  const int64_t steps = quick ? 40000 : 100000;
  const double least = reduces_amplitude(t, zeta, limit) ? 0 : 5;
  double low = 0, high = known;
  if (!amplitude_grows(t, zeta, high, least, steps)) return INFINITY;
  for (int i = 0; i < (quick ? 15 : 18) && !is_interrupted(); i++) {
    const double z = (low + high) / 2;
    if (amplitude_grows(t, zeta, z, least, steps)) high = z;
    else low = z;
  }
  return (low + high) / 2;
}

static const column limit_columns[] = {
    {"method", "method", -24, NULL, 0},  {"springs", "springs", -14, NULL, 0},
    {"zeta", "zeta", 4, "%g", 0},        {"", "kind", -7, NULL, 0},
    {"theory", "theory", 12, "%.7g", 0}, {"found", "found", 12, "%.7g", 0},
    {"error", "error", 9, "%.2g", 0},    {.key = NULL}};

/* A decayed amplitude counts as 0; NAN stays NAN. */
static double decayed(double size) { return size < 0 ? 0 : size; }

/* A value that was not found has the error INFINITY. */
static double check_limit(const theory *t, int i, int quick, report *r) {
  const double z = 0.1;
  double found, peak, expected = theory_limit(t, i, &peak);
  const int is_rate = expected == 0, has_none = isinf(expected);
  if (is_rate) expected = theory_rate(t, z), found = amplitude_after(t, 0, z, 1000) / 1000;
  else if (has_none) expected = 0, found = decayed(amplitude_after(t, zetas[i], 100, 20));
  else found = bisect_stability_limit(t, zetas[i], expected, peak, quick);
  const double off = fabs(found - expected) / (expected > 0 ? expected : 1);
  const double error = isnan(off) ? INFINITY : off;
  const char *kind = is_rate ? "growth" : has_none ? "none" : "limit";
  const json_t *row = report_add_row(
      r, "limit",
      FIELDS(TEXT("method", t->method), TEXT("springs", t->soft > 0 ? "stiff and soft" : "one"),
             REAL("zeta", zetas[i]), TEXT("kind", kind), REAL("theory", expected),
             REAL("found", found), REAL("error", error)));
  print_row(limit_columns, row);
  return error;
}

double measure_limits(int quick, report *r) {
  const theory *t;
  double worst = 0;
  puts("\nlongest stable h w");
  print_titles(limit_columns);
  for (int m = 0; (t = theory_at(m)) != NULL; m++)
    for (int i = 0; i < (t->undamped ? 1 : DAMPING_RATIOS) && !is_interrupted(); i++)
      worst = fmax(worst, check_limit(t, i, quick, r));
  return worst;
}

/*------------------------------------- energy ---------------------------------------------------*/

/* Two bodies on a spring that rotate and translate: the relative changes of momentum (along y) and
 * angular momentum; -1: the run failed. */
static void measure_momentum_drift(const char *method, int64_t steps, double *linear,
                                   double *angular) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {1, 0, 0.5, 1, 3, 0.5}, mass[2] = {1, 2}, k = 100;
  msim_energy before = {.size = sizeof before}, after = {.size = sizeof after};
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.h = 0.001, opt.steps = steps, opt.newton_rtol = 1e-13;
  msim_sim *sim = make_pair(x, v, mass, 1, &k, NULL, NULL, 0, &opt);
  *linear = *angular = -1;
  if (sim) msim_sim_energy(sim, &before);
  if (sim && msim_sim_step(sim, steps, NULL) == MSIM_OK) {
    const double *a = before.angular_momentum, *b = after.angular_momentum;
    msim_sim_energy(sim, &after);
    *linear = fabs(after.momentum[1] / before.momentum[1] - 1);
    *angular = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]) / hypot(hypot(a[0], a[1]), a[2]);
  }
  msim_sim_destroy(sim);
}

static const column drift_columns[] = {{"method", "method", -24, NULL, 0},
                                       {"theory", "theory", 12, "%.6g", 0},
                                       {"found", "found", 12, "%.6g", 0},
                                       {"linear", "momentum", 10, "%.2g", 0},
                                       {"angular", "angular_momentum", 10, "%.2g", 0},
                                       {.key = NULL}};

void measure_drift(int quick, report *r) {
  const int64_t steps = quick ? 10000 : 100000;
  const double z = 0.01;
  const theory *t;
  printf("\nafter %lld steps: ln(E/E0) at h w = %g; relative change of momentum of two bodies\n",
         (long long)steps, z);
  print_titles(drift_columns);
  for (int m = 0; (t = theory_at(m)) != NULL && !is_interrupted(); m++) {
    double linear, angular;
    if (t->soft > 0) continue;
    measure_momentum_drift(t->method, steps, &linear, &angular);
    const json_t *row =
        report_add_row(r, "drift",
                       FIELDS(TEXT("method", t->method), INTEGER("steps", steps),
                              REAL("theory", 2 * (double)steps * theory_rate(t, z)),
                              REAL("found", 2 * amplitude_after(t, 0, z, steps)),
                              REAL("momentum", linear), REAL("angular_momentum", angular)));
    print_row(drift_columns, row);
  }
}
