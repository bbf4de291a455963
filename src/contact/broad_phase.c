#include "contact/broad_phase.h"

#include "base/vec3.h"
#include "contact/bounds_kernels.h"
#include "contact/moving_obstacles.h"
#include "physics/signed_distance.h"

MS_TABLES(ms_bounds_kernels);

/* Some particles lie in the box |x_c - middle_c| <= half_c, and move by `displacement` at most. */
typedef struct region {
  double middle[3], half[3]; /* m */
  double displacement;       /* m */
} region;

/* The box of a vector in some rows, in space */
static void bound_vector(const ms_broad_phase *b, const double *vec, int32_t begin, int32_t end,
                         double low[3], double high[3]) {
  const ms_unknowns *rows = &b->model->unknowns;
  double least[3], most[3];
  ms_bounds_kernels_of[b->model->isa]->bound(b->model->shape, vec, begin, end, least, most);
  for (int c = 0; c < 3; c++) low[c] = high[c] = 0;
  for (int32_t c = 0; c < rows->dims; c++)
    low[rows->axis[c]] = least[c], high[rows->axis[c]] = most[c];
}

/* A bound on the lengths of the vectors of some rows */
static double bound_length(const ms_broad_phase *b, const double *vec, int32_t begin, int32_t end) {
  double low[3], high[3];
  bound_vector(b, vec, begin, end, low, high);
  for (int c = 0; c < 3; c++) high[c] = fmax(high[c], -low[c]);
  return ms_vec3_norm(high);
}

static region bound_rows(const ms_broad_phase *b, int32_t begin, int32_t end) {
  region of = {.displacement = 0};
  double low[3], high[3], least[3], most[3];
  bound_vector(b, b->x, begin, end, low, high);
  if (b->x_end) bound_vector(b, b->x_end, begin, end, least, most);
  for (int c = 0; c < 3 && b->x_end; c++)
    low[c] = fmin(low[c], least[c]), high[c] = fmax(high[c], most[c]);
  for (int c = 0; c < 3; c++)
    of.middle[c] = 0.5 * (low[c] + high[c]), of.half[c] = 0.5 * (high[c] - low[c]);
  if (b->v)
    of.displacement =
        b->h * (bound_length(b, b->v, begin, end) + 0.5 * b->h * bound_length(b, b->a, begin, end));
  return of;
}

/* 1: a particle in the region may touch an obstacle. */
static int may_touch(const ms_broad_phase *b, const region *of) {
  const double ROUNDING = MS_BROAD_PHASE_ROUNDING;
  const ms_collision_planes *planes = b->planes;
  const double across = ms_vec3_norm(of->half), size = ms_vec3_norm(of->middle) + across;
  const double farthest[3] = {size, 0, 0};
  const double reach = of->displacement + ms_impacts_distance_tolerance(planes, farthest);
  for (const msim_plane *p = planes->plane; p < planes->plane + planes->n - planes->nsolids; p++) {
    const double *n = p->normal;
    const double depth =
        fabs(n[0]) * of->half[0] + fabs(n[1]) * of->half[1] + fabs(n[2]) * of->half[2];
    const double s = ms_impacts_distance(p, of->middle) - depth;
    if (!(s > reach + ROUNDING * (size + fabs(p->offset)))) return 1;
  }
  for (int32_t i = 0; i < planes->nsolids; i++) {
    const ms_solid *solid = &planes->solid[i];
    const double s = ms_signed_distance_bound(solid, of->middle, of->half);
    const double moved = ms_moving_obstacles_bound_displacement(planes, i, of->middle,
                                                                across + of->displacement, b->h);
    if (!(ms_obstacles_bound_distance(solid, s) > reach + moved + ROUNDING * (size + solid->reach)))
      return 1;
  }
  return 0;
}

/* The first row from `row` on of a chunk that may touch planes alone */
static int32_t next_near_plane(ms_broad_phase *b, int32_t row) {
  row = ms_bounds_kernels_of[b->model->isa]->find_near_plane(b, row, b->chunk_end);
  if (row < b->chunk_end) b->slice_end = row + 1;
  return row;
}

int32_t ms_broad_phase_next(ms_broad_phase *b, int32_t row) {
  enum { CHUNK = 256 };
  const int32_t n = b->model->unknowns.nfree;
  while (row < n && row >= b->slice_end) {
    const int is_new = row >= b->chunk_end; /* chunk */
    if (!is_new && b->planes->nsolids == 0) {
      row = next_near_plane(b, row);
      continue;
    }
    const int32_t left = (is_new ? n : b->chunk_end) - row, size = is_new ? CHUNK : MS_SLICE,
                  end = row + (left < size ? left : size);
    const region of = bound_rows(b, row, end);
    if (!may_touch(b, &of)) row = end;
    else if (is_new) b->chunk_end = end;
    else b->slice_end = end;
  }
  return row;
}
