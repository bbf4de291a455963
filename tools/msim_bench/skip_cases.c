#include "skip_cases.h"

#include <math.h>
#include <string.h>

#include "bench_scenes.h"
#include "scene_arrays.h"

enum { SIDE = 100, JELLY_SIDE = 16, N = SIDE * SIDE };
#define STIFFNESS 1000.0 /* N/m, of every spring */

/* A cloth pinned at two corners that sways along z, with no gravity, but for these properties. */
enum {
  LOOSE = 1,          /* no springs, no pins */
  ZERO_REST = 2,      /* rest lengths 0 */
  IN_PLANE = 4,       /* it sways within its plane, along y, where gravity is */
  AT_REST = 8,        /* it does not move, at its rest lengths; no pins */
  AMONG_RESTING = 16, /* beside four cloths at rest */
  HALF_PINNED = 32,   /* half of the rows; without: free, as in a program that skips nothing */
  JELLY = 64,         /* pinned at a face, vibrates without numerical damping */
  LAWS = 128,         /* without: all springs have a law, tension only */
  NO_FORCES = 256,    /* no constant forces on particles; without: tiny ones */
  NO_COLLIDERS = 512, /* without: beside one of each type, which it does not meet */
  NO_MOTION = 1024,   /* both pinned corners stay; without: they have a motion */
  NO_FUNCTION = 2048, /* without: a force function that returns 0 */
  NO_ANGLES = 4096,   /* without: angular springs along rows and columns */
  NO_BREAKING = 8192  /* without: all springs have a law by which they may break */
};

/* Of NO_COLLIDERS: only one of this type */
#define ONLY(type) ((unsigned)(type) << 16)

/*------------------------------------- the table ------------------------------------------------*/

#define LINEARLY_IMPLICIT "linearly-implicit-euler", 1.0 / 60
#define MIDPOINT          "implicit-midpoint", 1.0 / 60
#define EXPLICIT          "symplectic-euler", 1e-5
#define DOWN              -9.81 /* m/s^2, along z */

static const skip_case cases[] = {
    {"no_springs", "no_springs", "10000 particles, no springs", LINEARLY_IMPLICIT, 8, LOOSE, DOWN,
     "skip.springs", "skip.zero_rest_length"},
    {"zero_rest_length", "zero_rest_length", "cloth100, rest lengths 0", LINEARLY_IMPLICIT, 8,
     ZERO_REST, DOWN, "skip.zero_rest_length", NULL},
    {"kept_factor", "kept_factor_jelly16", "jelly16, struck", MIDPOINT, 8, JELLY, DOWN,
     "skip.kept_factor", NULL},
    {"two_d", "two_d", "cloth100 in its own plane", MIDPOINT, 8, IN_PLANE, 0, "skip.two_d", NULL},
    {"pinned", "half_pinned", "cloth100, half of it pinned, over all of it free", LINEARLY_IMPLICIT,
     8, HALF_PINNED, 0, NULL, NULL},
    {"zero_rest_length, explicit", NULL, "cloth100, rest lengths 0", EXPLICIT, 0, ZERO_REST, DOWN,
     "skip.zero_rest_length", NULL},
    {"two_d, explicit", NULL, "cloth100 in its own plane", EXPLICIT, 0, IN_PLANE, 0, "skip.two_d",
     NULL},
    {"islands", NULL, "cloth100 beside four at rest", LINEARLY_IMPLICIT, 0, AMONG_RESTING, 0,
     "skip.islands", NULL},
    {"islands, explicit", NULL, "cloth100 beside four at rest", EXPLICIT, 0, AMONG_RESTING, 0,
     "skip.islands", NULL},
    {"at_rest", NULL, "cloth100 at rest", LINEARLY_IMPLICIT, 0, AT_REST, 0, "skip.at_rest", NULL},
    {"at_rest, explicit", NULL, "cloth100 at rest", EXPLICIT, 0, AT_REST, 0, "skip.at_rest", NULL},
    {"planes", NULL, "cloth100, no gravity", EXPLICIT, 0, 0, 0, "skip.planes", NULL},
    {"colliders", NULL, "cloth100, no gravity, over it beside four colliders", EXPLICIT, 0,
     NO_COLLIDERS, 0, NULL, NULL},
    {"damping", NULL, "cloth100, no gravity", EXPLICIT, 0, 0, 0, "skip.damping", NULL},
    {"drag", NULL, "cloth100, no gravity", EXPLICIT, 0, 0, 0, "skip.drag", NULL},
    {"laws", NULL, "cloth100, linear, over one of cables", EXPLICIT, 0, LAWS, 0, NULL, NULL},
    {"gravity", NULL, "cloth100, no gravity", EXPLICIT, 0, 0, 0, "skip.gravity", NULL},
    {"motions", NULL, "cloth100, pins that stay, over pins that move", EXPLICIT, 0, NO_MOTION, 0,
     NULL, NULL},
    {"forces", NULL, "cloth100, no forces on particles, over tiny ones", EXPLICIT, 0, NO_FORCES, 0,
     NULL, NULL},
    {"force_function", NULL, "cloth100, no gravity, over it with a force function", EXPLICIT, 0,
     NO_FUNCTION, 0, NULL, NULL},
    {"angles", NULL, "cloth100, no gravity, over it with angular springs", EXPLICIT, 0, NO_ANGLES,
     0, NULL, NULL},
    {"breaking", NULL, "cloth100, linear, over one whose springs may break", EXPLICIT, 0,
     NO_BREAKING, 0, NULL, NULL},
    {"contacts", NULL, "cloth100, no gravity, over it with contacts recorded", EXPLICIT, 0, 0, 0,
     "contacts=on", NULL},
    {"incomplete", NULL, "cloth100, over it with incomplete = accept", LINEARLY_IMPLICIT, 8, 0,
     DOWN, "incomplete=accept", NULL},
    {"sphere", NULL, "cloth100, no gravity, over it beside a sphere", EXPLICIT, 0,
     NO_COLLIDERS | ONLY(MSIM_COLLIDER_SPHERE), 0, NULL, NULL},
    {"capsule", NULL, "cloth100, no gravity, over it beside a capsule", EXPLICIT, 0,
     NO_COLLIDERS | ONLY(MSIM_COLLIDER_CAPSULE), 0, NULL, NULL},
    {"cylinder", NULL, "cloth100, no gravity, over it beside a cylinder", EXPLICIT, 0,
     NO_COLLIDERS | ONLY(MSIM_COLLIDER_CYLINDER), 0, NULL, NULL},
    {"box", NULL, "cloth100, no gravity, over it beside a box", EXPLICIT, 0,
     NO_COLLIDERS | ONLY(MSIM_COLLIDER_BOX), 0, NULL, NULL},
    {"heightfield", NULL, "cloth100, no gravity, over it above a height field", EXPLICIT, 0,
     NO_COLLIDERS | ONLY(MSIM_COLLIDER_HEIGHTFIELD), 0, NULL, NULL},
    {"sdf", NULL, "cloth100, no gravity, over it beside a solid on a grid", EXPLICIT, 0,
     NO_COLLIDERS | ONLY(MSIM_COLLIDER_SDF), 0, NULL, NULL},
};

