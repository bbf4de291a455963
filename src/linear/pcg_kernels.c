/* Kernels of pcg.h: the sweeps of conjugate gradients. This file is compiled once per instruction
 * set, MS_ISA, and once more for single precision (single_pcg_kernels.c). Loops over components are
 * unrolled: `dims` is a constant where functions are inlined. */
#include "linear/pcg.h"
#include "physics/lanes.h"

#ifdef MS_SINGLE
#  define PCG_KERNELS ms_single_pcg_kernels
#else
#  define PCG_KERNELS ms_pcg_kernels
#endif

/* 8 running sums, one per lane of a slice. total_lanes() adds them up as a tree, so that the order
 * of summation is the same on every instruction set. */
typedef struct lane_sums {
  double lane[MS_SLICE];
} lane_sums;

MS_INLINE void add_lanes(lane_sums *s, size_t lane, ms_lanes v) {
  ms_simd_add_to_doubles(s->lane + lane, 1, v);
}

static inline double total_lanes(const lane_sums *s) { return ms_vector_sum_lanes(s->lane); }

/*------------------------------------- apply ----------------------------------------------------*/

/* Bytes of the coefficients of an entry */
static const size_t ENTRY = 4 * MS_SLICE * sizeof(float);

/* q += sum of (t I + w w^T) (p_i - p_j) over the half-edges of a slice range, for one register of
 * lanes; p: of these unknowns. many: all coefficients have more than MS_CACHE bytes */
MS_INLINE void add_half_edges(size_t dims, int many, const ms_pcg *s, int32_t range, size_t lane,
                              const ms_lanes p[3], ms_lanes q[3]) {
  const ms_half_edges *half_edges = &s->base.system->model->half_edges;
  const size_t stride = (size_t)s->base.system->model->unknowns.stride;
  const ms_real *vec = s->p;
  for (int32_t entry = half_edges->first[range]; entry < half_edges->first[range + 1]; entry++) {
    const float *a = s->coefficients + 4 * MS_SLICE * (size_t)entry + lane;
    if (many && lane == 0) ms_simd_prefetch(a, ENTRY, MS_AHEAD * ENTRY);
    const ms_lanes t = ms_simd_load_floats(a);
    const ms_lane_vectors other =
        ms_load_neighbours((int)dims, half_edges, entry, lane, vec, stride);
    ms_lanes w[3], d[3], along = {0};
    for (size_t c = 0; c < dims; c++) {
      w[c] = ms_simd_load_floats(a + MS_SLICE * (c + 1));
      d[c] = p[c] - other.c[c];
      along = ms_simd_fma(w[c], d[c], along);
    }
    for (size_t c = 0; c < dims; c++) q[c] = ms_simd_fma(along, w[c], ms_simd_fma(t, d[c], q[c]));
  }
}

MS_INLINE void apply_slices_of(size_t dims, int many, const ms_pcg *s, int32_t begin, int32_t end,
                               double *sum) {
  const size_t stride = (size_t)s->base.system->model->unknowns.stride;
  const ms_real *from = s->p;
  ms_real *to = s->q;
  lane_sums pq = {{0}};
  for (int32_t g = begin; g < end; g++) {
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const size_t row = MS_SLICE * (size_t)g + lane;
      const ms_lanes inertia = ms_simd_load_doubles(s->inertia + row);
      ms_lanes p[3], q[3], dot = {0};
      for (size_t c = 0; c < dims; c++) {
        p[c] = ms_simd_load(from + c * stride + row);
        q[c] = inertia * p[c];
      }
      add_half_edges(dims, many, s, g, lane, p, q);
      for (size_t c = 0; c < dims; c++) {
        ms_simd_store(to + c * stride + row, q[c]);
        dot += p[c] * q[c];
      }
      add_lanes(&pq, lane, dot);
    }
  }
  *sum = total_lanes(&pq);
}

