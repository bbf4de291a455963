#include "force_split.h"

#include <stdlib.h>
#include <string.h>

#include "ode.h"

/* The springs of one part. */
typedef struct spring_list {
  int32_t nsprings;
  int32_t *ij;
  double *k, *rest, *damping;
} spring_list;

static int part_make(int32_t most, spring_list *p) {
  const size_t n = (size_t)most + 1;
  *p = (spring_list){.ij = malloc(2 * n * sizeof *p->ij),
                     .k = malloc(n * sizeof *p->k),
                     .rest = malloc(n * sizeof *p->rest),
                     .damping = malloc(n * sizeof *p->damping)};
  return p->ij && p->k && p->rest && p->damping;
}

static void part_free(spring_list *p) { free(p->ij), free(p->k), free(p->rest), free(p->damping); }

static void part_add(const msim_scene_view *view, int32_t spring, double k, double damping,
                     spring_list *p) {
  const int32_t s = p->nsprings++;
  memcpy(p->ij + 2 * s, view->ij + 2 * spring, 2 * sizeof *p->ij);
  p->k[s] = k, p->rest[s] = view->rest[spring], p->damping[s] = damping;
}

/* Collects the springs of one part: the stiff ones, or the damping of all springs; or the others.
 * Gravity and drag belong to the others. */
static void select_springs(const msim_scene_view *view, int by, double limit, int stiff,
                           spring_list *p) {
  for (int32_t s = 0; s < view->nsprings; s++) {
    const int is_stiff = view->k[s] >= limit;
    if (by == SPLIT_DAMPING)
      part_add(view, s, stiff ? 0 : view->k[s], stiff ? view->damping[s] : 0, p);
    else if (is_stiff == stiff) part_add(view, s, view->k[s], view->damping[s], p);
  }
}

static int make_runs(const msim_scene_view *view, int by, double limit, int stiff, spring_runs *r) {
  msim_scene_view own = *view;
  spring_list p;
  int made = part_make(view->nsprings, &p);
  if (made) {
    select_springs(view, by, limit, stiff, &p);
    own.nsprings = p.nsprings;
    own.ij = p.ij, own.k = p.k, own.rest = p.rest, own.damping = p.damping;
    if (stiff) own.drag = 0, memset(own.gravity, 0, sizeof own.gravity);
    made = spring_runs_create(&own, r);
  }
  part_free(&p);
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
