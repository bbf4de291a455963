/* Compiled once for each instruction set, with MS_ISA defined as its name. */
#include "contact/bounds_kernels.h"

#include <math.h>

#include "base/simd.h"

/* Whole blocks of `registers` registers; returns the first row that is left. */
MS_INLINE int32_t bound_blocks(int registers, const double *x, int32_t r, int32_t end,
                               ms_lanes *least, ms_lanes *most) {
  for (; r + registers * MS_LANES <= end; r += registers * MS_LANES)
    for (int i = 0; i < registers; i++) {
      const ms_lanes at = ms_simd_load(x + r + i * MS_LANES);
      *least = ms_simd_lower(at, *least), *most = ms_simd_upper(at, *most);
    }
  return r;
}

static double lower(double a, double b) { return a < b ? a : b; }
static double upper(double a, double b) { return a > b ? a : b; }

static void bound(ms_shape s, const double *x, int32_t begin, int32_t end, double *low,
                  double *high) {
  for (int32_t c = 0; c < s.dims; c++, x += s.stride) {
    ms_lanes least = (ms_lanes){0} + INFINITY, most = (ms_lanes){0} - INFINITY;
    int32_t r = bound_blocks(8, x, begin, end, &least, &most);
    r = bound_blocks(1, x, r, end, &least, &most);
    low[c] = INFINITY, high[c] = -INFINITY;
    for (int l = 0; l < MS_LANES; l++)
      low[c] = lower(least[l], low[c]), high[c] = upper(most[l], high[c]);
    for (; r < end; r++) low[c] = lower(x[r], low[c]), high[c] = upper(x[r], high[c]);
  }
}

/*------------------------------------- planes ---------------------------------------------------*/

/* n.x of a register of rows, and size += weight |x|_1 */
MS_INLINE ms_lanes project(const ms_broad_phase *b, const double n[3], const double *x, size_t row,
                           double weight, ms_lanes *size) {
  const ms_unknowns *rows = &b->model->unknowns;
  ms_lanes sum = {0};
  for (int32_t c = 0; c < rows->dims; c++) {
    const ms_lanes at = ms_simd_load(x + (size_t)c * (size_t)rows->stride + row);
    sum += n[rows->axis[c]] * at;
    *size += weight * ms_simd_upper(at, -at);
  }
  return sum;
}

/* A parabola lies within the convex hull of its control points, x, x + h v/2 and its end, a line
 * within that of its ends (as in impact_time.c). */
MS_INLINE ms_mask may_meet(const ms_broad_phase *b, const msim_plane *p, size_t row) {
  const double h = b->h, half_h2 = 0.5 * h * h;
  ms_lanes size = (ms_lanes){0} + (b->planes->scene_size + fabs(p->offset));
  const ms_lanes start = project(b, p->normal, b->x, row, 1, &size);
  ms_lanes least = start;
  if (b->x_end) least = ms_simd_lower(least, project(b, p->normal, b->x_end, row, 1, &size));
  if (b->v) {
    const ms_lanes v = project(b, p->normal, b->v, row, h, &size),
                   a = project(b, p->normal, b->a, row, half_h2, &size);
    least = ms_simd_lower(least, start + 0.5 * h * v);
    least = ms_simd_lower(least, start + h * v + half_h2 * a);
  }
  return ~(least - p->offset > b->planes->contact_distance + MS_BROAD_PHASE_ROUNDING * size);
}

static int32_t find_near_plane(const ms_broad_phase *b, int32_t row, int32_t end) {
  const ms_collision_planes *planes = b->planes;
  for (int32_t at = row / MS_LANES * MS_LANES; at < end; at += MS_LANES) {
    ms_mask near = {0};
    int any = 0;
    for (const msim_plane *p = planes->plane; p < planes->plane + planes->n - planes->nsolids; p++)
      near |= may_meet(b, p, (size_t)at);
    for (int l = 0; l < MS_LANES; l++) any |= near[l] != 0;
    for (int l = 0; l < MS_LANES && any; l++)
      if (near[l] && at + l >= row && at + l < end) return at + l;
  }
  return end;
}

const ms_bounds_kernels MS_TABLE(ms_bounds_kernels) = {find_near_plane, bound};
