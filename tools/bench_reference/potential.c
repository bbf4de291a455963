#include "potential.h"

#include <math.h>
#include <stdlib.h>

static int by_ends(const void *a, const void *b) {
  const struct placed_spring *s = a, *t = b;
  return s->i != t->i ? (s->i > t->i) - (s->i < t->i) : (s->j > t->j) - (s->j < t->j);
}

/* Sorts the springs by their ends, for memory locality. */
static void fill_springs(potential *p) {
  const msim_scene_view *s = p->scene;
  const double h = p->h;
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t a = p->matrix->place[s->ij[2 * e]], b = p->matrix->place[s->ij[2 * e + 1]];
    p->springs[e] =
        (struct placed_spring){a < b ? a : b, a < b ? b : a, h * h * s->k[e], s->rest[e]};
  }
  qsort(p->springs, (size_t)p->nsprings, sizeof *p->springs, by_ends);
}

static void fill_particles(const double *v, potential *p) {
  const msim_scene_view *s = p->scene;
  const double h = p->h;
  for (int32_t i = 0; i < p->n; i++) {
    const int32_t particle = p->matrix->particle[i], pinned = s->pinned[particle];
    p->mass[i] = s->mass[particle];
    if (pinned) p->pinned[p->npinned++] = i;
    for (int c = 0; c < 3; c++) {
      const int32_t at = 3 * particle + c;
      const double flight = h * v[at] + h * h * s->gravity[c];
      p->y[c * p->n + i] = p->x[at] + (pinned ? 0 : flight);
    }
  }
}

int potential_make(const msim_scene_view *s, const double *x, const double *v, double h,
                   const laplacian *L, potential *p) {
  const size_t n = (size_t)L->n, springs = (size_t)s->nsprings;
  *p = (potential){.scene = s,
                   .x = x,
                   .h = h,
                   .matrix = L,
                   .n = L->n,
                   .nsprings = s->nsprings,
                   .mass = malloc(n * sizeof *p->mass),
                   .y = malloc(3 * n * sizeof *p->y),
                   .pinned = malloc(n * sizeof *p->pinned),
                   .springs = malloc(springs * sizeof *p->springs),
                   .v = malloc(3 * n * sizeof *p->v)};
  if (!p->mass || !p->y || !p->pinned || !p->springs || !p->v) return 0;
  fill_springs(p);
  fill_particles(v, p);
  return 1;
}

void potential_free(potential *p) {
  void *arrays[] = {p->mass, p->y, p->pinned, p->springs, p->v};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
  *p = (potential){0};
}

/* Returns 1/2 (x - y)' M (x - y); g = M (x - y) */
static double inertia(const potential *p, const double *restrict x, double *restrict g) {
  const int32_t n = p->n;
  double sum[3] = {0};
  for (int32_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++) {
      const double d = x[c * n + i] - p->y[c * n + i];
      g[c * n + i] = p->mass[i] * d;
      sum[c] += p->mass[i] * d * d;
    }
  return 0.5 * (sum[0] + sum[1] + sum[2]);
}

/* Returns h^2 sum of k/2 (l - L)^2 and adds its gradient, h^2 k (l - L) d/l */
static double elasticity(const potential *p, const double *restrict x, double *restrict gx) {
  const double *y = x + p->n, *z = y + p->n;
  double *restrict gy = gx + p->n, *restrict gz = gy + p->n;
  double sum = 0;
  for (const struct placed_spring *s = p->springs; s < p->springs + p->nsprings; s++) {
    const int32_t i = s->i, j = s->j;
    const double dx = x[j] - x[i], dy = y[j] - y[i], dz = z[j] - z[i];
    const double l = sqrt(dx * dx + dy * dy + dz * dz), stretch = l - s->rest;
    const double scale = l > 0 ? s->k * stretch / l : 0;
    sum += s->k * stretch * stretch;
    gx[i] -= scale * dx, gy[i] -= scale * dy, gz[i] -= scale * dz;
    gx[j] += scale * dx, gy[j] += scale * dy, gz[j] += scale * dz;
  }
  return 0.5 * sum;
}

double potential_at(const potential *p, const double *x, double *gradient) {
  const double value = inertia(p, x, gradient) + elasticity(p, x, gradient);
  for (int32_t i = 0; i < p->npinned; i++)
    for (int c = 0; c < 3; c++) gradient[c * p->n + p->pinned[i]] = 0;
  return value;
}

const double *potential_velocity(const potential *p, const double *x) {
  for (int32_t i = 0; i < p->n; i++)
    for (int c = 0; c < 3; c++) {
      const int32_t at = 3 * p->matrix->particle[i] + c;
      p->v[at] = (x[c * p->n + i] - p->x[at]) / p->h;
    }
  return p->v;
}
