/* x'' = -2 zeta w x' - w^2 x: a spring of rest length 0, whose force is linear, with w = 1/s, so
 * that h is z = h w. What theory says is in closed form, or the root of such (see the table). */
#include "limits.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "interrupt.h"
#include "msim/msim.h"

enum { ZETAS = 3 };
static const double zetas[ZETAS] = {0, 0.1, 1};

/* The limit of z at each zeta; INFINITY: there is none. rate: the logarithm of the growth of
 * amplitude in a step without damping. */
typedef struct theory {
  const char *method;
  double limit[ZETAS];
  double (*rate)(double z);
} theory;

static double euler(double z) { return 0.5 * log1p(z * z); }
static double heun(double z) { return 0.5 * log1p(pow(z, 4) / 4); }
static double none(double z) { return 0 * z; }
static double implicit_euler(double z) { return -0.5 * log1p(z * z); }
static double rk4(double z) { return 0.5 * log1p(-pow(z, 6) / 72 + pow(z, 8) / 576); }

/* The roots of (3/2) r^2 - 2 r + 1/2 = i z r^2 */
static double bdf2(double z) {
  const double size = hypot(1, 2 * z);
  const double root_re = sqrt((size + 1) / 2), root_im = sqrt((size - 1) / 2);
  return log(hypot(2 + root_re, root_im) / hypot(3, 2 * z));
}

static double l_stable(double z) {
  const double g = (1 - sqrt(0.5)) * (1 - sqrt(0.5)), q = g * z * z;
  return 0.5 * log1p(2 * q) - log1p(q);
}

#define NO_LIMIT \
  { INFINITY, INFINITY, INFINITY }

static const theory table[] = {{"explicit-euler", {0, 0.2, 2}, euler},
                               {"heun", {0, 1.0497475, 2}, heun},
                               {"verlet", {2, 1.8099751, 0.8284271}, none},
                               {"symplectic-euler", {2, 1.8099751, 0.8284271}, none},
                               {"velocity-verlet", {2, 1.8435126, 1}, none},
                               {"rk4", {2.8284271, 2.9508500, 2.7852936}, rk4},
                               {"linearly-implicit-euler", NO_LIMIT, implicit_euler},
                               {"implicit-euler", NO_LIMIT, implicit_euler},
                               {"implicit-midpoint", NO_LIMIT, none},
                               {"trapezoidal", NO_LIMIT, none},
                               {"newmark", NO_LIMIT, none},
                               {"bdf2", NO_LIMIT, bdf2},
                               {"tr-bdf2", NO_LIMIT, l_stable},
                               {"sdirk2", NO_LIMIT, l_stable}};

/* The particle at 1 m, of 1 kg, on a spring of 1 N/m to a pinned one at the origin. */
static msim_sim *make(const char *method, double zeta, double z) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, k = 1, rest = 0, damping = 2 * zeta;
  const int32_t ij[2] = {0, 1}, pinned = 0;
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.h = z, opt.steps = 1000000000, opt.watch = MSIM_WATCH_OFF;
  opt.threads = 1, opt.solver_rtol = opt.newton_rtol = 1e-13;
  if (!msim_scene_create(NULL, &scene, NULL) &&
      !msim_scene_add_particles(scene, 2, x, NULL, mass, NULL) &&
      !msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, NULL) &&
      !msim_scene_pin(scene, 1, &pinned, NULL))
    msim_sim_create(scene, &opt, &sim, NULL);
  msim_scene_destroy(scene);
  return sim;
}

/* log of the largest amplitude within a period after some more steps; INFINITY where they end
 * before. */
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

static double amplitude_after(const char *method, double zeta, double z, int64_t steps) {
  msim_sim *sim = make(method, zeta, z);
  const double size = amplitude(sim, steps, 0);
  msim_sim_destroy(sim);
  return size;
}

/* From one half of the steps to the other. Without damping amplitudes vary as they go; what has
 * decayed to the least numbers jitters. */
static int grows(const char *method, double zeta, double z, int64_t steps) {
  msim_sim *sim = make(method, zeta, z);
  const double half = amplitude(sim, steps / 2, 64);
  const double whole = isfinite(half) ? amplitude(sim, steps / 2, 64) : half;
  msim_sim_destroy(sim);
  return whole == INFINITY || (whole > -300 && whole - half > (zeta > 0 ? 0 : 5));
}

