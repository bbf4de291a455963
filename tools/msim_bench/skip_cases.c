#include "skip_cases.h"

#include <math.h>
#include <string.h>

#include "scene_arrays.h"

enum { SIDE = 100, N = SIDE * SIDE, JELLY = 16 };
#define STIFFNESS 1000.0 /* N/m, of every spring */

/*------------------------------------- scenes ---------------------------------------------------*/

static msim_status add_free_cloth(msim_scene *scene, double x, msim_error *err) {
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = SIDE,
                            .columns = SIDE,
                            .origin = {x, 0, 0},
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = STIFFNESS,
                            .k_shear = STIFFNESS,
                            .k_bend = STIFFNESS};
  return msim_scene_add_cloth(scene, &cloth, err);
}

static msim_status take_free_cloth(scene_arrays *p, msim_error *err) {
  msim_scene *recipe = NULL;
  msim_status status = msim_scene_create(NULL, &recipe, err);
  if (!status) status = add_free_cloth(recipe, 0, err);
  const msim_status taken = scene_arrays_take(recipe, p);
  return status ? status : taken;
}

static void set_rest_lengths_to_0(scene_arrays *p) {
  memset(p->rest, 0, (size_t)p->view.nsprings * sizeof *p->rest);
}

static msim_status pin_corners(msim_scene *scene, msim_error *err) {
  const int32_t corners[2] = {0, SIDE - 1};
  return msim_scene_pin(scene, 2, corners, err);
}

/* A cloth that sways along z or within its plane. */
static void sway(scene_arrays *p, int axis) {
  for (int32_t i = 0; i < p->view.nparticles; i++)
    p->v[3 * i + axis] = 0.1 * sin(3 * p->view.x[3 * i]) * p->view.x[3 * i + 1];
}

static msim_status swaying(int axis, const double *gravity, int springs, int no_rest,
                           msim_scene *scene, msim_error *err) {
  scene_arrays p;
  msim_status status = take_free_cloth(&p, err);
  if (!status) sway(&p, axis);
  if (!status && no_rest) set_rest_lengths_to_0(&p);
  if (!status) status = scene_arrays_add(&p, springs, scene, err);
  if (!status && springs) status = pin_corners(scene, err);
  if (!status && gravity) status = msim_scene_set_gravity(scene, gravity, err);
  scene_arrays_free(&p);
  return status;
}

static const double down[3] = {0, 0, -9.81}, along[3] = {0, 9.81, 0};

static msim_status loose(int without, msim_scene *scene, msim_error *err) {
  (void)without;
  return swaying(2, down, 0, 0, scene, err);
}

static msim_status collapsing(int without, msim_scene *scene, msim_error *err) {
  (void)without;
  return swaying(2, down, 1, 1, scene, err);
}

static msim_status make_planar_cloth(int without, msim_scene *scene, msim_error *err) {
  (void)without;
  return swaying(1, along, 1, 0, scene, err);
}

static msim_status unmoved(int without, msim_scene *scene, msim_error *err) {
  (void)without;
  return swaying(2, NULL, 1, 0, scene, err);
}

/* A cloth at its rest lengths, without gravity and initial velocity. */
static msim_status resting(int without, msim_scene *scene, msim_error *err) {
  scene_arrays p;
  (void)without;
  msim_status status = take_free_cloth(&p, err);
  if (!status) status = scene_arrays_add(&p, 1, scene, err);
  scene_arrays_free(&p);
  return status;
}

/* A swaying cloth next to four cloths at rest. */
static msim_status among_resting(int without, msim_scene *scene, msim_error *err) {
  msim_status status = unmoved(without, scene, err);
  for (int i = 1; i <= 4 && !status; i++) status = add_free_cloth(scene, 2 * i, err);
  return status;
}

/* Half of the rows are pinned; without: free, as in a program that skips nothing. */
static msim_status half_pinned(int without, msim_scene *scene, msim_error *err) {
  static int32_t held[N / 2];
  scene_arrays p;
  msim_status status = take_free_cloth(&p, err);
  if (!status) sway(&p, 2);
  for (int32_t i = 0; i < N / 2 && !status; i++) {
    held[i] = i;
    p.v[3 * i + 2] = 0;
  }
  if (!status) status = scene_arrays_add(&p, 1, scene, err);
  if (!status && !without) status = msim_scene_pin(scene, N / 2, held, err);
  scene_arrays_free(&p);
  return status;
}