/* Add the sums of split rows to q, one part after the other. */
MS_INLINE void apply_split_rows_of(size_t dims, const ms_pcg *s, double *sum) {
  const ms_half_edges *half_edges = &s->base.system->model->half_edges;
  const size_t stride = (size_t)s->base.system->model->unknowns.stride;
  const ms_real *from = s->p;
  ms_real *to = s->q;
  *sum = 0;
  for (int32_t part = 0; part < half_edges->nparts; part++) {
    const size_t row = (size_t)half_edges->part_row[part];
    lane_sums sums[3];
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const ms_lanes zero = {0};
      ms_lanes p[3], q[3] = {zero, zero, zero};
      for (size_t c = 0; c < dims; c++) p[c] = zero + from[c * stride + row];
      add_half_edges(dims, 0, s, half_edges->nslices + part, lane, p, q);
      /* cppcheck-suppress legacyUninitvar; an address is no read */
      for (size_t c = 0; c < dims; c++) ms_simd_store_doubles(sums[c].lane + lane, q[c]);
    }
    for (size_t c = 0; c < dims; c++) {
      const double q = total_lanes(&sums[c]);
      to[c * stride + row] += (ms_real)q;
      *sum += (double)from[c * stride + row] * q;
    }
  }
}

static void apply_slices(const ms_pcg *s, int32_t begin, int32_t end, double *sum) {
  const ms_model *m = s->base.system->model;
  const int many = ENTRY * (size_t)m->half_edges.nentries > MS_CACHE;
  if (m->unknowns.dims == 3 && many) apply_slices_of(3, 1, s, begin, end, sum);
  else if (m->unknowns.dims == 3) apply_slices_of(3, 0, s, begin, end, sum);
  else apply_slices_of(2, many, s, begin, end, sum);
}

static void apply_split_rows(const ms_pcg *s, double *sum) {
  if (s->base.system->model->unknowns.dims == 3) apply_split_rows_of(3, s, sum);
  else apply_split_rows_of(2, s, sum);
}

/*------------------------------------- reduce ---------------------------------------------------*/

/* z replaces q, so that its cache lines need not be read before they are written. */
MS_INLINE void reduce_slices_of(size_t dims, const ms_pcg *s, double alpha, int32_t begin,
                                int32_t end, double *sum) {
  const size_t stride = (size_t)s->base.system->model->unknowns.stride;
  const size_t sd = (size_t)s->base.system->model->unknowns.first_pinned;
  ms_real *to_r = s->r, *q = s->q;
  lane_sums rz = {{0}};
  for (size_t row = MS_SLICE * (size_t)begin; row < MS_SLICE * (size_t)end; row += MS_LANES) {
    ms_lanes r[3], dot = {0};
    for (size_t c = 0; c < dims; c++) {
      const size_t at = c * stride + row;
      r[c] = ms_simd_load(to_r + at) - (ms_real)alpha * ms_simd_load(q + at);
      ms_simd_store(to_r + at, r[c]);
    }
    for (size_t c = 0; c < dims; c++) {
      ms_lanes z = {0};
      for (size_t d = 0; d < dims; d++)
        z += ms_simd_load_floats(s->inverse + ms_coefficients_diagonal_element(dims, c, d) * sd +
                                 row) *
             r[d];
      ms_simd_store(q + c * stride + row, z);
      dot += r[c] * z;
    }
    add_lanes(&rz, row % MS_SLICE, dot);
  }
  *sum = total_lanes(&rz);
}

static void reduce_slices(const ms_pcg *s, double alpha, int32_t begin, int32_t end, double *sum) {
  if (s->base.system->model->unknowns.dims == 3) reduce_slices_of(3, s, alpha, begin, end, sum);
  else reduce_slices_of(2, s, alpha, begin, end, sum);
}

/*------------------------------------- advance --------------------------------------------------*/

