#include "statics/support.h"

#include <math.h>

#include "base/vec3.h"
#include "contact/impacts.h"
#include "layout/components.h"

/* The external force on a body, and whether something may hold it */
typedef struct body {
  double force[3];
  int is_held;
} body;

/* A body that an edge connects with a pinned particle is held. of: of a particle, < 0 if pinned */
static void hold_neighbours(const ms_scene *scene, const int32_t *of, body *bodies) {
  const int64_t edges = (int64_t)scene->nsprings + 2 * (int64_t)scene->angles.n;
  for (int64_t e = 0; e < edges; e++) {
    const int64_t at = e - scene->nsprings; /* edges of angular springs follow */
    const int32_t *ij = at < 0 ? scene->ij + 2 * e : scene->angles.ijk + 3 * (at / 2) + at % 2;
    const int32_t i = of[ij[0]], j = of[ij[1]];
    if (i < 0 && j >= 0) bodies[j].is_held = 1;
    if (j < 0 && i >= 0) bodies[i].is_held = 1;
  }
}

/* 1: colliders may stop a particle at x, which f moves. Heights continue beyond their grid. */
static int may_be_stopped(const ms_scene *scene, const double x[3], const double f[3]) {
  const double distance = ms_vec3_dot(x, f) / ms_vec3_norm(f);
  for (int32_t i = 0; i < scene->ncolliders; i++) {
    const ms_solid *s = &scene->solids[i];
    if (s->inside || s->type == MSIM_COLLIDER_HEIGHTFIELD || distance < s->reach) return 1;
  }
  return 0;
}

/* 1: planes may hold a body against f. Without colliders and friction, or with one plane, they do
 * so if and only if f points into the cone of their normals, or of friction. */
static int may_be_held(const ms_scene *scene, const double f[3]) {
  const double SMALL = 1e-9 * ms_vec3_norm(f);
  double left[3] = {f[0], f[1], f[2]}, limit;
  ms_plane_set all = {0};
  if (scene->nplanes > MS_MAX_TOUCHED_PLANES) return 1;
  while (all.n < scene->nplanes) all.plane[all.n] = &scene->planes[all.n], all.n++;
  const ms_plane_set pushing = ms_impacts_remove_pressing(&all, SMALL, left, &limit);
  if (scene->ncolliders || (all.n > 1 && limit > 0)) return pushing.n > 0;
  return ms_vec3_norm(left) <= limit + SMALL;
}

static void add_external_force(const ms_scene *scene, int32_t p, double sum[3]) {
  ms_vec3_axpy(scene->mass[p], scene->external.gravity, sum);
  if (scene->force) ms_vec3_axpy(1, scene->force + 3 * (size_t)p, sum);
}

static msim_status check_bodies(const ms_scene *scene, const int32_t *of, body *bodies,
                                const double *x, double accepted, msim_error *err) {
  const int32_t n = scene->nparticles;
  const int has_obstacles = ms_scene_has_obstacles(scene);
  hold_neighbours(scene, of, bodies);
  for (int32_t p = 0; p < n; p++)
    if (of[p] >= 0) add_external_force(scene, p, bodies[of[p]].force);
  for (int32_t p = 0; p < n; p++)
    if (of[p] >= 0 && (may_be_held(scene, bodies[of[p]].force) ||
                       may_be_stopped(scene, x + 3 * (size_t)p, bodies[of[p]].force)))
      bodies[of[p]].is_held = 1;
  for (int32_t p = 0; p < n; p++) {
    if (of[p] < 0 || bodies[of[p]].is_held) continue;
    const double left = ms_vec3_norm(bodies[of[p]].force);
    if (left > accepted)
      return ms_error_set(err, MSIM_NOT_CONVERGED,
                          "there is no equilibrium%s: a force of %.3g N moves the body of particle "
                          "%d, which is connected to no pinned particle%s",
                          has_obstacles ? " near the start" : "", left, p,
                          has_obstacles ? " and held by no obstacle" : "");
  }
  return MSIM_OK;
}

msim_status ms_support_check(const ms_scene *scene, const double *x, double accepted,
                             msim_error *err) {
  body *bodies = NULL;
  int32_t *of;
  if (ms_scene_has_function(scene)) return MSIM_OK;
  const int fits = MS_NEW(&scene->alloc, of, scene->nparticles) != NULL;
  const int32_t n = fits ? ms_components_number_particles(scene, of) : 0;
  msim_status status;
  if (!fits || !MS_NEW(&scene->alloc, bodies, n))
    status = ms_error_set_memory(err, "the equilibrium");
  else status = check_bodies(scene, of, bodies, x, accepted, err);
  MS_FREE(&scene->alloc, of, bodies);
  return status;
}
