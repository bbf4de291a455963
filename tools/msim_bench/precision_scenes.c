#include "precision_scenes.h"

#include <math.h>
#include <stdlib.h>

#include "scene_arrays.h"
#include "bench_scenes.h"

static const double down[3] = {0, 0, -9.81}; /* m/s^2 */
static const double pi = 3.14159265358979323846;

/*------------------------------------- cloths ---------------------------------------------------*/

/* Copies the arrays of a cloth. */
static msim_status take_cloth(int32_t side, double k, double k_bend, double damping,
                              const int32_t *pinned, int32_t npinned, scene_arrays *p,
                              msim_error *err) {
  msim_cloth cloth = bench_cloth(side, k, npinned, pinned);
  cloth.k_bend = k_bend;
  cloth.damping = damping;
  msim_scene *recipe = NULL;
  msim_status status = msim_scene_create(NULL, &recipe, err);
  if (!status) status = msim_scene_add_cloth(recipe, &cloth, err);
  const msim_status taken = scene_arrays_take(recipe, p);
  return status ? status : taken;
}

/* Builds a scene from the arrays and the pins of the recipe. */
static msim_status build_scene_from_arrays(const scene_arrays *p, const double *gravity,
                                           msim_scene *scene, msim_error *err) {
  msim_status status = scene_arrays_add(p, 1, scene, err);
  for (int32_t i = 0; i < p->view.nparticles && !status; i++)
    if (p->view.pinned[i]) status = msim_scene_pin(scene, 1, &i, err);
  if (!status && gravity) status = msim_scene_set_gravity(scene, gravity, err);
  return status;
}

/* Pinned at two neighbouring corners, the cloth swings down and folds. */
static msim_status hang_cloth(int32_t side, double k, double damping, msim_scene *scene,
                              msim_error *err) {
  const int32_t corners[2] = {0, side - 1};
  scene_arrays p;
  msim_status status = take_cloth(side, k, k, damping, corners, 2, &p, err);
  if (!status) status = build_scene_from_arrays(&p, down, scene, err);
  scene_arrays_free(&p);
  return status;
}

static msim_status folding(int32_t side, msim_scene *scene, msim_error *err) {
  return hang_cloth(side, 1e3, 0, scene, err);
}

static msim_status stiff(int32_t side, msim_scene *scene, msim_error *err) {
  return hang_cloth(side, 1e5, 0, scene, err);
}

/* Two particles of mass m on a spring are critically damped at c = sqrt(2 k m): with k = 1000 N/m,
 * 1.0 N s/m for 24 x 24 particles (0.52 g) and 2.0 N s/m for 12 x 12. */
static msim_status damped(int32_t side, msim_scene *scene, msim_error *err) {
  return hang_cloth(side, 1e3, 0.5, scene, err);
}

/* A fiftieth of critical damping for 24 x 24 particles */
static msim_status lightly_damped(int32_t side, msim_scene *scene, msim_error *err) {
  return hang_cloth(side, 1e3, 0.02, scene, err);
}

static int is_edge(int32_t i, int32_t side) {
  const int32_t row = i / side, column = i % side;
  return row == 0 || column == 0 || row == side - 1 || column == side - 1;
}

/* All edges pinned, every spring stretched by a ninth, and a small initial velocity
 * v_z = 0.2 sin(pi x) sin(pi y) m/s. */
static msim_status trampoline(int32_t side, msim_scene *scene, msim_error *err) {
  int32_t *edge = malloc((size_t)side * (size_t)side * sizeof *edge), count = 0;
  scene_arrays p;
  if (!edge) return MSIM_ERR_MEMORY;
  for (int32_t i = 0; i < side * side; i++)
    if (is_edge(i, side)) edge[count++] = i;
  msim_status status = take_cloth(side, 1e3, 1e3, 0, edge, count, &p, err);
  free(edge);
  for (int32_t s = 0; s < p.view.nsprings && !status; s++) p.rest[s] *= 0.9;
  for (int32_t i = 0; i < p.view.nparticles && !status; i++)
    if (!p.view.pinned[i])
      p.v[3 * i + 2] = 0.2 * sin(pi * p.view.x[3 * i]) * sin(pi * p.view.x[3 * i + 1]);
  if (!status) status = build_scene_from_arrays(&p, NULL, scene, err);
  scene_arrays_free(&p);
  return status;
}

