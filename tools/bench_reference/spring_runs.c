#include "spring_runs.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "target_clones.h"

enum { LONGEST = 256, GAP = 4 }; /* largest number of springs in a run; of consecutive fillers */

/*------------------------------------- sorting --------------------------------------------------*/

/* A spring, from the particle of lower index to the other. */
typedef struct ordered_spring {
  int32_t i, j, spring;
} ordered_spring;

/* Orders by the difference of the indices, then by the lower index. */
static int compare_springs(const void *a, const void *b) {
  const ordered_spring *p = a, *q = b;
  const int32_t far = p->j - p->i, other = q->j - q->i;
  if (far != other) return far < other ? -1 : 1;
  return (p->i > q->i) - (p->i < q->i);
}

static void append_values(spring_runs *r, double k, double rest, double damping) {
  r->k[r->used] = k, r->rest[r->used] = rest, r->damping[r->used] = damping;
  r->used++;
}

/* Fills short gaps, as at the ends of a cloth's rows, with springs of stiffness 0: one long loop is
 * faster than many short ones. */
static void append_spring(const msim_scene_view *view, const ordered_spring *s, spring_runs *r) {
  spring_run *run = r->count ? &r->all[r->count - 1] : NULL;
  const int32_t gap = run ? s->i - run->i - run->length : -1;
  if (gap < 0 || gap > GAP || s->j - s->i != run->j - run->i || run->length + gap >= LONGEST) {
    run = &r->all[r->count++];
    *run = (spring_run){.i = s->i, .j = s->j, .first = r->used};
  }
  for (; s->i > run->i + run->length; run->length++) append_values(r, 0, 0, 0);
  append_values(r, view->k[s->spring], view->rest[s->spring], view->damping[s->spring]);
  run->length++;
}

static void fill_runs(const msim_scene_view *view, ordered_spring *links, spring_runs *r) {
  size_t count = 0;
  for (int32_t s = 0; s < view->nsprings; s++) {
    const int32_t i = view->ij[2 * s], j = view->ij[2 * s + 1];
    if (view->k[s] > 0 || view->damping[s] > 0)
      links[count++] = (ordered_spring){i < j ? i : j, i < j ? j : i, s};
    r->elastic |= view->k[s] > 0;
    r->damped |= view->damping[s] > 0;
  }
  qsort(links, count, sizeof *links, compare_springs);
  for (size_t s = 0; s < count; s++) append_spring(view, &links[s], r);
  for (int c = 0; c < 3; c++)
    for (int32_t i = 0; i < view->nparticles; i++)
      r->weight[c * view->nparticles + i] = view->pinned[i] ? 0 : view->mass[i] * view->gravity[c];
}

int spring_runs_create(const msim_scene_view *view, spring_runs *r) {
  const size_t n = (size_t)view->nparticles, springs = (size_t)view->nsprings;
  const size_t most = (1 + GAP) * (springs + 1);
  ordered_spring *links = malloc((springs + 1) * sizeof *links);
  *r = (spring_runs){.n = view->nparticles,
                     .all = malloc((springs + 1) * sizeof *r->all),
                     .k = malloc(most * sizeof *r->k),
                     .rest = malloc(most * sizeof *r->rest),
                     .damping = malloc(most * sizeof *r->damping),
                     .weight = malloc(3 * n * sizeof *r->weight),
                     .drag = view->drag};
  const int made = links && r->all && r->k && r->rest && r->damping && r->weight;
  if (made) fill_runs(view, links, r);
  free(links);
  return made;
}

void spring_runs_free(spring_runs *r) {
  free(r->all), free(r->k), free(r->rest), free(r->damping), free(r->weight);
  *r = (spring_runs){.n = 0};
}

/*------------------------------------- forces ---------------------------------------------------*/

/* Forces of one run on its particles i. DBL_MIN avoids 0/0 where two particles coincide. */
typedef struct run_forces {
  double x[LONGEST], y[LONGEST], z[LONGEST];
} run_forces;

/* p = k (l - L) d/l */
TARGET_CLONES static void compute_spring_forces(int32_t length, int32_t n,
                                                const double *restrict xi,
                                                const double *restrict xj, const double *restrict k,
                                                const double *restrict rest,
                                                run_forces *restrict p) {
  for (int32_t s = 0; s < length; s++) {
    const double dx = xj[s] - xi[s], dy = xj[n + s] - xi[n + s], dz = xj[2 * n + s] - xi[2 * n + s];
    const double l = sqrt(dx * dx + dy * dy + dz * dz);
    const double scale = k[s] * (l - rest[s]) / (l + DBL_MIN);
    p->x[s] = scale * dx, p->y[s] = scale * dy, p->z[s] = scale * dz;
  }
}

/* p += c (d . (v_j - v_i)) d/l^2 */
TARGET_CLONES static void add_damping_forces(int32_t length, int32_t n, const double *restrict xi,
                                             const double *restrict xj, const double *restrict vi,
                                             const double *restrict vj, const double *restrict c,
                                             run_forces *restrict p) {
  for (int32_t s = 0; s < length; s++) {
    const double dx = xj[s] - xi[s], dy = xj[n + s] - xi[n + s], dz = xj[2 * n + s] - xi[2 * n + s];
    const double along =
        dx * (vj[s] - vi[s]) + dy * (vj[n + s] - vi[n + s]) + dz * (vj[2 * n + s] - vi[2 * n + s]);
    const double square = dx * dx + dy * dy + dz * dz;
    const double scale = c[s] * along / (square + DBL_MIN);
    p->x[s] += scale * dx, p->y[s] += scale * dy, p->z[s] += scale * dz;
  }
}

static void clear_run_forces(int32_t length, run_forces *p) {
  double *const components[3] = {p->x, p->y, p->z};
  for (int c = 0; c < 3; c++) memset(components[c], 0, (size_t)length * sizeof(double));
}

TARGET_CLONES static void add_forces(int32_t length, double sign, const double *restrict p,
                                     double *restrict f) {
  for (int32_t s = 0; s < length; s++) f[s] += sign * p[s];
}

static void scatter(const spring_runs *r, const spring_run *run, const run_forces *p, double *f) {
  const double *const components[3] = {p->x, p->y, p->z};
  for (int c = 0; c < 3; c++) {
    add_forces(run->length, 1, components[c], f + c * r->n + run->i);
    add_forces(run->length, -1, components[c], f + c * r->n + run->j);
  }
}

void spring_runs_force(const spring_runs *r, const double *x, const double *v, double *f) {
  run_forces p;
  memcpy(f, r->weight, 3 * (size_t)r->n * sizeof *f);
  if (r->drag > 0) add_forces(3 * r->n, -r->drag, v, f);
  for (const spring_run *run = r->all; run < r->all + r->count; run++) {
    if (r->elastic)
      compute_spring_forces(run->length, r->n, x + run->i, x + run->j, r->k + run->first,
                            r->rest + run->first, &p);
    else clear_run_forces(run->length, &p);
    if (r->damped)
      add_damping_forces(run->length, r->n, x + run->i, x + run->j, v + run->i, v + run->j,
                         r->damping + run->first, &p);
    scatter(r, run, &p, f);
  }
}
