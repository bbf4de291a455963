/* Compiled once for each instruction set MS_ISA; every loop is built for 2 and for 3 components. */
#include "physics/angle_kernels.h"

#include "physics/angle.h"
#include "physics/lanes.h"
#include "physics/spring_law.h"
#include "scene/angles.h"

/*------------------------------------- vectors --------------------------------------------------*/

/* Functions for vectors of doubles, or of floats if `single`, a constant of their callers */

MS_INLINE ms_lanes load_numbers(int single, const void *vec, size_t at) {
  return single ? ms_simd_load_floats((const float *)vec + at)
                : ms_simd_load((const double *)vec + at);
}

MS_INLINE ms_lanes gather_numbers(int single, const void *vec, size_t first, const int32_t *index) {
  if (!single) return ms_simd_gather((const double *)vec + first, index);
  const float *x = (const float *)vec + first;
  ms_lanes v = {0};
  for (int l = 0; l < MS_LANES; l++) v[l] = (double)x[index[l]];
  return v;
}

MS_INLINE void add_numbers(int single, void *vec, size_t at, ms_lanes v) {
  v += load_numbers(single, vec, at);
  if (single) ms_simd_store_floats((float *)vec + at, v);
  else ms_simd_store((double *)vec + at, v);
}

/* The rows of corner q of the angles from `at` on */
MS_INLINE ms_lane_vectors load_ends(int dims, int single, const ms_angles *g, int q, size_t at,
                                    const void *vec, size_t stride) {
  const int32_t start = g->start[q][at / MS_SLICE];
  ms_lane_vectors v = {{{0}}};
  for (size_t c = 0; c < (size_t)dims; c++)
    v.c[c] = start >= 0 ? load_numbers(single, vec, c * stride + (size_t)start + at % MS_SLICE)
                        : gather_numbers(single, vec, c * stride, g->end[q] + at);
  return v;
}

typedef struct edge_lanes {
  ms_lane_vectors p, q; /* those of i and k less that of j */
} edge_lanes;

MS_INLINE edge_lanes load_edges(int dims, int single, const ms_model *m, size_t at,
                                const void *vec) {
  const size_t stride = (size_t)m->unknowns.stride;
  const ms_angles *g = &m->angles;
  const ms_lane_vectors j = load_ends(dims, single, g, 1, at, vec, stride);
  return (edge_lanes){ms_subtract_vec(dims, load_ends(dims, single, g, 0, at, vec, stride), j),
                      ms_subtract_vec(dims, load_ends(dims, single, g, 2, at, vec, stride), j)};
}

/* ms_dot_vec() rounds as the instruction set does. */
MS_INLINE ms_lanes dot(int dims, ms_lane_vectors a, ms_lane_vectors b) {
  ms_lanes sum = a.c[0] * b.c[0];
  for (int c = 1; c < dims; c++) sum += a.c[c] * b.c[c];
  return sum;
}

MS_INLINE ms_lane_vectors scale(int dims, ms_lanes by, ms_lane_vectors v) {
  for (int c = 0; c < dims; c++) v.c[c] *= by;
  return v;
}

/* Axial vectors have one component in 2 dimensions, c[0]. */
MS_INLINE int axial(int dims) { return dims == 3 ? 3 : 1; }

MS_INLINE ms_lane_vectors cross(int dims, ms_lane_vectors a, ms_lane_vectors b) {
  ms_lane_vectors w = {{{0}}};
  if (dims == 2) w.c[0] = a.c[0] * b.c[1] - a.c[1] * b.c[0];
  for (int c = 0; c < 3 && dims == 3; c++) {
    const int d = (c + 1) % 3, e = (c + 2) % 3;
    w.c[c] = a.c[d] * b.c[e] - a.c[e] * b.c[d];
  }
  return w;
}

/* t x v, t axial */
MS_INLINE ms_lane_vectors turn(int dims, ms_lane_vectors t, ms_lane_vectors v) {
  if (dims == 3) return cross(3, t, v);
  return (ms_lane_vectors){{-(t.c[0] * v.c[1]), t.c[0] * v.c[0]}};
}

MS_INLINE void store_corners(int dims, const ms_angles *g, size_t at, ms_lane_vectors i,
                             ms_lane_vectors k) {
  const size_t n = (size_t)g->nslots;
  double *to = g->corner + at;
  for (size_t c = 0; c < (size_t)dims; c++) {
    ms_simd_store(to + c * n, i.c[c]);
    ms_simd_store(to + (3 + c) * n, -(i.c[c] + k.c[c]));
    ms_simd_store(to + (6 + c) * n, k.c[c]);
  }
}

/*------------------------------------- forces ---------------------------------------------------*/

MS_INLINE ms_lanes absolute(ms_lanes v) { return (ms_lanes)((ms_mask)v & INT64_MAX); }

/* atan2(y, x) for y >= 0, to 1 unit in the last place or so; x = y = 0: any number, or NaN.
 *
 * With t = min/max of y and |x|, and t = (1 + r)/(1 - r), r = (t - 1)/(t + 1), above tan(pi/8):
 * atan t = pi/4 + atan r. atan r = r + r^3 P(r^2) with the polynomial of degree 10 of nearly least
 * maximum error, 3.2e-17, on [0, tan(pi/8)^2], from its Chebyshev expansion. */