const skip_case *skip_case_info(int i) {
  return i >= 0 && i < (int)(sizeof cases / sizeof *cases) ? &cases[i] : NULL;
}

/*------------------------------------- building -------------------------------------------------*/

static msim_status add_free_cloth(msim_scene *scene, double x, msim_error *err) {
  msim_cloth cloth = bench_cloth(SIDE, STIFFNESS, 0, NULL);
  cloth.origin[0] = x;
  return msim_scene_add_cloth(scene, &cloth, err);
}

static msim_status add_recipe(unsigned is, msim_scene *recipe, msim_error *err) {
  const msim_lattice jelly = {.size = sizeof jelly,
                              .n = {JELLY_SIDE, JELLY_SIDE, JELLY_SIDE},
                              .extent = {1, 1, 1},
                              .mass = 1,
                              .k = STIFFNESS};
  return is & JELLY ? msim_scene_add_lattice(recipe, &jelly, err) : add_free_cloth(recipe, 0, err);
}

static void set_velocities(unsigned is, scene_arrays *p) {
  const int axis = is & IN_PLANE ? 1 : 2;
  for (int32_t i = is & HALF_PINNED ? N / 2 : 0; i < p->view.nparticles; i++) {
    const double *x = p->view.x + 3 * i;
    p->v[3 * i + axis] = is & JELLY ? x[0] * x[0] : 0.1 * sin(3 * x[0]) * x[1];
  }
}

static msim_status pin_scene(unsigned is, int without, msim_scene *scene, msim_error *err) {
  static int32_t first[N / 2];
  const int32_t corners[2] = {0, SIDE - 1};
  for (int32_t i = 0; i < N / 2; i++) first[i] = i;
  if (is & (LOOSE | AT_REST) || (is & HALF_PINNED && without)) return MSIM_OK;
  if (is & HALF_PINNED) return msim_scene_pin(scene, N / 2, first, err);
  if (is & JELLY) return msim_scene_pin(scene, JELLY_SIDE * JELLY_SIDE, first, err);
  return msim_scene_pin(scene, 2, corners, err);
}

static msim_status set_tiny_forces(msim_scene *scene, msim_error *err) {
  static double force[3 * N];
  for (int32_t i = 0; i < 3 * N; i++) force[i] = 1e-30;
  return msim_scene_set_forces(scene, force, err);
}

