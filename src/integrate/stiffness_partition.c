#include "integrate/stiffness_partition.h"

#include <limits.h>
#include <math.h>
#include <string.h>

#include "physics/external_force.h"
#include "scene/laws.h"

/* A scene that needs more is faulty. */
#define MAX_INNER_STEPS 1e6

/* h over the longest stable step of velocity Verlet */
static double stability_ratio(double h, ms_bounds b) { return h / ms_bounds_verlet_limit(&b); }

static double inverse_mass(const ms_model *model, int32_t row) {
  return row < model->unknowns.nfree ? model->inv_mass[row] : 0;
}

static void find_stiffness_classes(const ms_model *model, int *class_of) {
  const ms_springs *s = &model->springs;
  for (int32_t e = 0; e < s->n; e++)
    class_of[e] = ilogb(ms_scene_stiffness(model->scene, ms_springs_number(s, e)) *
                        (inverse_mass(model, s->i[e]) + inverse_mass(model, s->j[e])));
}

/* The bounds of bounds.h for the springs of classes [from, to] alone. sums: 2 nfree, scratch */
static ms_bounds bounds_between(const ms_model *model, const int *class_of, int from, int to,
                                double drag, double *sums) {
  const ms_springs *s = &model->springs;
  const int32_t n = model->unknowns.nfree;
  double *k = sums, *c = sums + n, omega2 = 0, rate = 0;
  memset(sums, 0, 2 * (size_t)n * sizeof *sums);
  for (int32_t e = 0; e < s->n; e++) {
    if (class_of[e] < from || class_of[e] > to) continue;
    const double of_k = ms_scene_stiffness(model->scene, ms_springs_number(s, e));
    const double of_c = ms_scene_damping(model->scene, ms_springs_number(s, e));
    if (s->i[e] < n) k[s->i[e]] += of_k, c[s->i[e]] += of_c;
    if (s->j[e] < n) k[s->j[e]] += of_k, c[s->j[e]] += of_c;
  }
  for (int32_t r = 0; r < n; r++) {
    omega2 = fmax(omega2, 2 * k[r] * model->inv_mass[r]);
    rate = fmax(rate, (2 * c[r] + drag) * model->inv_mass[r]);
  }
  return (ms_bounds){.omega = sqrt(omega2), .rate = rate};
}

/* The highest class below this one, and the number of springs of that class or above */
static int next_stiffness_class(const ms_springs *s, const int *class_of, int below,
                                int32_t *nstiff) {
  int next = INT_MIN;
  *nstiff = 0;
  for (int32_t e = 0; e < s->n; e++)
    if (class_of[e] < below && class_of[e] > next) next = class_of[e];
  for (int32_t e = 0; e < s->n; e++) *nstiff += class_of[e] >= next;
  return next;
}

msim_status ms_stiffness_partition_choose(const ms_model *model, double h, int *class_of,
                                          ms_stiffness_partition *partition, msim_error *err) {
  const int32_t n = model->springs.n;
  double *sums =
      ms_memory_allocate(&model->scene->alloc, 2 * (size_t)model->unknowns.nfree, sizeof *sums);
  *partition = (ms_stiffness_partition){0};
  if (!sums) return ms_error_set_memory(err, "the partition of springs by stiffness");
  find_stiffness_classes(model, class_of);
  const double whole =
      stability_ratio(h, bounds_between(model, class_of, INT_MIN, INT_MAX,
                                        ms_external_damping(&model->external), sums));
  double least = whole < 1 ? 0 : n * ceil(whole);
  for (ms_stiffness_partition at = {.stiffness_class = INT_MAX}; least > 0;) {
    at.stiffness_class =
        next_stiffness_class(&model->springs, class_of, at.stiffness_class, &at.nstiff);
    if (at.nstiff == n) break;
    const double stiff =
        stability_ratio(h, bounds_between(model, class_of, at.stiffness_class, INT_MAX, 0, sums));
    const double soft =
        stability_ratio(h, bounds_between(model, class_of, INT_MIN, at.stiffness_class - 1,
                                          ms_external_damping(&model->external), sums));
    const double inner = ceil(2 * stiff), cost = n + inner * at.nstiff;
    if (!(soft < 1 && inner < MAX_INNER_STEPS && cost < least)) continue;
    least = cost;
    at.inner = (int32_t)inner;
    *partition = at;
  }
  ms_memory_free(&model->scene->alloc, sums);
  return MSIM_OK;
}