MS_INLINE ms_lanes angle_of(ms_lanes y, ms_lanes x) {
  static const double P[] = {-0.3333333333333333,  0.19999999999995516,  -0.14285714284665682,
                             0.11111111015187018,  -0.0909090457530649,  0.07692183125376892,
                             -0.06664510525508936, 0.05858140904866328,  -0.050854078345894844,
                             0.03923044778479309,  -0.019175404711104935};
  const ms_lanes zero = {0}, size = absolute(x);
  const ms_mask steep = y > size;
  const ms_lanes less = ms_simd_select(steep, size, y), more = ms_simd_select(steep, y, size);
  const ms_mask upper = less > 0.41421356237309503 * more;
  const ms_lanes r =
      ms_simd_select(upper, less - more, less) / ms_simd_select(upper, less + more, more);
  const ms_lanes z = r * r, z2 = z * z, z4 = z2 * z2; /* Estrin's scheme: short chains */
  const ms_lanes low = (P[0] + P[1] * z) + (P[2] + P[3] * z) * z2;
  const ms_lanes middle = (P[4] + P[5] * z) + (P[6] + P[7] * z) * z2;
  const ms_lanes high = (P[8] + P[9] * z) + P[10] * z2;
  const ms_lanes sum = low + z4 * (middle + z4 * high);
  ms_lanes angle = ms_simd_select(upper, zero + MS_PI / 4, zero) + (r + r * (z * sum));
  angle = ms_simd_select(steep, MS_PI / 2 - angle, angle);
  return ms_simd_select(x < 0, MS_PI - angle, angle);
}

/* With the torque T along the normal of p and q, of size k (phi - bend) + c dphi/dt,
 *   f_i = -T x p/a^2,  f_k = T x q/b^2.
 * With w = p x q, the elastic part is k (phi - bend)/|w| w, with the limit -k/p.q w where the edges
 * are straight and bend is 0, or folded and bend is pi. For other bends it has no limit there, and
 * becomes that, which is 0 up to rounding errors. With the relative angular velocity
 * u = p x v_p/a^2 - q x v_q/b^2, that of damping is c (u.w) w/|w|^2, with the limit c u; in a plane
 * it is c u. */
MS_INLINE void forces_of(int dims, int damped, const ms_model *m, const double *x, const double *v,
                         size_t at) {
  const ms_angles *g = &m->angles;
  const ms_lanes zero = {0};
  const edge_lanes edge = load_edges(dims, 0, m, at, x);
  const ms_lanes a2 = dot(dims, edge.p, edge.p), b2 = dot(dims, edge.q, edge.q);
  const ms_lanes along = dot(dims, edge.p, edge.q);
  const ms_mask none = (a2 <= MS_MIN_LENGTH2) | (b2 <= MS_MIN_LENGTH2);
  const ms_lanes over_a2 = 1 / ms_simd_max(a2, MS_MIN_LENGTH2);
  const ms_lanes over_b2 = 1 / ms_simd_max(b2, MS_MIN_LENGTH2);
  const ms_lane_vectors w = cross(dims, edge.p, edge.q);
  const ms_lanes w2 = dot(axial(dims), w, w);
  const ms_lanes across = dims == 2 ? absolute(w.c[0]) : ms_simd_sqrt(w2);
  const ms_mask collinear = across <= MS_ANGLE_SMALLEST_SINE * absolute(along);
  const ms_lanes deviation =
      ms_simd_select(collinear, zero - 1, angle_of(across, -along) - ms_simd_load(g->bend + at));
  const ms_lanes over_w = deviation / ms_simd_select(collinear, along, across);
  ms_lane_vectors torque =
      scale(axial(dims), ms_simd_select(none, zero, ms_simd_load(g->k + at) * over_w), w);
  if (damped) {
    const edge_lanes move = load_edges(dims, 0, m, at, v);
    const ms_lane_vectors u =
        ms_subtract_vec(axial(dims), scale(axial(dims), over_a2, cross(dims, edge.p, move.p)),
                        scale(axial(dims), over_b2, cross(dims, edge.q, move.q)));
    const ms_lanes c = ms_simd_select(none, zero, ms_simd_load(g->damping + at));
    const ms_lanes share = dot(axial(dims), u, w) / ms_simd_max(w2, MS_MIN_LENGTH2);
    for (int i = 0; i < axial(dims); i++)
      torque.c[i] += c * (dims == 2 ? u.c[i] : ms_simd_select(collinear, u.c[i], share * w.c[i]));
  }
  store_corners(dims, g, at, scale(dims, -over_a2, turn(dims, torque, edge.p)),
                scale(dims, over_b2, turn(dims, torque, edge.q)));
}