/* A soft net pinned at its corners, with a cord of k = 1e6 N/m along its middle row. */
static msim_status cord(int32_t side, msim_scene *scene, msim_error *err) {
  const int32_t corners[4] = {0, side - 1, side * (side - 1), side * side - 1};
  scene_arrays p;
  msim_status status = take_cloth(side, 100, 0, 0, corners, 4, &p, err);
  for (int32_t s = 0; s < p.view.nsprings && !status; s++) {
    const int32_t i = p.view.ij[2 * s], j = p.view.ij[2 * s + 1];
    if (i / side == side / 2 && j / side == side / 2) p.k[s] = 1e6;
  }
  if (!status) status = build_scene_from_arrays(&p, down, scene, err);
  scene_arrays_free(&p);
  return status;
}

/*------------------------------------- others ---------------------------------------------------*/

enum { MOST_FACE = 64 }; /* particles */

/* A block of 20 cm and 1 kg that falls on an inclined plane and bounces. */
static msim_status jelly(int32_t side, msim_scene *scene, msim_error *err) {
  const msim_lattice block = {.size = sizeof block,
                              .n = {side, side, side},
                              .origin = {0, 0, 0.02},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 2000};
  const msim_plane floor = {.normal = {0.1, 0.05, 1}, .offset = 0, .restitution = 0.8};
  msim_status status = msim_scene_add_lattice(scene, &block, err);
  if (!status) status = msim_scene_add_plane(scene, &floor, err);
  if (!status) status = msim_scene_set_gravity(scene, down, err);
  return status;
}

/* A horizontal rope of 1 m and 0.1 kg, pinned at one end and released. */
static msim_status swing_rope(int32_t side, double damping, msim_scene *scene, msim_error *err) {
  const int32_t first = 0;
  const msim_rope rope = {.size = sizeof rope,
                          .n = side,
                          .to = {1, 0, 0},
                          .mass = 0.1,
                          .k = 1e4,
                          .damping = damping,
                          .npinned = 1,
                          .pinned = &first};
  msim_status status = msim_scene_add_rope(scene, &rope, err);
  if (!status) status = msim_scene_set_gravity(scene, down, err);
  return status;
}

static msim_status chain(int32_t side, msim_scene *scene, msim_error *err) {
  return swing_rope(side, 0, scene, err);
}

/* Critical damping, as of the cloth: 7.9 N s/m with 32 particles. */
static msim_status damped_rope(int32_t side, msim_scene *scene, msim_error *err) {
  return swing_rope(side, 4, scene, err);
}

/* A block of 20 cm and 1 kg, pinned at one face of side^2 particles, bends under gravity. Critical
 * damping, as of the cloth: 2.8 N s/m with 8^3 particles. */
static msim_status damped_jelly(int32_t side, msim_scene *scene, msim_error *err) {
  int32_t face[MOST_FACE];
  for (int32_t i = 0; i < side * side; i++) face[i] = i;
  const msim_lattice block = {.size = sizeof block,
                              .n = {side, side, side},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 2000,
                              .damping = 0.7,
                              .npinned = side * side,
                              .pinned = face};
  msim_status status = msim_scene_add_lattice(scene, &block, err);
  if (!status) status = msim_scene_set_gravity(scene, down, err);
  return status;
}

/* Pairs on a spring that fall tilted, bounce, and rotate by friction. */
static msim_status dumbbells(int32_t side, msim_scene *scene, msim_error *err) {
  const msim_plane floor = {.normal = {0, 0, 1}, .restitution = 0.7, .friction = 0.2};
  const double mass[2] = {0.1, 0.2}, k = 500, rest = 0.3, damping = 0;
  msim_status status = msim_scene_add_plane(scene, &floor, err);
  for (int32_t i = 0; i < side && !status; i++) {
    const int32_t ij[2] = {2 * i, 2 * i + 1};
    const double lean = 0.3 + 0.6 * i / side, high = 0.1 + 0.02 * i;
    const double x[6] = {0.5 * i, 0, high, 0.5 * i + rest * cos(lean), 0, high + rest * sin(lean)};
    const double v[6] = {0.5, 0.1, 0, 0.5, -0.1, 0};
    status = msim_scene_add_particles(scene, 2, x, v, mass, err);
    if (!status) status = msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err);
  }
  return status ? status : msim_scene_set_gravity(scene, down, err);
}

