#include "physics/scales.h"

#include <float.h>
#include <math.h>

#include "base/vec3.h"
#include "physics/bounds.h"
#include "physics/energy.h"
#include "physics/external_force.h"

/* Longest side of the bounding box; *farthest: the largest magnitude of a coordinate. */
static double find_extent(int32_t n, const double *x, double *farthest) {
  double extent = 0;
  *farthest = 0;
  for (size_t c = 0; c < 3; c++) {
    double low = x[c], high = x[c];
    for (size_t p = 0; p < (size_t)n; p++)
      low = fmin(low, x[3 * p + c]), high = fmax(high, x[3 * p + c]);
    extent = fmax(extent, high - low);
    *farthest = fmax(*farthest, fmax(fabs(low), fabs(high)));
  }
  return extent;
}

static double sum_free_mass(const ms_scene *scene) {
  double mass = 0;
  for (int32_t p = 0; p < scene->nparticles; p++)
    if (!scene->pinned[p]) mass += scene->mass[p];
  return mass > 0 ? mass : 1;
}

/* The root mean square of |F/m| over free particles, m/s^2, of constant forces F */
static double mean_force_acceleration(const ms_scene *scene) {
  double sum = 0, count = 0;
  for (size_t p = 0; p < (size_t)scene->nparticles && scene->force; p++) {
    if (scene->pinned[p]) continue;
    const double a = ms_vec3_norm(scene->force + 3 * p) / scene->mass[p];
    sum += a * a, count++;
  }
  return count > 0 ? sqrt(sum / count) : 0;
}

void ms_scales_set(const ms_scale_sources *from, ms_scales *scales) {
  const double g = from->gravity, T = from->span;
  double L = from->extent;
  if (!(L > 0)) L = sqrt(from->speed2) * T + g * T * T / 2;
  if (!(L > 0)) L = 1; /* nothing ever moves */
  double U = sqrt(from->speed2 + g * L);
  if (!(U > 0)) U = L / T;
  scales->extent = L;
  scales->speed = U;
  scales->rounding = 4 * DBL_EPSILON * fmax(L, from->farthest) * (1 / L + from->omega / U);
}

msim_status ms_scales_compute(const ms_scene *scene, const double *x, const double *v, double span,
                              ms_scales *scales, msim_error *err) {
  const double g = ms_external_acceleration(&scene->external) + mean_force_acceleration(scene);
  ms_bounds bounds;
  msim_energy energy = {.size = sizeof energy};
  msim_status status = ms_bounds_compute(scene, 0, &bounds, err);
  if (status) return status;
  ms_energy_compute(scene, x, v, &energy);
  *scales = (ms_scales){.mass = sum_free_mass(scene)};
  ms_scale_sources from = {.speed2 = 2 * (energy.kinetic + energy.elastic) / scales->mass,
                           .gravity = g,
                           .omega = bounds.omega,
                           .span = span};
  from.extent = find_extent(scene->nparticles, x, &from.farthest);
  ms_scales_set(&from, scales);
  scales->time =
      1 / (bounds.omega + bounds.rate + g / scales->speed + scales->speed / scales->extent);
  return MSIM_OK;
}
