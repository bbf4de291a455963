/* drawn_scenes - small scenes of random particles, pins, springs and faces, and their comparison */
#ifndef TEST_DRAWN_SCENES_H
#define TEST_DRAWN_SCENES_H

#include <math.h>
#include <string.h>

#include "scene/scene.h"
#include "scenes.h"

static inline double draw(unsigned *seed) { return 2 * uniform(seed) - 1; }

static inline int32_t draw_index(unsigned *seed, int32_t n) { return (int32_t)(uniform(seed) * n); }

/* Particles at random places, of which some are pinned and some have no spring, springs and faces
 * between any of them, several springs between the same ones */
static inline msim_scene *draw_scene(const msim_allocator *alloc, unsigned seed) {
  enum { MOST = 40 };
  seed *= 2654435769u; /* first numbers of small seeds are alike */
  const int32_t n = 12 + draw_index(&seed, MOST - 12), m = draw_index(&seed, 3 * MOST),
                nfaces = draw(&seed) > -0.5 ? draw_index(&seed, 2 * MOST) : 0;
  double x[3 * MOST], v[3 * MOST], force[3 * MOST], mass[MOST], k[3 * MOST], rest[3 * MOST],
      damping[3 * MOST];
  int32_t ij[6 * MOST], faces[6 * MOST], pins[MOST], npins = 0;
  const double g[3] = {0.5, 0, -9.81};
  msim_scene *scene;
  for (int32_t i = 0; i < 3 * n; i++)
    x[i] = draw(&seed), v[i] = draw(&seed), force[i] = draw(&seed);
  for (int32_t p = 0; p < n; p++) {
    mass[p] = 1.5 + draw(&seed);
    if (draw(&seed) < -0.6) pins[npins++] = p, v[3 * p] = v[3 * p + 1] = v[3 * p + 2] = 0;
  }
  for (int32_t e = 0; e < m; e++) {
    ij[2 * e] = draw_index(&seed, n);
    ij[2 * e + 1] = (ij[2 * e] + 1 + draw_index(&seed, n - 1)) % n;
    k[e] = 20 + draw(&seed), rest[e] = 1 + draw(&seed), damping[e] = fmax(0, draw(&seed));
  }
  for (int32_t i = 0; i < nfaces; i++) {
    const int32_t p = draw_index(&seed, n - 2);
    for (int32_t c = 0; c < 3; c++) faces[3 * i + c] = p + c;
  }
  if (msim_scene_create(alloc, &scene, NULL) ||
      msim_scene_add_particles(scene, n, x, v, mass, NULL) ||
      (draw(&seed) > 0 && msim_scene_set_forces(scene, force, NULL)) ||
      msim_scene_add_springs(scene, m, ij, k, rest, damping, NULL) ||
      (nfaces && msim_scene_add_faces(scene, nfaces, faces, NULL)) ||
      msim_scene_pin(scene, npins, pins, NULL) || msim_scene_set_gravity(scene, g, NULL) ||
      msim_scene_set_name(scene, "drawn", NULL))
    return NULL;
  return scene;
}

static inline int is_same(const void *a, const void *b, int64_t count, size_t size) {
  return count == 0 || memcmp(a, b, (size_t)count * size) == 0;
}

static inline int are_same_scenes(const ms_scene *a, const ms_scene *b) {
  const int64_t n = a->nparticles, m = a->nsprings;
  const size_t real = sizeof(double);
  return n == b->nparticles && m == b->nsprings && a->nfaces == b->nfaces &&
         !a->force == !b->force && strcmp(a->name, b->name) == 0 &&
         is_same(a->x, b->x, 3 * n, real) && is_same(a->v, b->v, 3 * n, real) &&
         is_same(a->mass, b->mass, n, real) && is_same(a->pinned, b->pinned, n, 1) &&
         (!a->force || is_same(a->force, b->force, 3 * n, real)) &&
         is_same(a->ij, b->ij, 2 * m, 4) && is_same(a->k, b->k, m, real) &&
         is_same(a->rest, b->rest, m, real) && is_same(a->damping, b->damping, m, real) &&
         is_same(a->faces, b->faces, 3 * (int64_t)a->nfaces, 4) &&
         memcmp(&a->external, &b->external, sizeof a->external) == 0 && a->nplanes == b->nplanes &&
         is_same(a->planes, b->planes, a->nplanes, sizeof *a->planes) && a->nrun == b->nrun;
}

#endif
