#include "scene/laws.h"

#include <math.h>
#include <string.h>

const char *ms_laws_kind_name(int32_t kind) {
  static const char *const names[] = {"linear",     "tension", "compression", "dead_band",
                                      "polynomial", "table",   "callback"};
  return kind >= 0 && kind <= MSIM_LAW_CALLBACK ? names[kind] : NULL;
}

/*------------------------------------- tables ---------------------------------------------------*/

/* Slopes of the monotone cubic at both ends of an interval of secant `delta` (Fritsch and Carlson,
 * SIAM J. Numer. Anal. 17 (1980) 238): a^2 + b^2 <= 9 for the ratios a, b of slope to secant. */
static void limit_slopes(double delta, double *from, double *to) {
  if (delta == 0) {
    *from = *to = 0;
    return;
  }
  const double size = hypot(*from / delta, *to / delta);
  if (size > 3) *from *= 3 / size, *to *= 3 / size;
}

/* The slope of the parabola through three points, 0 at an extremum of the data; at the ends that
 * of the interval. */
static double initial_slope(const msim_law *law, int32_t i) {
  const double *x = law->stretch, *f = law->force;
  const int32_t last = law->n - 1, left = i > 0 ? i - 1 : 0, right = i < last ? i : last - 1;
  const double before = x[left + 1] - x[left], after = x[right + 1] - x[right];
  const double delta = (f[left + 1] - f[left]) / before, next = (f[right + 1] - f[right]) / after;
  if (left == right) return delta;
  if (!((delta > 0 && next > 0) || (delta < 0 && next < 0))) return 0;
  return (delta * after + next * before) / (before + after);
}

static double piece_energy(const ms_law_piece *p, double s) {
  return p->energy + s * (p->a + s * (p->b / 2 + s * (p->c / 3 + s * p->d / 4)));
}

/* Energies are 0 at e = 0. */
static void set_table_energies(ms_law *law) {
  const int32_t n = law->given.n;
  int32_t zero = 0;
  for (int32_t i = 1; i < n; i++)
    law->piece[i + 1].energy =
        piece_energy(&law->piece[i], law->given.stretch[i] - law->piece[i].start);
  while (zero < n && law->given.stretch[zero] <= 0) zero++;
  const double at_rest = piece_energy(&law->piece[zero], 0 - law->piece[zero].start);
  for (int32_t i = 0; i <= n; i++) law->piece[i].energy -= at_rest;
}

/* Expand pieces around their points nearest to 0, so that forces and energies near rest have no
 * cancellation.
 * At the upper end of a piece force and slope are those of the next one. */
static void center_pieces(ms_law *law, const double *slope) {
  const double *x = law->given.stretch;
  for (int32_t i = 1; i < law->given.n; i++) {
    ms_law_piece *p = &law->piece[i];
    const double at = fmin(fmax(0, x[i - 1]), x[i]), s = at - p->start;
    if (s == 0) continue;
    p->energy = at == 0 ? 0 : piece_energy(p, s);
    p->a = at == x[i] ? law->given.force[i] : p->a + s * (p->b + s * (p->c + s * p->d));
    p->b = at == x[i] ? slope[i] : p->b + s * (2 * p->c + s * 3 * p->d);
    p->c += 3 * p->d * s;
    p->start = at;
  }
}

/* The middle number is the second Bernstein coefficient of the derivative. */
static double bound_piece_slope(double delta, double from, double to) {
  return fmax(fmax(fabs(from), fabs(to)), fabs(3 * delta - from - to));
}

static void set_table(ms_law *law, double *slope) {
  const msim_law *t = &law->given;
  const double *x = t->stretch, *f = t->force;
  const int32_t last = t->n - 1;
  for (int32_t i = 0; i <= last; i++) slope[i] = initial_slope(t, i);
  for (int32_t i = 0; i < last; i++)
    limit_slopes((f[i + 1] - f[i]) / (x[i + 1] - x[i]), &slope[i], &slope[i + 1]);
  law->piece[0] = (ms_law_piece){.start = x[0], .a = f[0], .b = slope[0]};
  law->piece[last + 1] = (ms_law_piece){.start = x[last], .a = f[last], .b = slope[last]};
  for (int32_t i = 0; i < last; i++) {
    const double h = x[i + 1] - x[i], delta = (f[i + 1] - f[i]) / h;
    law->piece[i + 1] = (ms_law_piece){.start = x[i],
                                       .a = f[i],
                                       .b = slope[i],
                                       .c = (3 * delta - 2 * slope[i] - slope[i + 1]) / h,
                                       .d = (slope[i] + slope[i + 1] - 2 * delta) / (h * h)};
    law->slope = fmax(law->slope, bound_piece_slope(delta, slope[i], slope[i + 1]));
  }
  set_table_energies(law);
  center_pieces(law, slope);
}

/*------------------------------------- depth of the energy --------------------------------------*/

/* What the energy falls by beyond an end where the force is `force` outwards from rest and
 * continues with this slope */
static double depth_beyond(double force, double slope) {
  if (force >= 0 && slope >= 0) return 0;
  return slope > 0 ? force * force / (2 * slope) : INFINITY;
}

/* Between two points the force lies between those there: where it pushes away from rest, the
 * energy falls by its integral at most. */