/* P c at the 8 unknowns of a slice */
MS_INLINE void prolong(size_t dims, const ms_coarse *coarse, size_t row, double out[3][MS_SLICE]) {
  const ms_aggregates *g = &coarse->aggregates;
  for (size_t l = 0; l < MS_SLICE; l += 4) {
    ms_quad v[3][4];
    for (size_t k = 0; k < 4; k++) {
      const int32_t of = g->of[row + l + k];
      const ms_quad w = ms_simd_load_float_quad(g->weight + MS_MODES * (row + l + k));
      const double *z = coarse->z + MS_MODES * dims * (size_t)(of < 0 ? 0 : of);
      for (size_t c = 0; c < dims; c++) v[c][k] = w * ms_simd_load_quad(z + MS_MODES * c);
    }
    for (size_t c = 0; c < dims; c++)
      ms_simd_store_quad(out[c] + l, ms_simd_quad_sums(v[c][0], v[c][1], v[c][2], v[c][3]));
  }
}

MS_INLINE void advance_slices_of(size_t dims, int two_level, const ms_pcg *s, double alpha,
                                 double beta, int32_t begin, int32_t end) {
  const size_t stride = (size_t)s->base.system->model->unknowns.stride;
  const ms_real *from = s->q;
  ms_real *to = s->p;
  double coarse[3][MS_SLICE] = {{0}};
  for (size_t g = MS_SLICE * (size_t)begin; g < MS_SLICE * (size_t)end; g += MS_SLICE) {
    if (two_level) prolong(dims, &s->coarse, g, coarse);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      for (size_t c = 0; c < dims; c++) {
        const size_t at = c * stride + g + lane;
        const ms_lanes p = ms_simd_load(to + at);
        ms_simd_add_to_doubles(s->y + at, s->unit * alpha, p);
        const ms_lanes z = ms_simd_load(from + at) + ms_simd_load_doubles(coarse[c] + lane);
        ms_simd_store(to + at, z + (ms_real)beta * p);
      }
    }
  }
}

static void advance_slices(const ms_pcg *s, double alpha, double beta, int32_t begin, int32_t end) {
  const int dims = s->base.system->model->unknowns.dims;
  if (s->coarse_is_ready) {
    if (dims == 3) advance_slices_of(3, 1, s, alpha, beta, begin, end);
    else advance_slices_of(2, 1, s, alpha, beta, begin, end);
  } else {
    if (dims == 3) advance_slices_of(3, 0, s, alpha, beta, begin, end);
    else advance_slices_of(2, 0, s, alpha, beta, begin, end);
  }
}

/*------------------------------------- begin and end --------------------------------------------*/

static void begin_slices(const ms_pcg *s, const double *b, int32_t begin, int32_t end) {
  const ms_unknowns *rows = &s->base.system->model->unknowns;
  const double by = 1 / s->jacobi.scale / s->unit;
  const int32_t end_row = MS_SLICE * end, last = end_row < rows->nfree ? end_row : rows->nfree;
  for (int32_t c = 0; c < rows->dims; c++) {
    const size_t at = (size_t)c * (size_t)rows->stride;
    ms_real *r = (ms_real *)s->r + at;
    for (int32_t row = MS_SLICE * begin; row < last; row++) r[row] = (ms_real)(by * (b + at)[row]);
    for (int32_t row = last; row < end_row; row++) r[row] = 0;
  }
}

static void end_slices(const ms_pcg *s, double alpha, int32_t begin, int32_t end) {
  const size_t stride = (size_t)s->base.system->model->unknowns.stride;
  const ms_real *p = s->p;
  for (size_t c = 0; c < (size_t)s->base.system->model->unknowns.dims; c++)
    for (size_t row = MS_SLICE * (size_t)begin; row < MS_SLICE * (size_t)end; row += MS_LANES) {
      const size_t at = c * stride + row;
      ms_simd_add_to_doubles(s->y + at, s->unit * alpha, ms_simd_load(p + at));
    }
}

const ms_pcg_kernels MS_TABLE(PCG_KERNELS) = {begin_slices,  apply_slices,   apply_split_rows,
                                              reduce_slices, advance_slices, end_slices};
