#include "choose/fast_turns.h"

/* cos^2 of 8 degrees, 1 - cos = 0.01 */
static const double COSINE_SQUARED = 0.9801;

/* 1: a spring turns from d to d + h d' by more than that angle. */
static int is_fast(const ms_scene *scene, const double *x, const double *v, double h) {
  for (int32_t e = 0; e < scene->nsprings; e++) {
    const size_t i = 3 * (size_t)scene->ij[2 * e], j = 3 * (size_t)scene->ij[2 * e + 1];
    double before = 0, after = 0, both = 0;
    for (size_t k = 0; k < 3; k++) {
      const double from = x[j + k] - x[i + k], to = from + h * (v[j + k] - v[i + k]);
      before += from * from, after += to * to, both += from * to;
    }
    const int turns = both < 0 || both * both < COSINE_SQUARED * before * after;
    if (turns && !ms_scene_is_linear(scene, e)) return 1;
  }
  return 0;
}

int ms_fast_turns_are_there(const ms_pilot_run *p, double h) {
  const ms_scene *scene = p->sim->scene;
  return is_fast(scene, p->start.x, p->start.v, h) || is_fast(scene, p->middle.x, p->middle.v, h) ||
         is_fast(scene, p->end.x, p->end.v, h);
}
