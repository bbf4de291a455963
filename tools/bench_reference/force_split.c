#include "force_split.h"

#include <stdlib.h>
#include <string.h>

#include "ode.h"

/* The part of a spring's stiffness or damping: stiff springs, or the damping of all springs, belong
 * to the stiff part. */
static double share(const msim_scene_view *view, int by, double limit, int stiff, int32_t spring,
                    int is_damping) {
  const double value = is_damping ? view->damping[spring] : view->k[spring];
  const int is_stiff = by == SPLIT_DAMPING ? is_damping : view->k[spring] >= limit;
  return is_stiff == stiff ? value : 0;
}

/* Gravity and drag belong to the others. */
static int make_runs(const msim_scene_view *view, int by, double limit, int stiff, spring_runs *r) {
  const size_t n = (size_t)view->nsprings;
  double *k = malloc((2 * n + 1) * sizeof *k), *damping = k + n;
  msim_scene_view own = *view;
  if (!k) return 0;
  for (int32_t s = 0; s < view->nsprings; s++) {
    k[s] = share(view, by, limit, stiff, s, 0);
    damping[s] = share(view, by, limit, stiff, s, 1);
  }
  own.k = k, own.damping = damping;
  if (stiff) own.drag = 0, memset(own.gravity, 0, sizeof own.gravity);
  const int made = spring_runs_create(&own, r);
  free(k);
  return made;
}

int force_split_create(const msim_scene_view *view, int by, double stiff, force_split *s) {
  *s = (force_split){.by = by};
  return !by ||
         (make_runs(view, by, stiff, 1, &s->stiff) && make_runs(view, by, stiff, 0, &s->others));
}

void force_split_free(force_split *s) {
  spring_runs_free(&s->stiff);
  spring_runs_free(&s->others);
}