/* A block of 1 kg that slides down a slope of 20 degrees, decelerates and stops. */
static msim_status sliding(int32_t side, msim_scene *scene, msim_error *err) {
  const double angle = pi / 9, g[3] = {9.81 * sin(angle), 0, -9.81 * cos(angle)};
  const msim_plane slope = {.normal = {0, 0, 1}, .friction = 0.6};
  const msim_lattice block = {.size = sizeof block,
                              .n = {side, side, side},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 2000,
                              .damping = 0.5};
  msim_scene *recipe = NULL;
  msim_status status = msim_scene_create(NULL, &recipe, err);
  if (!status) status = msim_scene_add_lattice(recipe, &block, err);
  scene_arrays p;
  const msim_status taken = scene_arrays_take(recipe, &p);
  if (!status) status = taken;
  for (int32_t i = 0; i < p.view.nparticles && !status; i++) p.v[3 * i] = 0.4;
  if (!status) status = build_scene_from_arrays(&p, g, scene, err);
  scene_arrays_free(&p);
  return status ? status : msim_scene_add_plane(scene, &slope, err);
}

/*------------------------------------- the table ------------------------------------------------*/

/* sides and ends in a full run and with --quick; damped, impacts, stiff */
#define SCENE(side, quick_side, end, quick_end, damped, impacts, stiff) \
  {side, quick_side}, {end, quick_end}, damped, impacts, stiff
#define PLAIN(side, quick_side, end, quick_end) SCENE(side, quick_side, end, quick_end, 0, 0, 0)

static const precision_scene scenes[] = {
    {"trampoline",
     "stretched cloth pinned at all edges, with a small initial velocity; smooth motion",
     PLAIN(24, 16, 0.1, 0.05), trampoline},
    {"folding", "cloth pinned at two corners, falling", PLAIN(24, 16, 0.5, 0.2), folding},
    {"stiff", "the same, k = 1e5 N/m", PLAIN(16, 12, 0.2, 0.03), stiff},
    {"damped",
     "cloth pinned at two corners, with damping of 1/2 (24 x 24) or 1/4 (12 x 12) of critical",
     SCENE(24, 12, 0.5, 0.1, 1, 0, 0), damped},
    {"lightly_damped", "the same, with damping of 1/50 or 1/100 of critical",
     SCENE(24, 12, 0.5, 0.1, 1, 0, 0), lightly_damped},
    {"damped_rope", "rope pinned at one end, with damping of 1/2 of critical (32 particles)",
     SCENE(32, 16, 0.5, 0.2, 1, 0, 0), damped_rope},
    {"damped_jelly", "block pinned at a face, with damping of 1/4 of critical (8 x 8 x 8)",
     SCENE(8, 4, 0.3, 0.1, 1, 0, 0), damped_jelly},
    {"jelly", "block that bounces on a plane", SCENE(8, 5, 0.2, 0.1, 0, 1, 0), jelly},
    {"chain", "rope of stiff springs, swinging", PLAIN(32, 16, 0.5, 0.2), chain},
    {"dumbbells", "pairs that bounce and turn", SCENE(8, 3, 0.6, 0.4, 1, 1, 0), dumbbells},
    {"slide", "block that slides to rest on a slope", SCENE(4, 3, 0.5, 0.4, 1, 1, 0), sliding},
    {"cord", "cord of k = 1e6 N/m in a net of 100", SCENE(16, 12, 0.2, 0.1, 0, 0, 1e6), cord},
};

const precision_scene *precision_scene_info(int i) {
  return i >= 0 && i < (int)(sizeof scenes / sizeof *scenes) ? &scenes[i] : NULL;
}
