#include "skip_cases.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 100, N = SIDE * SIDE, JELLY = 16 };
#define STIFFNESS 1000.0 /* N/m, of every spring */

/*------------------------------------- scenes ---------------------------------------------------*/

/* The arrays of a scene that is built from a recipe, to be changed before they are used. */
typedef struct parts {
  msim_scene *recipe;
  msim_scene_view view;
  double *v, *mass, *zeros;
} parts;

static void free_parts(parts *p) {
  free(p->v), free(p->mass), free(p->zeros);
  msim_scene_destroy(p->recipe);
}

/* Everything but the particles' velocities, which are 0, and their pins. */
static msim_status take_parts(msim_scene *recipe, parts *p) {
  *p = (parts){.recipe = recipe, .view = {.size = sizeof p->view}};
  msim_scene_get(recipe, &p->view);
  const size_t n = (size_t)p->view.nparticles, springs = (size_t)p->view.nsprings;
  p->v = calloc(3 * n, sizeof *p->v);
  p->mass = malloc(n * sizeof *p->mass);
  p->zeros = calloc(springs + 1, sizeof *p->zeros);
  if (!p->v || !p->mass || !p->zeros) return MSIM_ERR_MEMORY;
  memcpy(p->mass, p->view.mass, n * sizeof *p->mass);
  return MSIM_OK;
}