/* Those of one type, or those without samples */
static msim_status add_colliders(unsigned only, msim_scene *scene, msim_error *err) {
  enum { GRID = 3 };
  static const double flat[GRID * GRID];
  double distances[GRID * GRID * GRID];
  for (int i = 0; i < GRID * GRID * GRID; i++)
    distances[i] = i == GRID * GRID * GRID / 2 ? -0.5 : 0.5; /* a solid in the middle */
  const msim_collider colliders[] = {
      {.type = MSIM_COLLIDER_HEIGHTFIELD,
       .origin = {0, 0, -5},
       .spacing = {0.5, 0.5},
       .n = {GRID, GRID},
       .values = flat},
      {.type = MSIM_COLLIDER_SDF,
       .origin = {0, 0, -5},
       .spacing = {0.5, 0.5, 0.5},
       .n = {GRID, GRID, GRID},
       .values = distances},
      {.type = MSIM_COLLIDER_SPHERE, .center = {0, 0, -5}, .radius = 1},
      {.type = MSIM_COLLIDER_CAPSULE, .from = {0, 0, -5}, .to = {1, 0, -5}, .radius = 1},
      {.type = MSIM_COLLIDER_CYLINDER, .from = {0, 0, -5}, .to = {1, 0, -5}, .radius = 1},
      {.type = MSIM_COLLIDER_BOX, .center = {0, 0, -5}, .extent = {1, 1, 1}}};
  msim_status status = MSIM_OK;
  for (size_t i = 0; i < sizeof colliders / sizeof *colliders && !status; i++) {
    msim_collider c = colliders[i];
    c.size = sizeof c;
    if (only ? only != ONLY(c.type) : c.values != NULL) continue;
    status = msim_scene_add_collider(scene, &c, err);
  }
  return status;
}

/* All springs get a law: they become cables, or may break. */
static msim_status add_laws(int breaking, int32_t nsprings, msim_scene *scene, msim_error *err) {
  const msim_law law = {.size = sizeof law,
                        .kind = breaking ? MSIM_LAW_LINEAR : MSIM_LAW_TENSION,
                        .break_force = breaking ? 1e9 : 0};
  int32_t index;
  msim_status status = msim_scene_add_law(scene, &law, &index, err);
  for (int32_t e = 0; e < nsprings && !status; e++)
    status = msim_scene_set_law(scene, 1, &e, index, err);
  return status;
}

static int return_no_force(void *data, const msim_force_batch *batch) {
  (void)data, (void)batch;
  return 0;
}

static msim_status add_function(msim_scene *scene, msim_error *err) {
  const msim_force_function f = {.size = sizeof f, .name = "none", .evaluate = return_no_force};
  return msim_scene_set_force_function(scene, &f, err);
}

static msim_status add_angles(msim_scene *scene, msim_error *err) {
  const double k = 1e-3; /* N m/rad^2 */
  msim_status status = MSIM_OK;
  for (int32_t p = 0; p < N; p++)
    for (int d = 0; d < 2; d++) {
      const int32_t step = d ? SIDE : 1, at = d ? p / SIDE : p % SIDE;
      const int32_t ijk[3] = {p - step, p, p + step};
      if (at > 0 && at < SIDE - 1 && !status)
        status = msim_scene_add_angles(scene, 1, ijk, &k, NULL, NULL, err);
    }
  return status;
}

static msim_status move_corners(msim_scene *scene, msim_error *err) {
  static const int32_t corners[2] = {0, SIDE - 1};
  static const double t[2] = {0, 1e9};
  msim_scene_view view = {.size = sizeof view};
  double x[2][2][3];
  msim_scene_get(scene, &view);
  for (int k = 0; k < 2; k++)
    for (int i = 0; i < 2; i++)
      for (int c = 0; c < 3; c++) x[k][i][c] = view.x[3 * corners[i] + c] + k;
  const msim_motion m = {
      .size = sizeof m, .n = 2, .particles = corners, .nt = 2, .t = t, .x = &x[0][0][0]};
  return msim_scene_add_motion(scene, &m, err);
}

msim_status skip_case_build(const skip_case *what, int without, msim_scene *scene,
                            msim_error *err) {
  const unsigned is = what->is;
  const double gravity[3] = {0, is & IN_PLANE ? 9.81 : 0, what->gravity};
  msim_scene *recipe = NULL;
  scene_arrays p;
  msim_status status = msim_scene_create(NULL, &recipe, err);
  if (!status) status = add_recipe(is, recipe, err);
  const msim_status taken = scene_arrays_take(recipe, &p);
  if (!status) status = taken;
  if (!status && !(is & AT_REST)) set_velocities(is, &p);
  if (!status && is & ZERO_REST) memset(p.rest, 0, (size_t)p.view.nsprings * sizeof *p.rest);
  if (!status) status = scene_arrays_add(&p, !(is & LOOSE), scene, err);
  if (!status) status = pin_scene(is, without, scene, err);
  if (!status && is & (LAWS | NO_BREAKING) && without)
    status = add_laws((is & NO_BREAKING) != 0, p.view.nsprings, scene, err);
  if (!status && is & NO_FUNCTION && without) status = add_function(scene, err);
  if (!status && is & NO_ANGLES && without) status = add_angles(scene, err);
  if (!status) status = msim_scene_set_gravity(scene, gravity, err);
  if (!status && is & NO_MOTION && without) status = move_corners(scene, err);
  if (!status && is & NO_FORCES && without) status = set_tiny_forces(scene, err);
  if (!status && is & NO_COLLIDERS && without) status = add_colliders(is & ~0xffffu, scene, err);
  for (int i = 1; i <= 4 && is & AMONG_RESTING && !status; i++)
    status = add_free_cloth(scene, 2 * i, err);
  scene_arrays_free(&p);
  return status;
}