static void compute_angle_forces(const ms_model *m, const double *x, const double *v, int32_t begin,
                                 int32_t end) {
  const int damped = v && m->angles.is_damped;
  for (size_t at = (size_t)begin; at < (size_t)end; at += MS_LANES) {
    if (m->unknowns.dims == 3 && damped) forces_of(3, 1, m, x, v, at);
    else if (m->unknowns.dims == 3) forces_of(3, 0, m, x, v, at);
    else if (damped) forces_of(2, 1, m, x, v, at);
    else forces_of(2, 0, m, x, v, at);
  }
}

/*------------------------------------- products -------------------------------------------------*/

/* As ms_angle_multiply(), with element e[MS_SLICE m] */
MS_INLINE edge_lanes multiply_element(int dims, const double *e, edge_lanes x) {
  static const int triangle[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  edge_lanes y = {{{{0}}}, {{{0}}}};
  for (int r = 0; r < dims; r++) {
    ms_lanes p = {0}, q = {0};
    for (int c = 0; c < dims; c++) {
      p += ms_simd_load(e + MS_SLICE * (MS_ANGLE_P + triangle[r][c])) * x.p.c[c];
      q += ms_simd_load(e + MS_SLICE * (MS_ANGLE_Q + triangle[r][c])) * x.q.c[c];
      p += ms_simd_load(e + MS_SLICE * (MS_ANGLE_R + 3 * r + c)) * x.q.c[c];
      q += ms_simd_load(e + MS_SLICE * (MS_ANGLE_R + 3 * c + r)) * x.p.c[c];
    }
    y.p.c[r] = p, y.q.c[r] = q;
  }
  return y;
}

MS_INLINE double multiply_of(int dims, int single, const ms_model *m, const double *elements,
                             const void *x, int32_t begin, int32_t end) {
  const size_t size = MS_SLICE * MS_ANGLE_ELEMENT * sizeof *elements, ahead = 8 * size;
  const int many = size / MS_SLICE * (size_t)m->angles.nslots > MS_CACHE;
  double sums[MS_SLICE] = {0};
  for (size_t first = (size_t)begin; first < (size_t)end; first += MS_SLICE) {
    if (many) ms_simd_prefetch(elements + MS_ANGLE_ELEMENT * first, size, ahead);
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const edge_lanes edge = load_edges(dims, single, m, first + lane, x);
      const edge_lanes y = multiply_element(dims, elements + MS_ANGLE_ELEMENT * first + lane, edge);
      store_corners(dims, &m->angles, first + lane, y.p, y.q);
      ms_simd_store(sums + lane,
                    ms_simd_load(sums + lane) + (dot(dims, edge.p, y.p) + dot(dims, edge.q, y.q)));
    }
  }
  return ms_vector_sum_lanes(sums);
}

static double multiply_angles(const ms_model *m, const ms_coefficients *a, ms_operands o,
                              int32_t begin, int32_t end) {
  if (m->unknowns.dims == 3)
    return o.single ? multiply_of(3, 1, m, a->angles, o.x, begin, end)
                    : multiply_of(3, 0, m, a->angles, o.x, begin, end);
  return o.single ? multiply_of(2, 1, m, a->angles, o.x, begin, end)
                  : multiply_of(2, 0, m, a->angles, o.x, begin, end);
}

/*------------------------------------- rows -----------------------------------------------------*/

MS_INLINE void add_corners_of(int dims, int single, const ms_model *m, double by, int32_t begin,
                              int32_t end, void *y) {
  const ms_corners *of = &m->angles.corners;
  const size_t stride = (size_t)m->unknowns.stride, n = (size_t)m->angles.nslots;
  const double *corner = m->angles.corner;
  for (int32_t slice = begin; slice < end; slice++) {
    if (of->first[slice] == of->first[slice + 1]) continue;
    for (size_t lane = 0; lane < MS_SLICE; lane += MS_LANES) {
      const size_t row = MS_SLICE * (size_t)slice + lane;
      ms_lane_vectors sum = {{{0}}};
      for (int32_t entry = of->first[slice]; entry < of->first[slice + 1]; entry++) {
        const int32_t start = of->start[entry],
                      *place = of->place + MS_SLICE * (size_t)entry + lane;
        for (size_t c = 0; c < (size_t)dims; c++)
          sum.c[c] += start >= 0 ? ms_simd_load(corner + c * n + start + lane)
                                 : ms_simd_gather(corner + c * n, place);
      }
      for (size_t c = 0; c < (size_t)dims; c++)
        add_numbers(single, y, c * stride + row, by * sum.c[c]);
    }
  }
}

static void add_angle_corners(const ms_model *m, double by, ms_operands o, int32_t begin,
                              int32_t end) {
  if (m->unknowns.dims == 3 && o.single) add_corners_of(3, 1, m, by, begin, end, o.y);
  else if (m->unknowns.dims == 3) add_corners_of(3, 0, m, by, begin, end, o.y);
  else if (o.single) add_corners_of(2, 1, m, by, begin, end, o.y);
  else add_corners_of(2, 0, m, by, begin, end, o.y);
}

const ms_angle_kernels MS_TABLE(ms_angle_kernels) = {compute_angle_forces, multiply_angles,
                                                     add_angle_corners};