static msim_status add_cloth(msim_scene *scene, double x, msim_error *err) {
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

static msim_status make_cloth(parts *p, msim_error *err) {
  msim_scene *recipe = NULL;
  *p = (parts){.recipe = NULL};
  msim_status status = msim_scene_create(NULL, &recipe, err);
  if (!status) status = add_cloth(recipe, 0, err);
  if (!status) return take_parts(recipe, p);
  msim_scene_destroy(recipe);
  return status;
}

/* rest NULL: the lengths at the start */
static msim_status add_parts(msim_scene *scene, const parts *p, const double *rest, int springs,
                             msim_error *err) {
  const msim_scene_view *view = &p->view;
  msim_status status =
      msim_scene_add_particles(scene, view->nparticles, view->x, p->v, p->mass, err);
  if (status || !springs) return status;
  return msim_scene_add_springs(scene, view->nsprings, view->ij, view->k, rest, NULL, err);
}

static msim_status pin_corners(msim_scene *scene, msim_error *err) {
  const int32_t corners[2] = {0, SIDE - 1};
  return msim_scene_pin(scene, 2, corners, err);
}

/* A cloth that sways: along z, or within its plane. */
static void sway(parts *p, int axis) {
  for (int32_t i = 0; i < p->view.nparticles; i++)
    p->v[3 * i + axis] = 0.1 * sin(3 * p->view.x[3 * i]) * p->view.x[3 * i + 1];
}

static msim_status swaying(int axis, const double *gravity, int springs, int no_rest,
                           msim_scene *scene, msim_error *err) {
  parts p;
  msim_status status = make_cloth(&p, err);
  if (!status) sway(&p, axis);
  if (!status) status = add_parts(scene, &p, no_rest ? p.zeros : NULL, springs, err);
  if (!status && springs) status = pin_corners(scene, err);
  if (!status && gravity) status = msim_scene_set_gravity(scene, gravity, err);
  free_parts(&p);
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

static msim_status flat(int without, msim_scene *scene, msim_error *err) {
  (void)without;
  return swaying(1, along, 1, 0, scene, err);
}

static msim_status unmoved(int without, msim_scene *scene, msim_error *err) {
  (void)without;
  return swaying(2, NULL, 1, 0, scene, err);
}

/* At its rest lengths, without weight, and nobody pushes it. */
static msim_status resting(int without, msim_scene *scene, msim_error *err) {
  parts p;
  (void)without;
  msim_status status = make_cloth(&p, err);
  if (!status) status = add_parts(scene, &p, NULL, 1, err);
  free_parts(&p);
  return status;
}

/* One sways, four lie beside it at their rest lengths. */
static msim_status among_resting(int without, msim_scene *scene, msim_error *err) {
  msim_status status = unmoved(without, scene, err);
  for (int i = 1; i <= 4 && !status; i++) status = add_cloth(scene, 2 * i, err);
  return status;
}

/* Half of the rows held: pinned, or by a mass that nothing moves. */
static msim_status half_held(int without, msim_scene *scene, msim_error *err) {
  static int32_t held[N / 2];
  parts p;
  msim_status status = make_cloth(&p, err);
  if (!status) sway(&p, 2);
  for (int32_t i = 0; i < N / 2 && !status; i++) {
    held[i] = i;
    p.v[3 * i + 2] = 0;
    if (without) p.mass[i] = 1e12;
  }
  if (!status) status = add_parts(scene, &p, NULL, 1, err);
  if (!status && !without) status = msim_scene_pin(scene, N / 2, held, err);
  free_parts(&p);
  return status;
}

/* A jelly held at a face and struck, so that it trembles. */
static msim_status trembling(int without, msim_scene *scene, msim_error *err) {
  static int32_t face[JELLY * JELLY];
  const msim_lattice jelly = {.size = sizeof jelly,
                              .n = {JELLY, JELLY, JELLY},
                              .extent = {1, 1, 1},
                              .mass = 1,
                              .k = STIFFNESS};
  msim_scene *recipe = NULL;
  parts p = {.recipe = NULL};
  (void)without;
  for (int32_t i = 0; i < JELLY * JELLY; i++) face[i] = i;
  msim_status status = msim_scene_create(NULL, &recipe, err);
  if (!status) status = msim_scene_add_lattice(recipe, &jelly, err);
  if (!status) status = take_parts(recipe, &p);
  else msim_scene_destroy(recipe);
  for (int32_t i = 0; i < p.view.nparticles && !status; i++)
    p.v[3 * i + 2] = p.view.x[3 * i] * p.view.x[3 * i];
  if (!status) status = add_parts(scene, &p, NULL, 1, err);
  if (!status) status = msim_scene_pin(scene, JELLY * JELLY, face, err);
  if (!status) status = msim_scene_set_gravity(scene, down, err);
  free_parts(&p);
  return status;
}

/*------------------------------------- the table ------------------------------------------------*/

#define IMPLICIT "linearly-implicit-euler", 1.0 / 60
#define EXPLICIT "symplectic-euler", 1e-5
#define PASS(name) \
  { name, NULL, "cloth100, no gravity", EXPLICIT, {"skip." name}, unmoved, 0.02 }

const skip_case *skip_case_info(int i) {
  static const skip_case cases[] = {
      {"no_springs",
       "no_springs",
       "10000 particles, no springs",
       IMPLICIT,
       {"skip.springs", "skip.zero_rest_length"},
       loose,
       0.02},
      {"zero_rest_length",
       "zero_rest_length",
       "cloth100, rest lengths 0",
       IMPLICIT,
       {"skip.zero_rest_length"},
       collapsing,
       0.1},
      {"kept_factor",
       "kept_factor_jelly16",
       "jelly16, struck",
       IMPLICIT,
       {"skip.kept_factor"},
       trembling,
       0.4},
      {"two_d", "two_d", "cloth100 in its own plane", IMPLICIT, {"skip.two_d"}, flat, 0.1},
      {"pinned", "half_pinned", "cloth100, half of it held", IMPLICIT, {NULL}, half_held, 0.1},
      {"zero_rest_length, explicit",
       NULL,
       "cloth100, rest lengths 0",
       EXPLICIT,
       {"skip.zero_rest_length"},
       collapsing,
       0.02},
      {"two_d, explicit", NULL, "cloth100 in its own plane", EXPLICIT, {"skip.two_d"}, flat, 0.02},
      {"islands",
       NULL,
       "cloth100 beside four at rest",
       IMPLICIT,
       {"skip.islands"},
       among_resting,
       0.1},
      {"islands, explicit",
       NULL,
       "cloth100 beside four at rest",
       EXPLICIT,
       {"skip.islands"},
       among_resting,
       0.02},
      {"at_rest", NULL, "cloth100 at rest", IMPLICIT, {"skip.at_rest"}, resting, 0.05},
      {"at_rest, explicit", NULL, "cloth100 at rest", EXPLICIT, {"skip.at_rest"}, resting, 0.02},
      PASS("planes"),
      PASS("damping"),
      PASS("drag"),
      PASS("gravity"),
  };
  return i >= 0 && i < (int)(sizeof cases / sizeof *cases) ? &cases[i] : NULL;
}
