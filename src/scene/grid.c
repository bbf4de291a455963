#include "scene/grid.h"

#include <math.h>
#include <string.h>

#include "scene/shape.h"

/*------------------------------------- particles ------------------------------------------------*/

/* a/(n-1); 0 if n = 1. */
static double grid_fraction(int32_t a, int32_t n) { return n > 1 ? (double)a / (n - 1) : 0.0; }

static void place_particles(const ms_shape *shape, double *x) {
  const ms_grid *grid = &shape->grid;
  double *last = x + 3 * (size_t)(shape->nparticles - 1);
  for (int32_t a = 0; a < grid->n[0]; a++)
    for (int32_t b = 0; b < grid->n[1]; b++)
      for (int32_t c = 0; c < grid->n[2]; c++, x += 3)
        for (int i = 0; i < 3; i++)
          x[i] = grid->origin[i] + grid_fraction(a, grid->n[0]) * grid->edge[0][i] +
                 grid_fraction(b, grid->n[1]) * grid->edge[1][i] +
                 grid_fraction(c, grid->n[2]) * grid->edge[2][i];
  if (grid->has_last) memcpy(last, grid->last, sizeof grid->last);
}

/*------------------------------------- faces ----------------------------------------------------*/

/* A layer of cells, which the axes u and v span, at one index of the third axis, w. */
typedef struct grid_side {
  int u, v, w;
  int32_t at;
  int is_flipped; /* 1: its normal is against u x v */
} grid_side;

/* The sides of the grid whose faces are its surface: at both ends of each axis, or one if the grid
 * has one layer. Returns their number. */
static int list_sides(const ms_grid *grid, grid_side sides[6]) {
  int count = 0;
  for (int w = 0; w < 3; w++) {
    const int u = (w + 1) % 3, v = (w + 2) % 3;
    if (grid->n[u] < 2 || grid->n[v] < 2) continue;
    if (grid->n[w] > 1) sides[count++] = (grid_side){u, v, w, 0, 1};
    sides[count++] = (grid_side){u, v, w, grid->n[w] - 1, 0};
  }
  return count;
}

static int64_t count_faces(const ms_grid *grid) {
  grid_side sides[6];
  int64_t count = 0;
  for (int i = list_sides(grid, sides) - 1; i >= 0; i--)
    count += 2 * ((int64_t)grid->n[sides[i].u] - 1) * (grid->n[sides[i].v] - 1);
  return count;
}

/* Two triangles for each cell. Returns the end of their corners. */
static int32_t *list_side_faces(const ms_grid *grid, const grid_side *s, int32_t *corner) {
  const int32_t stride[3] = {grid->n[1] * grid->n[2], grid->n[2], 1};
  const int32_t along = stride[s->is_flipped ? s->v : s->u],
                across = stride[s->is_flipped ? s->u : s->v];
  for (int32_t i = 0; i < grid->n[s->u] - 1; i++)
    for (int32_t j = 0; j < grid->n[s->v] - 1; j++) {
      const int32_t p = s->at * stride[s->w] + i * stride[s->u] + j * stride[s->v];
      const int32_t cell[] = {p, p + along, p + along + across, p, p + along + across, p + across};
      memcpy(corner, cell, sizeof cell);
      corner += 6;
    }
  return corner;
}

static void list_faces(const ms_shape *shape, int32_t *corners) {
  grid_side sides[6];
  const int nsides = list_sides(&shape->grid, sides);
  for (int i = 0; i < nsides; i++) corners = list_side_faces(&shape->grid, &sides[i], corners);
}

/*------------------------------------- springs --------------------------------------------------*/

static int64_t count_springs(const ms_grid *grid) {
  int64_t count = 0;
  for (int32_t t = 0; t < grid->nsprings; t++) {
    const ms_grid_spring *tie = &grid->springs[t];
    int64_t cells = grid->k[tie->stiffness] > 0;
    for (int d = 0; d < 3; d++) {
      int32_t room = grid->n[d] - (tie->offset[d] < 0 ? -tie->offset[d] : tie->offset[d]);
      cells *= room > 0 ? room : 0;
    }
    count += cells;
  }
  return count;
}

/* The particle at the other end of a spring from particle (a, b, c) = at; -1: outside the grid. */
static int32_t find_neighbour(const ms_grid *grid, const ms_grid_spring *tie, const int32_t at[3]) {
  int32_t p = 0;
  for (int d = 0; d < 3; d++) {
    int32_t i = at[d] + tie->offset[d];
    if (i < 0 || i >= grid->n[d]) return -1;
    p = p * grid->n[d] + i;
  }
  return p;
}

static void list_springs(const ms_shape *shape, int32_t *ij, double *k) {
  const ms_grid *grid = &shape->grid;
  int32_t p = 0, at[3];
  for (at[0] = 0; at[0] < grid->n[0]; at[0]++)
    for (at[1] = 0; at[1] < grid->n[1]; at[1]++)
      for (at[2] = 0; at[2] < grid->n[2]; at[2]++, p++)
        for (int32_t t = 0; t < grid->nsprings; t++) {
          int32_t q = find_neighbour(grid, &grid->springs[t], at);
          if (q < 0 || grid->k[grid->springs[t].stiffness] == 0) continue;
          *ij++ = p;
          *ij++ = q;
          *k++ = grid->k[grid->springs[t].stiffness];
        }
}

/*------------------------------------- angular springs ------------------------------------------*/

/* At the inner particles of the first two axes */
static int64_t count_angles(const ms_grid *grid, int64_t nparticles) {
  int64_t count = 0;
  for (int d = 0; d < 2; d++)
    if (grid->n[d] > 2) count += nparticles / grid->n[d] * (grid->n[d] - 2);
  return count;
}

/* Particle by particle, those of its rows first */
static void list_angles(const ms_shape *shape, int32_t *ijk) {
  const ms_grid *grid = &shape->grid;
  const int32_t step[2] = {grid->n[1] * grid->n[2], grid->n[2]};
  for (int32_t p = 0; p < shape->nparticles; p++)
    for (int d = 0; d < 2; d++) {
      const int32_t at = p / step[d] % grid->n[d];
      if (at == 0 || at == grid->n[d] - 1 || grid->n[d] == 1) continue;
      for (int32_t corner = -1; corner <= 1; corner++) *ijk++ = p + corner * step[d];
    }
}

/*------------------------------------- the whole ------------------------------------------------*/

msim_status ms_grid_count(ms_shape *shape, const char *subject, msim_error *err) {
  static const ms_shape_lists lists = {place_particles, list_faces, list_springs, list_angles};
  const ms_grid *grid = &shape->grid;
  const double size = (double)grid->n[0] * grid->n[1] * grid->n[2];
  if (size > INT32_MAX / 3)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.n gives %.0f particles; the limit is %d", subject,
                        size, INT32_MAX / 3);
  for (int c = 0; c < 3; c++) {
    double reach = fabs(grid->origin[c]);
    for (int e = 0; e < 3; e++) reach += fabs(grid->edge[e][c]);
    if (!isfinite(reach))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s extends beyond the range of double; use smaller coordinates",
                          subject);
  }
  shape->nsprings = count_springs(grid);
  if (shape->nsprings > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.n gives %lld springs; the limit is %d", subject,
                        (long long)shape->nsprings, INT32_MAX);
  shape->lists = &lists;
  shape->nparticles = (int32_t)size;
  shape->nfaces = count_faces(grid);
  shape->nangles = shape->bending > 0 ? count_angles(grid, shape->nparticles) : 0;
  return MSIM_OK;
}
