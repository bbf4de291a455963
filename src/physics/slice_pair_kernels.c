/* Steps of two slices at once (slice_pair.h), with AVX-512 */
#define MS_SINGLE
#ifdef __AVX512F__
#  define MS_LANES 16
#endif
#include "physics/slice_pair.h"

#ifdef MS_HAS_SLICE_PAIRS
#  include "physics/row_step.h"

/*------------------------------------- registers of two slices ----------------------------------*/

/* The slices that have an entry left; a constant of the callers of functions with this argument */
typedef enum which { LOW, HIGH, BOTH } which;

typedef struct half_vectors {
  __m256 c[3];
} half_vectors;

MS_INLINE ms_lanes join(__m256 low, __m256 high) {
  const __m512d wide = _mm512_castpd256_pd512(_mm256_castps_pd(low));
  return (ms_lanes)_mm512_insertf64x4(wide, _mm256_castps_pd(high), 1);
}

/* x of the neighbours in an entry of one slice */
MS_INLINE half_vectors load_half(int dims, const ms_half_edges *half_edges, int32_t entry,
                                 const float *x, size_t stride) {
  const int32_t start = half_edges->entry[entry].start;
  const int32_t *j = start < 0 ? ms_half_edges_scattered(half_edges, start) : NULL;
  half_vectors v = {{{0}}};
  for (int c = 0; c < dims; c++, x += stride)
    if (!j) v.c[c] = _mm256_loadu_ps(x + start);
    else v.c[c] = (__m256){x[j[0]], x[j[1]], x[j[2]], x[j[3]], x[j[4]], x[j[5]], x[j[6]], x[j[7]]};
  return v;
}

/*------------------------------------- springs --------------------------------------------------*/

/* own - x of the neighbours in two entries, which most often are consecutive rows */
MS_INLINE ms_lane_vectors subtract_neighbours(int dims, const ms_half_edges *half_edges,
                                              int32_t low, int32_t high, const float *x,
                                              size_t stride, ms_lane_vectors own) {
  const int32_t start = half_edges->entry[low].start;
  if (start >= 0 && half_edges->entry[high].start == start + MS_SLICE)
    return ms_subtract_vec(dims, own, ms_load_vec(dims, x + start, stride));
  const half_vectors i = load_half(dims, half_edges, low, x, stride);
  const half_vectors j = load_half(dims, half_edges, high, x, stride);
  for (int c = 0; c < dims; c++) own.c[c] -= join(i.c[c], j.c[c]);
  return own;
}

MS_INLINE ms_lanes load_values(const float *of, which has, size_t low, size_t high) {
  const __m256 none = {0};
  return join(has == HIGH ? none : _mm256_loadu_ps(of + low),
              has == LOW ? none : _mm256_loadu_ps(of + high));
}

/* k = 0 without a spring */
MS_INLINE spring_lanes load_springs(int damped, const ms_single *of, which has, size_t low,
                                    size_t high) {
  const ms_lanes zero = {0};
  return (spring_lanes){
      .k = load_values(of->k, has, low, high),
      .rest = load_values(of->half_k_rest, has, low, high),
      .damping = damped ? load_values(of->quarter_damping, has, low, high) : zero};
}

typedef struct pair_step {
  const ms_model *model;
  const ms_fused_step *sweep;
} pair_step;

/* sum + the forces of the springs in an entry of each slice, or of one, which is then both `low`
 * and `high`: the other slice adds springs of k = 0 */
MS_INLINE ms_lane_vectors add_entries(int dims, int damped, const pair_step *s, which has,
                                      int32_t low, int32_t high, ms_lane_vectors xi,
                                      ms_lane_vectors vi, ms_lane_vectors sum) {
  const ms_half_edges *half_edges = &s->model->half_edges;
  const size_t stride = (size_t)s->model->unknowns.stride;
  const size_t at = (size_t)half_edges->entry[low].value;
  const size_t other = (size_t)half_edges->entry[high].value;
  const ms_lane_vectors d =
      subtract_neighbours(dims, half_edges, low, high, s->sweep->x, stride, xi);
  const ms_lane_vectors dv =
      damped ? subtract_neighbours(dims, half_edges, low, high, s->sweep->v, stride, vi) : vi;
  /* most often they are alike (spring_values.h) */
  const spring_lanes of = at == other ? load_springs(damped, s->model->single, has, at, at)
                                      : load_springs(damped, s->model->single, has, at, other);
  return ms_fnma_vec(dims, spring_force_factor(dims, damped, d, dv, of), d, sum);
}

MS_INLINE ms_lane_vectors add_spring_forces(int dims, int damped, const pair_step *s, int32_t slice,
                                            ms_lane_vectors sum) {
  const int32_t *first = s->model->half_edges.first + slice;
  const int32_t of_low = first[1] - first[0], of_high = first[2] - first[1];
  const int32_t shared = of_low < of_high ? of_low : of_high;
  const size_t stride = (size_t)s->model->unknowns.stride, row = MS_SLICE * (size_t)slice;
  const ms_lane_vectors xi = ms_load_vec(dims, (const float *)s->sweep->x + row, stride);
  const ms_lane_vectors vi =
      damped ? ms_load_vec(dims, (const float *)s->sweep->v + row, stride) : xi;
  for (int32_t i = first[0]; i < first[0] + shared; i++)
    sum = add_entries(dims, damped, s, BOTH, i, i + of_low, xi, vi, sum);
  for (int32_t i = first[0] + shared; i < first[1]; i++)
    sum = add_entries(dims, damped, s, LOW, i, i, xi, vi, sum);
  for (int32_t i = first[1] + shared; i < first[2]; i++)
    sum = add_entries(dims, damped, s, HIGH, i, i, xi, vi, sum);
  return sum;
}

/*------------------------------------- steps ----------------------------------------------------*/

MS_INLINE int step_pairs(int dims, int damped, prefetch ahead, const pair_step *s, int32_t begin,
                         int32_t end) {
  const ms_model *m = s->model;
  const ms_fused_step *p = s->sweep;
  const size_t stride = (size_t)m->unknowns.stride;
  const sweep_lanes by = spread_sweep(dims, m, p);
  ms_mask bad = {0};
  for (int32_t slice = begin; slice < end; slice += 2) {
    const size_t row = MS_SLICE * (size_t)slice;
    if (ahead == ROWS) prefetch_rows(dims, damped, m, p, row);
    ms_lane_vectors f = external_force(dims, m, &by.external, row, p);
    if (m->added_force)
      f = ms_add_vec(dims, f, load_added_force(dims, m->added_force, row, stride));
    f = add_spring_forces(dims, damped, s, slice, f);
    bad |= check(update(dims, m, row, f, p, &by));
  }
  return is_nowhere(bad);
}

MS_INLINE int step_pairs_in(int dims, int damped, const pair_step *s, int32_t begin, int32_t end) {
  return choose_prefetch(s->model) == NOTHING ? step_pairs(dims, damped, NOTHING, s, begin, end)
                                              : step_pairs(dims, damped, ROWS, s, begin, end);
}

int ms_slice_pairs_step(const ms_model *model, const ms_fused_step *sweep, int damped,
                        int32_t begin, int32_t end) {
  const pair_step s = {model, sweep};
  if (model->unknowns.dims == 2)
    return damped ? step_pairs_in(2, 1, &s, begin, end) : step_pairs_in(2, 0, &s, begin, end);
  return damped ? step_pairs_in(3, 1, &s, begin, end) : step_pairs_in(3, 0, &s, begin, end);
}
#endif
