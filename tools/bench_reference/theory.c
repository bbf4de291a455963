#include "theory.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

const double zetas[DAMPING_RATIOS] = {0, 0.1, 1};

/*------------------------------------- the table ------------------------------------------------*/

static double euler(double z) { return 0.5 * log1p(z * z); }
static double heun(double z) { return 0.5 * log1p(pow(z, 4) / 4); }
static double none(double z) { return 0 * z; }
static double implicit_euler(double z) { return -0.5 * log1p(z * z); }
static double rk4(double z) { return 0.5 * log1p(-pow(z, 6) / 72 + pow(z, 8) / 576); }

/* ln |r| of the principal root of (3/2) r^2 - 2 r + 1/2 = i z r^2 */
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

static const theory table[] = {
    {"explicit-euler", {0, 0.2, 2}, .rate = euler},
    {"heun", {0, 1.0497475, 2}, .rate = heun},
    {"verlet", {2, 1.8099751, 0.8284271}, .rate = none},
    {"symplectic-euler", {2, 1.8099751, 0.8284271}, .rate = none},
    {"velocity-verlet", {2, 1.8435126, 1}, .rate = none},
    {"respa", {2, 1.8435126, 1}, .rate = none}, /* a single spring is not split: velocity Verlet */
    {"respa", .step = amplify_respa, .undamped = 1, .soft = SOFT_STIFFNESS},
    {"rk4", {2.8284271, 2.9508500, 2.7852936}, .rate = rk4},
    {"ssprk102", .step = amplify_ssprk102},
    {"ssprk104", .step = amplify_ssprk104},
    {"rk6", .step = amplify_rk6},
    {"rkc", .step = amplify_rkc},
    {"takahashi-imada", .step = amplify_takahashi_imada, .undamped = 1},
    {"force-gradient", .step = amplify_force_gradient, .undamped = 1},
    {"rkn6", .step = amplify_rkn6, .undamped = 1},
    {"dop853", .step = amplify_dop853},
    {"linearly-implicit-euler", NO_LIMIT, .rate = implicit_euler},
    {"implicit-euler", NO_LIMIT, .rate = implicit_euler},
    {"implicit-midpoint", NO_LIMIT, .rate = none},
    {"trapezoidal", NO_LIMIT, .rate = none},
    {"newmark", NO_LIMIT, .rate = none},
    {"bdf2", NO_LIMIT, .rate = bdf2},
    {"tr-bdf2", NO_LIMIT, .rate = l_stable},
    {"sdirk2", NO_LIMIT, .rate = l_stable}};

const theory *theory_at(int i) {
  return i >= 0 && i < (int)(sizeof table / sizeof *table) ? &table[i] : NULL;
}

const theory *theory_find(const char *method) {
  const theory *t;
  for (int i = 0; (t = theory_at(i)) != NULL; i++)
    if (strcmp(t->method, method) == 0 && t->soft == 0) return t;
  return NULL;
}

/*------------------------------------- what follows from it -------------------------------------*/

double theory_rate(const theory *t, double z) {
  return t->step ? amplification_rate(t->step, 0, z) : t->rate(z);
}

/* Rounding alone lets a double root grow by 1e-8 per step, ssprk102 z = 0.1 by 6e-7. */
static int step_amplifies(const theory *t, double zeta, double z) {
  return amplification_rate(t->step, zeta, z) > 2e-7;
}

/* dz is below the narrowest unstable range, that of rkn6, 9e-4; the longest step of all is that of
 * ssprk102, 18. */
static double scan_stability_limit(const theory *t, double zeta) {
  const double furthest = 20, dz = 1e-4;
  double z = dz;
  if (step_amplifies(t, zeta, 0.1)) return 0;
  while (z < furthest && !step_amplifies(t, zeta, z)) z += dz;
  return z < furthest ? z - dz / 2 : INFINITY;
}

static double find_growth_peak(const theory *t, double zeta, double limit) {
  const double dz = 1e-4;
  double z = limit + dz;
  while (z < 1.5 * limit &&
         amplification_rate(t->step, zeta, z + dz) > amplification_rate(t->step, zeta, z))
    z += dz;
  return z;
}

double theory_limit(const theory *t, int zeta, double *peak) {
  const double limit = t->step ? scan_stability_limit(t, zetas[zeta]) : t->limit[zeta];
  const int has_peak = t->step && limit > 0 && isfinite(limit);
  *peak = has_peak ? find_growth_peak(t, zetas[zeta], limit) : 1.5 * limit;
  return limit;
}