static double bound_table_depth(const ms_law *law) {
  const msim_law *t = &law->given;
  const ms_law_piece *low = law->piece, *high = law->piece + t->n;
  double below = depth_beyond(-low->a, low->b), above = depth_beyond(high->a, high->b);
  for (int32_t i = 0; i + 1 < t->n; i++) {
    const double most = fmax(t->force[i], t->force[i + 1]),
                 least = fmin(t->force[i], t->force[i + 1]);
    if (t->stretch[i] < 0) below += fmax(0, most) * (fmin(t->stretch[i + 1], 0) - t->stretch[i]);
    if (t->stretch[i + 1] > 0)
      above += fmax(0, -least) * (t->stretch[i + 1] - fmax(t->stretch[i], 0));
  }
  /* from rest to a table that begins beyond it the force is linear */
  if (t->stretch[0] > 0) above += fmax(0, fmax(-low->a, low->b * low->start - low->a)) * low->start;
  if (high->start < 0)
    below -= fmax(0, fmax(high->a, high->a - high->b * high->start)) * high->start;
  return fmax(below, above);
}

/* Terms of odd power with a coefficient < 0, and of even power at one sign of e, lower it. */
static void set_polynomial(ms_law *law) {
  const msim_law *p = &law->given;
  double power = 1, inside = 0, f[2] = {0}, slope[2] = {0};
  for (int32_t i = 0; i < p->n; i++) {
    const double c = p->coefficients[i], sign = i % 2 ? -1 : 1;
    law->slope += (i + 1) * fabs(c) * power;
    slope[0] += (i + 1) * c * power, slope[1] += (i + 1) * c * power * sign;
    power *= p->limit;
    f[0] += c * power, f[1] += c * power * sign; /* outwards at limit and -limit */
    if (i % 2 || c < 0) inside += fabs(c) * power * p->limit / (i + 2);
  }
  law->depth = inside + fmax(depth_beyond(f[0], slope[0]), depth_beyond(f[1], slope[1]));
}

double ms_scene_energy_depth(const ms_scene *s, int32_t spring) {
  const ms_law *law = ms_scene_law(s, spring);
  if (!law || law->depth == 0 || ms_scene_is_broken(s, spring) ||
      (law->scales && s->k[spring] == 0))
    return 0;
  return law->scales ? s->k[spring] * law->depth : law->depth;
}

/*------------------------------------- preparation ----------------------------------------------*/

void ms_laws_free_one(const msim_allocator *alloc, ms_law *law) {
  MS_FREE(alloc, law->numbers, law->piece);
}

static int copy_arrays(const msim_allocator *alloc, ms_law *law) {
  const size_t n = (size_t)law->given.n, bytes = n * sizeof(double);
  if (law->given.kind != MSIM_LAW_TABLE && law->given.kind != MSIM_LAW_POLYNOMIAL) return 1;
  /* tables: the last third is scratch for slopes */
  if (!MS_NEW(alloc, law->numbers, 3 * n) || !MS_NEW(alloc, law->piece, n + 1)) return 0;
  if (law->given.kind == MSIM_LAW_POLYNOMIAL) {
    law->given.coefficients = memcpy(law->numbers, law->given.coefficients, bytes);
    return 1;
  }
  law->given.stretch = memcpy(law->numbers, law->given.stretch, bytes);
  law->given.force = memcpy(law->numbers + n, law->given.force, bytes);
  return 1;
}

int ms_laws_prepare(const msim_allocator *alloc, const msim_law *given, ms_law *law) {
  *law = (ms_law){.given = *given, .scales = 1};
  if (!copy_arrays(alloc, law)) {
    ms_laws_free_one(alloc, law);
    return 0;
  }
  if (given->kind == MSIM_LAW_POLYNOMIAL) set_polynomial(law);
  else if (given->kind == MSIM_LAW_TABLE) {
    law->scales = 0;
    set_table(law, law->numbers + 2 * (size_t)given->n);
    law->depth = bound_table_depth(law);
  } else if (given->kind == MSIM_LAW_CALLBACK) {
    law->scales = 0, law->slope = given->largest_slope, law->depth = given->energy_depth;
  } else {
    law->slope = 1;
  }
  return 1;
}

int ms_scene_breaks(const ms_scene *s) {
  for (int32_t i = 0; i < s->nlaws; i++)
    if (ms_law_breaks(&s->laws[i])) return 1;
  return 0;
}

msim_status ms_scene_prepare_breaking(ms_scene *s, msim_error *err) {
  if (s->broken || !ms_scene_breaks(s) || MS_NEW(&s->alloc, s->broken, s->spring_capacity))
    return MSIM_OK;
  return ms_error_set_memory(err, "the broken springs");
}

int ms_laws_copy(const ms_scene *from, ms_scene *to) {
  msim_error inner;
  if (ms_memory_reserve(&to->alloc, MS_ARRAY(to->laws), 0, &to->law_capacity, from->nlaws, &inner))
    return 0;
  for (; to->nlaws < from->nlaws; to->nlaws++)
    if (!ms_laws_prepare(&to->alloc, &from->laws[to->nlaws].given, &to->laws[to->nlaws])) return 0;
  if (from->law) {
    if (!MS_NEW(&to->alloc, to->law, to->spring_capacity)) return 0;
    memcpy(to->law, from->law, (size_t)from->nsprings * sizeof *to->law);
  }
  if (!from->broken) return 1;
  if (!MS_NEW(&to->alloc, to->broken, to->spring_capacity)) return 0;
  memcpy(to->broken, from->broken, (size_t)from->nsprings);
  return 1;
}

void ms_laws_free(ms_scene *s) {
  for (int32_t i = 0; i < s->nlaws; i++) ms_laws_free_one(&s->alloc, &s->laws[i]);
  MS_FREE(&s->alloc, s->laws, s->law, s->broken);
}
