#include "runs.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "wide.h"

enum { LONGEST = 256, GAP = 4 }; /* largest number of springs in a run; of consecutive fillers */

/*------------------------------------- sorting --------------------------------------------------*/

/* A spring, from the particle of lower index to the other. */
typedef struct link {
  int32_t i, j, spring;
} link;

/* Orders by the difference of the indices, then by the lower index. */
static int compare(const void *a, const void *b) {
  const link *p = a, *q = b;
  const int32_t far = p->j - p->i, other = q->j - q->i;
  if (far != other) return far < other ? -1 : 1;
  return (p->i > q->i) - (p->i < q->i);
}

static void put(runs *r, double k, double rest, double damping) {
  r->k[r->used] = k, r->rest[r->used] = rest, r->damping[r->used] = damping;
  r->used++;
}

/* Fills short gaps, as at the ends of a cloth's rows, with springs of stiffness 0: one long loop is
 * faster than many short ones. */
static void append(const msim_scene_view *view, const link *s, runs *r) {
  spring_run *run = r->count ? &r->all[r->count - 1] : NULL;
  const int32_t gap = run ? s->i - run->i - run->length : -1;
  if (gap < 0 || gap > GAP || s->j - s->i != run->j - run->i || run->length + gap >= LONGEST) {
    run = &r->all[r->count++];
    *run = (spring_run){.i = s->i, .j = s->j, .first = r->used};
  }
  for (; s->i > run->i + run->length; run->length++) put(r, 0, 0, 0);
  put(r, view->k[s->spring], view->rest[s->spring], view->damping[s->spring]);
  run->length++;
}

static void fill(const msim_scene_view *view, link *links, runs *r) {
  for (int32_t s = 0; s < view->nsprings; s++) {
    const int32_t i = view->ij[2 * s], j = view->ij[2 * s + 1];
    links[s] = (link){i < j ? i : j, i < j ? j : i, s};
    r->elastic |= view->k[s] > 0;
    r->damped |= view->damping[s] > 0;
  }
  qsort(links, (size_t)view->nsprings, sizeof *links, compare);
  for (int32_t s = 0; s < view->nsprings; s++) append(view, &links[s], r);
  for (int c = 0; c < 3; c++)
    for (int32_t i = 0; i < view->nparticles; i++)
      r->weight[c * view->nparticles + i] = view->pinned[i] ? 0 : view->mass[i] * view->gravity[c];
}

int runs_make(const msim_scene_view *view, runs *r) {
  const size_t n = (size_t)view->nparticles, springs = (size_t)view->nsprings;
  const size_t most = (1 + GAP) * (springs + 1);
  link *links = malloc((springs + 1) * sizeof *links);
  *r = (runs){.n = view->nparticles,
              .all = malloc((springs + 1) * sizeof *r->all),
              .k = malloc(most * sizeof *r->k),
              .rest = malloc(most * sizeof *r->rest),
              .damping = malloc(most * sizeof *r->damping),
              .weight = malloc(3 * n * sizeof *r->weight),
              .drag = view->drag};
  const int made = links && r->all && r->k && r->rest && r->damping && r->weight;
  if (made) fill(view, links, r);
  free(links);
  return made;
}

void runs_free(runs *r) {
  free(r->all), free(r->k), free(r->rest), free(r->damping), free(r->weight);
  *r = (runs){.n = 0};
}

/*------------------------------------- forces ---------------------------------------------------*/

/* Forces of one run on its particles i. DBL_MIN avoids 0/0 where two particles coincide. */
typedef struct pulls {
  double x[LONGEST], y[LONGEST], z[LONGEST];
} pulls;

/* p = k (l - L) d/l */
WIDE static void pull(int32_t length, int32_t n, const double *restrict xi,
                      const double *restrict xj, const double *restrict k,
                      const double *restrict rest, pulls *restrict p) {
  for (int32_t s = 0; s < length; s++) {
    const double dx = xj[s] - xi[s], dy = xj[n + s] - xi[n + s], dz = xj[2 * n + s] - xi[2 * n + s];
    const double l = sqrt(dx * dx + dy * dy + dz * dz);
    const double scale = k[s] * (l - rest[s]) / (l + DBL_MIN);
    p->x[s] = scale * dx, p->y[s] = scale * dy, p->z[s] = scale * dz;
  }
}

/* p += c (d . (v_j - v_i)) d/l^2 */
WIDE static void damp(int32_t length, int32_t n, const double *restrict xi,
                      const double *restrict xj, const double *restrict vi,
                      const double *restrict vj, const double *restrict c, pulls *restrict p) {
  for (int32_t s = 0; s < length; s++) {
    const double dx = xj[s] - xi[s], dy = xj[n + s] - xi[n + s], dz = xj[2 * n + s] - xi[2 * n + s];
    const double along =
        dx * (vj[s] - vi[s]) + dy * (vj[n + s] - vi[n + s]) + dz * (vj[2 * n + s] - vi[2 * n + s]);
    const double square = dx * dx + dy * dy + dz * dz;
    const double scale = c[s] * along / (square + DBL_MIN);
    p->x[s] += scale * dx, p->y[s] += scale * dy, p->z[s] += scale * dz;
  }
}

static void clear(int32_t length, pulls *p) {
  double *const components[3] = {p->x, p->y, p->z};
  for (int c = 0; c < 3; c++) memset(components[c], 0, (size_t)length * sizeof(double));
}

WIDE static void add(int32_t length, double sign, const double *restrict p, double *restrict f) {
  for (int32_t s = 0; s < length; s++) f[s] += sign * p[s];
}

static void scatter(const runs *r, const spring_run *run, const pulls *p, double *f) {
  const double *const components[3] = {p->x, p->y, p->z};
  for (int c = 0; c < 3; c++) {
    add(run->length, 1, components[c], f + c * r->n + run->i);
    add(run->length, -1, components[c], f + c * r->n + run->j);
  }
}

void runs_force(const runs *r, const double *x, const double *v, double *f) {
  pulls p;
  memcpy(f, r->weight, 3 * (size_t)r->n * sizeof *f);
  if (r->drag > 0) add(3 * r->n, -r->drag, v, f);
  for (const spring_run *run = r->all; run < r->all + r->count; run++) {
    if (r->elastic)
      pull(run->length, r->n, x + run->i, x + run->j, r->k + run->first, r->rest + run->first, &p);
    else clear(run->length, &p);
    if (r->damped)
      damp(run->length, r->n, x + run->i, x + run->j, v + run->i, v + run->j,
           r->damping + run->first, &p);
    scatter(r, run, &p, f);
  }
}