static double find_limit(const char *method, double zeta, int quick) {
  double low = 0, high = 4;
  for (int i = 0; i < (quick ? 15 : 18) && !is_interrupted(); i++) {
    const double z = (low + high) / 2;
    if (grows(method, zeta, z, quick ? 20000 : 100000)) high = z;
    else low = z;
  }
  return (low + high) / 2;
}

static double check_limit(const theory *t, int i, int quick, report *r) {
  const double z = 0.1;
  const int is_rate = t->limit[i] == 0, has_none = isinf(t->limit[i]);
  double found, expected = t->limit[i];
  if (is_rate) expected = t->rate(z), found = amplitude_after(t->method, 0, z, 1000) / 1000;
  else if (has_none) expected = 0, found = fmax(0, amplitude_after(t->method, zetas[i], 100, 20));
  else found = find_limit(t->method, zetas[i], quick);
  const double error = fabs(found - expected) / (expected > 0 ? expected : 1);
  const char *kind = is_rate ? "growth" : has_none ? "none" : "limit";
  json_t *row = report_row(r, "limit");
  put_text(row, "method", t->method);
  put_real(row, "zeta", zetas[i]);
  put_text(row, "kind", kind);
  put_real(row, "theory", expected);
  put_real(row, "found", found);
  put_real(row, "error", error);
  printf(" %-24s %4g  %-7s %12.7g %12.7g %9.2g\n", t->method, zetas[i], kind, expected, found,
         error);
  return error;
}

double measure_limits(int quick, report *r) {
  double worst = 0;
  printf("\nlongest stable h w\n %-24s zeta           %12s %12s %9s\n", "method", "theory", "found",
         "error");
  for (size_t m = 0; m < sizeof table / sizeof *table; m++)
    for (int i = 0; i < ZETAS && !is_interrupted(); i++)
      worst = fmax(worst, check_limit(&table[m], i, quick, r));
  return worst;
}

/*------------------------------------- energy ---------------------------------------------------*/

/* Two bodies on a spring that turn and move on: what is lost of momentum and angular momentum, as a
 * share; -1: the method did not get there. */
static void lose_momentum(const char *method, int64_t steps, double *linear, double *angular) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, v[6] = {1, 0, 0.5, 1, 3, 0.5}, mass[2] = {1, 2}, k = 100;
  const int32_t ij[2] = {0, 1};
  msim_energy before = {.size = sizeof before}, after = {.size = sizeof after};
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.h = 0.001, opt.steps = steps, opt.newton_rtol = 1e-13;
  *linear = *angular = -1;
  if (!msim_scene_create(NULL, &scene, NULL) &&
      !msim_scene_add_particles(scene, 2, x, v, mass, NULL) &&
      !msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, NULL) &&
      !msim_sim_create(scene, &opt, &sim, NULL)) {
    msim_sim_energy(sim, &before);
    if (msim_sim_step(sim, steps, NULL) == MSIM_OK) {
      msim_sim_energy(sim, &after);
      *linear = fabs(after.momentum[1] / before.momentum[1] - 1);
      const double *a = before.angular_momentum, *b = after.angular_momentum;
      *angular =
          hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]) / hypot(hypot(a[0], a[1]), a[2]);
    }
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

void measure_drift(int quick, report *r) {
  const int64_t steps = quick ? 10000 : 100000;
  const double z = 0.01;
  printf(
      "\nafter %lld steps: ln of the energy over that of the start at h w = %g; what two "
      "bodies lose of momentum\n %-24s %12s %12s %10s %10s\n",
      (long long)steps, z, "method", "theory", "found", "linear", "angular");
  for (size_t m = 0; m < sizeof table / sizeof *table && !is_interrupted(); m++) {
    const double expected = 2 * (double)steps * table[m].rate(z);
    const double found = 2 * amplitude_after(table[m].method, 0, z, steps);
    double linear, angular;
    lose_momentum(table[m].method, steps, &linear, &angular);
    json_t *row = report_row(r, "drift");
    put_text(row, "method", table[m].method);
    put_integer(row, "steps", steps);
    put_real(row, "theory", expected);
    put_real(row, "found", found);
    put_real(row, "momentum", linear);
    put_real(row, "angular_momentum", angular);
    printf(" %-24s %12.6g %12.6g %10.2g %10.2g\n", table[m].method, expected, found, linear,
           angular);
  }
}
