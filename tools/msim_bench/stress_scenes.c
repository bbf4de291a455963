/* Stress scenes of 3 x 3 particles on 1 m x 1 m, and their initial states. */
#include <math.h>

#include "stress.h"

static void place_undeformed(double (*x)[3], double (*v)[3]) {
  for (int p = 0; p < STRESS_N; p++) {
    x[p][0] = 0.5 * (p % 3), x[p][1] = 0.5 * (p / 3), x[p][2] = 0;
    v[p][0] = v[p][1] = v[p][2] = 0;
  }
}

static void coincident(double (*x)[3], double (*v)[3]) {
  place_undeformed(x, v);
  for (int p = 3; p < 6; p++)
    for (int c = 0; c < 3; c++) x[p][c] = x[p - 3][c];
}

static void inverted(double (*x)[3], double (*v)[3]) {
  place_undeformed(x, v);
  for (int c = 0; c < 2; c++) x[4][c] = 1.5 + 0.1 * c;
}

static void crumpled(double (*x)[3], double (*v)[3]) {
  place_undeformed(x, v);
  for (int p = 0; p < STRESS_N; p++)
    for (int c = 0; c < 3; c++) x[p][c] = 0.3 * sin(37 * p + 11 * c + 1);
}

static void buckling(double (*x)[3], double (*v)[3]) {
  place_undeformed(x, v);
  for (int p = 0; p < STRESS_N; p++) x[p][0] *= 0.9, x[p][1] *= 0.9, x[p][2] = 1e-6 * (p % 2);
}

static void folded(double (*x)[3], double (*v)[3]) {
  place_undeformed(x, v);
  for (int p = 6; p < STRESS_N; p++) x[p][1] = 0;
}

static void turning(double (*x)[3], double (*v)[3]) {
  place_undeformed(x, v);
  for (int p = 0; p < STRESS_N; p++) v[p][0] = -5 * (x[p][1] - 0.5), v[p][1] = 5 * (x[p][0] - 0.5);
}

static void upright(double (*x)[3], double (*v)[3]) {
  place_undeformed(x, v);
  for (int p = 0; p < STRESS_N; p++) x[p][2] = x[p][1], x[p][1] = 0.01 * (p % 2);
}

static void raised(double (*x)[3], double (*v)[3]) {
  upright(x, v);
  for (int p = 0; p < STRESS_N; p++) x[p][2] += 1, x[p][0] += 0.3;
}

#define HANGING .g = 9.81, .place = place_undeformed, .pinned = 1

static const stress_scene scenes[] = {
    {.name = "soft", .k = 1e2, HANGING},
    {.name = "stiff", .k = 1e5, HANGING},
    {.name = "very stiff", .k = 1e9, HANGING},
    {.name = "masses 1:1e4", .k = 1e3, .ratio = 1e4, HANGING},
    {.name = "masses 1:1e9", .k = 1e3, .ratio = 1e9, HANGING},
    {.name = "rest length 0", .k = 1e3, .rest = -1, HANGING},
    {.name = "coincident", .k = 1e3, .place = coincident},
    {.name = "inverted", .k = 1e4, .place = inverted},
    {.name = "crumpled", .k = 1e4, .place = crumpled},
    {.name = "buckling", .k = 1e4, .place = buckling},
    {.name = "folded", .k = 1e3, .g = 9.81, .place = folded, .pinned = 3},
    {.name = "turning, stiff", .k = 1e4, .place = turning},
    {.name = "turning, very stiff", .k = 1e8, .place = turning},
    {.name = "stack", .k = 1e4, .ratio = 1e2, .g = 9.81, .planes = 1, .place = upright},
    {.name = "corner", .k = 1e3, .g = 9.81, .planes = 2, .restitution = 0.5, .place = raised},
    {.name = "bouncing", .k = 1e3, .g = 9.81, .planes = 1, .restitution = 1, .place = raised},
    {.name = "resting",
     .g = 9.81,
     .planes = 1,
     .restitution = 0.5,
     .place = place_undeformed,
     .steps = 1000000},
    {.name = "damped", .k = 1e3, .damping = 10, HANGING},
    {.name = "overdamped", .k = 1e3, .damping = 1e5, HANGING},
    {.name = "thick air", .k = 1e3, .drag = 1e4, .g = 9.81, .place = raised},
    {.name = "falling", .k = 1e3, .g = 9.81, .place = crumpled}};

const stress_scene *stress_info(int i) {
  return i >= 0 && i < (int)(sizeof scenes / sizeof *scenes) ? &scenes[i] : NULL;
}

/* Springs between neighbours along rows, columns and diagonals; lengths of the undeformed scene. */
static msim_status add_springs(const stress_scene *s, msim_scene *scene, msim_error *err) {
  double x[STRESS_N][3], v[STRESS_N][3];
  msim_status status = MSIM_OK;
  place_undeformed(x, v);
  for (int32_t i = 0; i < STRESS_N; i++)
    for (int32_t j = i + 1; j < STRESS_N && !status && s->k > 0; j++) {
      const double l = hypot(x[i][0] - x[j][0], x[i][1] - x[j][1]);
      const double rest = s->rest < 0 ? 0 : l;
      const int32_t ij[2] = {i, j};
      if (l < 0.8) status = msim_scene_add_springs(scene, 1, ij, &s->k, &rest, &s->damping, err);
    }
  return status;
}

static msim_status add_planes(const stress_scene *s, msim_scene *scene, msim_error *err) {
  const msim_plane floor = {.normal = {0, 0, 1}, .restitution = s->restitution, .friction = 0.3};
  const msim_plane wall = {.normal = {1, 0, 0.2}, .restitution = s->restitution};
  msim_status status = s->planes > 0 ? msim_scene_add_plane(scene, &floor, err) : MSIM_OK;
  return !status && s->planes > 1 ? msim_scene_add_plane(scene, &wall, err) : status;
}

msim_status stress_make(const stress_scene *s, msim_scene **scene, msim_error *err) {
  double x[STRESS_N][3], v[STRESS_N][3], mass[STRESS_N];
  const double gravity[3] = {0, 0, -s->g};
  const int32_t first[3] = {0, 1, 2};
  s->place(x, v);
  for (int p = 0; p < STRESS_N; p++) mass[p] = s->ratio > 0 && p % 2 ? 0.1 * s->ratio : 0.1;
  msim_status status = msim_scene_create(NULL, scene, err);
  if (!status) status = msim_scene_add_particles(*scene, STRESS_N, x[0], v[0], mass, err);
  if (!status) status = add_springs(s, *scene, err);
  if (!status) status = add_planes(s, *scene, err);
  if (!status) status = msim_scene_set_gravity(*scene, gravity, err);
  if (!status) status = msim_scene_set_drag(*scene, s->drag, err);
  if (!status && s->pinned) status = msim_scene_pin(*scene, s->pinned, first, err);
  return status;
}
