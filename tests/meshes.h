/* meshes - closed surfaces that several tests share */
#ifndef TEST_MESHES_H
#define TEST_MESHES_H

#include <math.h>
#include <string.h>

#include "scenes.h"

/* A cube from `low` to `low + edge`; counterclockwise seen from outside */
static const int32_t cube_faces[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                       2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

static inline void place_cube(double low, double edge, double x[24]) {
  for (int i = 0; i < 8; i++)
    for (int c = 0; c < 3; c++) x[3 * i + c] = low + (i >> c & 1) * edge;
}

static inline msim_mesh make_mesh(int32_t nvertices, const double *x, int32_t nfaces,
                                  const int32_t *faces) {
  return (msim_mesh){.size = sizeof(msim_mesh),
                     .nvertices = nvertices,
                     .nfaces = nfaces,
                     .vertices = x,
                     .faces = faces,
                     .mass = 2,
                     .k = 100,
                     .damping = 0.5};
}

/* A unit sphere of 20 4^depth triangles with vertices of their own, as in an STL file; returns
 * their number. */
static inline int32_t split_triangle(const double corner[3][3], int depth, double *x) {
  if (depth == 0) {
    memcpy(x, corner, 9 * sizeof *x);
    return 1;
  }
  double middle[3][3], inner[4][3][3];
  for (int c = 0; c < 3; c++) {
    double length = 0;
    for (int d = 0; d < 3; d++) middle[c][d] = corner[c][d] + corner[(c + 1) % 3][d];
    for (int d = 0; d < 3; d++) length += middle[c][d] * middle[c][d];
    for (int d = 0; d < 3; d++) middle[c][d] /= sqrt(length);
  }
  memcpy(inner[3], middle, sizeof middle);
  int32_t n = 0;
  for (int t = 0; t < 4; t++) {
    if (t < 3) {
      memcpy(inner[t][0], corner[t], sizeof corner[t]);
      memcpy(inner[t][1], middle[t], sizeof middle[t]);
      memcpy(inner[t][2], middle[(t + 2) % 3], sizeof middle[t]);
    }
    n += split_triangle((const double(*)[3])inner[t], depth - 1, x + 9 * n);
  }
  return n;
}

static inline int32_t make_sphere(int depth, double *x /* 180 4^depth */) {
  static const int8_t faces[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                      {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                      {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                      {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  const double t = (1 + sqrt(5)) / 2, scale = 1 / sqrt(1 + t * t);
  const double v[12][3] = {{-1, t, 0}, {1, t, 0}, {-1, -t, 0}, {1, -t, 0},
                           {0, -1, t}, {0, 1, t}, {0, -1, -t}, {0, 1, -t},
                           {t, 0, -1}, {t, 0, 1}, {-t, 0, -1}, {-t, 0, 1}};
  int32_t n = 0;
  for (int f = 0; f < 20; f++) {
    double corner[3][3];
    for (int c = 0; c < 3; c++)
      for (int d = 0; d < 3; d++) corner[c][d] = v[faces[f][c]][d] * scale;
    n += split_triangle((const double(*)[3])corner, depth, x + 9 * n);
  }
  return n;
}

static inline msim_mesh_repairs repairs_of(const msim_scene *scene) {
  msim_mesh_repairs r = {.size = sizeof r};
  assert_int_equal(msim_scene_mesh_repairs(scene, &r), MSIM_OK);
  return r;
}

#endif
