/* Kernels for energy, mass moment and bounding box, compiled once for each instruction set MS_ISA.
 */
#include "physics/lanes.h"
#include "physics/spring_law.h"
#include "physics/totals.h"

typedef struct tally {
  ms_lanes kinetic; /* twice the energy */
  ms_lanes elastic;
  ms_lane_vectors moment, low, high;
} tally;

/* Add the rows of one register; padding has inverse mass 0. */
MS_INLINE void add_rows(int dims, const ms_totals_job *j, size_t row, tally *t) {
  const ms_model *m = j->model;
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_lanes mass = ms_simd_load(m->mass + row);
  const ms_mask there = ms_simd_load(m->inv_mass + row) > 0;
  const ms_lane_vectors xi = ms_load_vec(dims, j->x + row, stride),
                        vi = ms_load_vec(dims, j->v + row, stride);
  t->kinetic = ms_simd_fma(mass, ms_dot_vec(dims, vi, vi), t->kinetic);
  t->moment = ms_fma_vec(dims, mass, xi, t->moment);
  for (int c = 0; c < dims; c++) {
    t->low.c[c] = ms_simd_select(there & (xi.c[c] < t->low.c[c]), xi.c[c], t->low.c[c]);
    t->high.c[c] = ms_simd_select(there & (xi.c[c] > t->high.c[c]), xi.c[c], t->high.c[c]);
  }
}

/* The side of an entry's neighbours in the order of the rows: consecutive ones of a slice are all
 * earlier than its rows or all later */
typedef enum neighbour_side { EARLIER, LATER, MIXED } neighbour_side;

MS_INLINE neighbour_side find_side(const ms_half_edges *half_edges, int32_t entry,
                                   ms_slice_range p) {
  const int32_t start = half_edges->entry[entry].start;
  if (start < 0 || p.is_split) return MIXED;
  return (size_t)start < p.row ? EARLIER : LATER;
}

/* k of a register's springs whose neighbour is a later row, as all pinned ones are, so that each
 * spring counts once; 0 of the others */
MS_INLINE ms_lanes load_counted_stiffness(const ms_half_edges *half_edges, int32_t entry,
                                          neighbour_side side, ms_slice_range p, size_t lane) {
  const ms_lanes k = ms_simd_load(half_edges->k + half_edges->entry[entry].value + lane);
  const int32_t at = MS_SLICE * entry + (int32_t)lane;
  ms_mask other, own;
  if (side == LATER) return k;
  for (int l = 0; l < MS_LANES; l++) {
    other[l] = ms_half_edges_neighbour(half_edges, at + l);
    own[l] = (int64_t)p.row + (p.is_split ? 0 : (int64_t)lane + l);
  }
  return ms_simd_select(other > own, k, (ms_lanes){0});
}

/* Sums of the elastic energy of the springs of one register of rows */
MS_INLINE ms_lanes sum_elastic(int dims, const ms_model *m, int32_t range, ms_slice_range p,
                               size_t lane, const double *x) {
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_half_edges *half_edges = &m->half_edges;
  const ms_lane_vectors xi = ms_load_own(dims, p, lane, x, stride);
  ms_lanes sum = {0};
  for (int32_t entry = half_edges->first[range]; entry < half_edges->first[range + 1]; entry++) {
    const neighbour_side side = find_side(half_edges, entry, p);
    if (side == EARLIER) continue;
    const ms_lane_vectors d =
        ms_subtract_vec(dims, ms_load_neighbours(dims, half_edges, entry, lane, x, stride), xi);
    const ms_lanes l = ms_simd_sqrt(ms_dot_vec(dims, d, d));
    const ms_lanes k = load_counted_stiffness(half_edges, entry, side, p, lane);
    const ms_lanes rest = ms_simd_load(half_edges->rest + half_edges->entry[entry].value + lane);
    sum += MS_SPRING_ENERGY(k, rest, l);
  }
  return sum;
}

static double sum_over_lanes(ms_lanes v) {
  double sum = 0;
  for (int l = 0; l < MS_LANES; l++) sum += v[l];
  return sum;
}

static ms_totals sum_tally(int dims, const ms_model *m, const tally *t) {
  ms_totals totals = {.kinetic = sum_over_lanes(t->kinetic) / 2,
                      .elastic = sum_over_lanes(t->elastic)};
  for (int c = 0; c < dims; c++) {
    const int32_t axis = m->unknowns.axis[c];
    totals.moment[axis] = sum_over_lanes(t->moment.c[c]);
    totals.low[axis] = t->low.c[c][0], totals.high[axis] = t->high.c[c][0];
    for (int l = 1; l < MS_LANES; l++) {
      totals.low[axis] = fmin(totals.low[axis], t->low.c[c][l]);
      totals.high[axis] = fmax(totals.high[axis], t->high.c[c][l]);
    }
  }
  return totals;
}

MS_INLINE ms_totals compute_totals_of(int dims, const ms_totals_job *j, int32_t begin,
                                      int32_t end) {
  const ms_model *m = j->model;
  tally t = {0};
  for (int c = 0; c < dims; c++) t.low.c[c] += INFINITY, t.high.c[c] -= INFINITY;
  for (int32_t range = begin; range < end; range++) {
    const int is_slice = range < m->half_edges.nslices;
    const ms_slice_range p = is_slice ? (ms_slice_range){.row = MS_SLICE * (size_t)range}
                                      : ms_slice_range_at(&m->half_edges, range, NULL, 0);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      if (is_slice) add_rows(dims, j, p.row + lane, &t);
      t.elastic += sum_elastic(dims, m, range, p, lane, j->x);
    }
  }
  return sum_tally(dims, m, &t);
}

static ms_totals compute_totals(const ms_totals_job *j, int32_t begin, int32_t end) {
  return j->model->unknowns.dims == 3 ? compute_totals_of(3, j, begin, end)
                                      : compute_totals_of(2, j, begin, end);
}

const ms_totals_kernels MS_TABLE(ms_totals_kernels) = {compute_totals};