/* A jelly, pinned at a face, that starts with a velocity and vibrates without numerical damping. */
static msim_status trembling(int without, msim_scene *scene, msim_error *err) {
  static int32_t face[JELLY * JELLY];
  const msim_lattice jelly = {.size = sizeof jelly,
                              .n = {JELLY, JELLY, JELLY},
                              .extent = {1, 1, 1},
                              .mass = 1,
                              .k = STIFFNESS};
  msim_scene *recipe = NULL;
  scene_arrays p;
  (void)without;
  for (int32_t i = 0; i < JELLY * JELLY; i++) face[i] = i;
  msim_status status = msim_scene_create(NULL, &recipe, err);
  if (!status) status = msim_scene_add_lattice(recipe, &jelly, err);
  const msim_status taken = scene_arrays_take(recipe, &p);
  if (!status) status = taken;
  for (int32_t i = 0; i < p.view.nparticles && !status; i++)
    p.v[3 * i + 2] = p.view.x[3 * i] * p.view.x[3 * i];
  if (!status) status = scene_arrays_add(&p, 1, scene, err);
  if (!status) status = msim_scene_pin(scene, JELLY * JELLY, face, err);
  if (!status) status = msim_scene_set_gravity(scene, down, err);
  scene_arrays_free(&p);
  return status;
}

/*------------------------------------- the table ------------------------------------------------*/

#define LINEARLY_IMPLICIT_STEPS "linearly-implicit-euler", 1.0 / 60
#define MIDPOINT_STEPS          "implicit-midpoint", 1.0 / 60
#define EXPLICIT_STEPS          "symplectic-euler", 1e-5
#define FEATURE_CASE(name) \
  { name, NULL, "cloth100, no gravity", EXPLICIT_STEPS, {"skip." name}, unmoved, 0 }

const skip_case *skip_case_info(int i) {
  static const skip_case cases[] = {
      {"no_springs",
       "no_springs",
       "10000 particles, no springs",
       LINEARLY_IMPLICIT_STEPS,
       {"skip.springs", "skip.zero_rest_length"},
       loose,
       8},
      {"zero_rest_length",
       "zero_rest_length",
       "cloth100, rest lengths 0",
       LINEARLY_IMPLICIT_STEPS,
       {"skip.zero_rest_length"},
       collapsing,
       8},
      {"kept_factor",
       "kept_factor_jelly16",
       "jelly16, struck",
       MIDPOINT_STEPS,
       {"skip.kept_factor"},
       trembling,
       8},
      {"two_d",
       "two_d",
       "cloth100 in its own plane",
       MIDPOINT_STEPS,
       {"skip.two_d"},
       make_planar_cloth,
       8},
      {"pinned",
       "half_pinned",
       "cloth100, half of it pinned, over all of it free",
       LINEARLY_IMPLICIT_STEPS,
       {NULL},
       half_pinned,
       8},
      {"zero_rest_length, explicit",
       NULL,
       "cloth100, rest lengths 0",
       EXPLICIT_STEPS,
       {"skip.zero_rest_length"},
       collapsing,
       0},
      {"two_d, explicit",
       NULL,
       "cloth100 in its own plane",
       EXPLICIT_STEPS,
       {"skip.two_d"},
       make_planar_cloth,
       0},
      {"islands",
       NULL,
       "cloth100 beside four at rest",
       LINEARLY_IMPLICIT_STEPS,
       {"skip.islands"},
       among_resting,
       0},
      {"islands, explicit",
       NULL,
       "cloth100 beside four at rest",
       EXPLICIT_STEPS,
       {"skip.islands"},
       among_resting,
       0},
      {"at_rest", NULL, "cloth100 at rest", LINEARLY_IMPLICIT_STEPS, {"skip.at_rest"}, resting, 0},
      {"at_rest, explicit", NULL, "cloth100 at rest", EXPLICIT_STEPS, {"skip.at_rest"}, resting, 0},
      FEATURE_CASE("planes"),
      FEATURE_CASE("damping"),
      FEATURE_CASE("drag"),
      FEATURE_CASE("gravity"),
  };
  return i >= 0 && i < (int)(sizeof cases / sizeof *cases) ? &cases[i] : NULL;
}
