#include "physics/law.h"

#include <math.h>

#include "physics/spring_law.h"

/* f, f' and E of a law for k = 1, where k scales it. Loops over them are vectorized. */
typedef ms_law_value unit_law(const ms_law *law, double e);

static inline ms_law_value linear(const ms_law *law, double e) {
  (void)law;
  return (ms_law_value){e, 1, 0.5 * e * e};
}

static inline ms_law_value tension(const ms_law *law, double e) {
  (void)law;
  const double c = e > 0 ? e : 0;
  return (ms_law_value){c, e > 0, 0.5 * c * c};
}

static inline ms_law_value compression(const ms_law *law, double e) {
  (void)law;
  const double c = e < 0 ? e : 0;
  return (ms_law_value){c, e < 0, 0.5 * c * c};
}

static inline ms_law_value dead_band(const ms_law *law, double e) {
  const double w = law->given.half_width, over = e > w ? e - w : 0, under = e < -w ? e + w : 0;
  const double c = over + under;
  return (ms_law_value){c, c != 0, 0.5 * c * c};
}

static inline void evaluate_scaled(const ms_law *law, unit_law *unit, int32_t n, const double *k,
                                   ms_law_batch *b) {
  if (b->only_force) {
    for (int32_t i = 0; i < n; i++) b->force[i] = k[i] * unit(law, b->stretch[i]).force;
    return;
  }
  for (int32_t i = 0; i < n; i++) {
    const ms_law_value value = unit(law, b->stretch[i]);
    b->force[i] = k[i] * value.force;
    b->slope[i] = k[i] * value.slope;
    b->energy[i] = k[i] * value.energy;
  }
}

/* at[i] = the piece that contains stretch[i], without branches: by counting in short tables, else
 * by bisection, where it is piece at[i] or one of the `left` ones after it */
static void find_pieces(const ms_law *law, int32_t n, const double *stretch, int32_t *at) {
  enum { SHORT = 8 };
  const double *x = law->given.stretch;
  for (int32_t i = 0; i < n; i++) at[i] = 0;
  for (int32_t k = 0; k < law->given.n && law->given.n <= SHORT; k++)
    for (int32_t i = 0; i < n; i++) at[i] += !(stretch[i] < x[k]);
  for (int32_t left = law->given.n > SHORT ? law->given.n : 0; left > 0; left -= (left + 1) / 2)
    for (int32_t i = 0, half = (left + 1) / 2; i < n; i++)
      at[i] += half * !(stretch[i] < x[at[i] + half - 1]);
}

static void evaluate_table(const ms_law *law, int32_t n, ms_law_batch *b) {
  int32_t at[MS_LAW_BATCH];
  find_pieces(law, n, b->stretch, at);
  for (int32_t i = 0; i < n; i++) {
    const ms_law_piece *p = &law->piece[at[i]];
    const double s = b->stretch[i] - p->start;
    b->force[i] = p->a + s * (p->b + s * (p->c + s * p->d));
    if (b->only_force) continue;
    b->slope[i] = p->b + s * (2 * p->c + s * 3 * p->d);
    b->energy[i] = p->energy + s * (p->a + s * (p->b / 2 + s * (p->c / 3 + s * p->d / 4)));
  }
}

/* With c = e limited to [-limit, limit] and d = e - c:
 *   f = p(c) + p'(c) d,  f' = p'(c),  E = P(c) + p(c) d + p'(c) d^2/2,  P the integral of p,
 * by Horner's rule for all springs at once */
static void evaluate_polynomial(const ms_law *law, int32_t n, const double *k, ms_law_batch *b) {
  const double *a = law->given.coefficients, most = law->given.limit;
  double c[MS_LAW_BATCH], p[MS_LAW_BATCH] = {0}, slope[MS_LAW_BATCH] = {0};
  double integral[MS_LAW_BATCH] = {0};
  for (int32_t e = 0; e < n; e++) {
    const double at = b->stretch[e];
    c[e] = at > most ? most : at < -most ? -most : at;
  }
  for (int32_t i = law->given.n - 1; i >= 0; i--) {
    for (int32_t e = 0; e < n; e++) p[e] = p[e] * c[e] + a[i];
    for (int32_t e = 0; e < n; e++) slope[e] = slope[e] * c[e] + (i + 1) * a[i];
    for (int32_t e = 0; e < n && !b->only_force; e++)
      integral[e] = integral[e] * c[e] + a[i] / (i + 2);
  }
  for (int32_t e = 0; e < n; e++)
    b->force[e] = k[e] * (p[e] * c[e] + slope[e] * (b->stretch[e] - c[e]));
  for (int32_t e = 0; e < n && !b->only_force; e++) {
    const double d = b->stretch[e] - c[e];
    b->slope[e] = k[e] * slope[e];
    b->energy[e] = k[e] * (integral[e] * (c[e] * c[e]) + d * (p[e] * c[e] + 0.5 * slope[e] * d));
  }
}

static void evaluate_callback(const ms_law *law, int32_t n, const double *k, const double *rest,
                              ms_law_batch *b) {
  const msim_law_batch of = {.size = sizeof of,
                             .n = n,
                             .k = k,
                             .rest = rest,
                             .stretch = b->stretch,
                             .force = b->force,
                             .slope = b->slope,
                             .energy = b->energy};
  law->given.function(law->given.data, &of);
}

void ms_law_evaluate(const ms_law *law, int32_t n, const double *k, const double *rest,
                     ms_law_batch *b) {
  switch (law->given.kind) {
    case MSIM_LAW_LINEAR:
      evaluate_scaled(law, linear, n, k, b);
      break;
    case MSIM_LAW_TENSION:
      evaluate_scaled(law, tension, n, k, b);
      break;
    case MSIM_LAW_COMPRESSION:
      evaluate_scaled(law, compression, n, k, b);
      break;
    case MSIM_LAW_DEAD_BAND:
      evaluate_scaled(law, dead_band, n, k, b);
      break;
    case MSIM_LAW_POLYNOMIAL:
      evaluate_polynomial(law, n, k, b);
      break;
    case MSIM_LAW_TABLE:
      evaluate_table(law, n, b);
      break;
    default:
      evaluate_callback(law, n, k, rest, b);
  }
}

ms_law_value ms_law_value_of(const ms_scene *s, int32_t spring, double l) {
  const ms_law *law = ms_scene_law(s, spring);
  const double k = s->k[spring], rest = s->rest[spring];
  if (ms_scene_is_broken(s, spring)) return (ms_law_value){0, 0, 0};
  if (!law) return (ms_law_value){MS_SPRING_FORCE(k, rest, l), k, MS_SPRING_ENERGY(k, rest, l)};
  ms_law_batch batch;
  batch.only_force = 0;
  batch.stretch[0] = l - rest;
  ms_law_evaluate(law, 1, &k, &rest, &batch);
  return (ms_law_value){batch.force[0], batch.slope[0], batch.energy[0]};
}
