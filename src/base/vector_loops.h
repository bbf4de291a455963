/* vector_loops - the loops of vector.h over numbers of type REAL, in functions whose names LOOP
 * makes; vector_loop_kernels.c includes it once for doubles and once for floats. */

static void LOOP(scale)(ms_shape s, double by, void *vec) {
  const REAL a = (REAL)by;
  REAL *x = vec;
  EACH_PART(s) EACH_ROW(s) x[at + (size_t)r] *= a;
}

static void LOOP(axpy)(ms_shape s, double by, const void *x, void *y) {
  const REAL a = (REAL)by;
  EACH_COMPONENT(s) {
    const REAL *restrict xc = (const REAL *)x + at;
    REAL *restrict yc = (REAL *)y + at;
    EACH_ROW(s) yc[r] += a * xc[r];
  }
}

static void LOOP(add_scaled)(ms_shape s, const void *x, double by, const void *y, void *z) {
  const REAL a = (REAL)by;
  EACH_COMPONENT(s) {
    const REAL *xc = (const REAL *)x + at, *yc = (const REAL *)y + at;
    REAL *zc = (REAL *)z + at;
    EACH_ROW(s) LOOP(add)(s, xc + r, a * yc[r], zc + r);
  }
}

static void LOOP(add_two_scaled)(ms_shape s, const void *x, double of_y, const void *y, double of_z,
                                 const void *z, void *w) {
  const REAL a = (REAL)of_y, b = (REAL)of_z;
  EACH_COMPONENT(s) {
    const REAL *xc = (const REAL *)x + at, *yc = (const REAL *)y + at, *zc = (const REAL *)z + at;
    REAL *wc = (REAL *)w + at;
    EACH_ROW(s) LOOP(add)(s, xc + r, a * yc[r] + b * zc[r], wc + r);
  }
}

static void LOOP(three_term)(ms_shape s, const void *y0, double of_y1, const void *y1, double of_y2,
                             const void *y2, double of_f, const void *f, void *y) {
  const REAL a = (REAL)of_y1, b = (REAL)of_y2, c = (REAL)of_f;
  EACH_COMPONENT(s) {
    const REAL *from = (const REAL *)y0 + at, *one = (const REAL *)y1 + at,
               *two = (const REAL *)y2 + at, *fc = (const REAL *)f + at;
    REAL *to = (REAL *)y + at;
    EACH_ROW(s)
    LOOP(add)(s, from + r, a * (one[r] - from[r]) + b * (two[r] - from[r]) + c * fc[r], to + r);
  }
}

static double LOOP(dot_chunk)(const REAL *x, const REAL *y, int32_t n) {
  double sum[LANES] = {0};
  int32_t r = 0;
  for (; r + LANES <= n; r += LANES)
    for (int lane = 0; lane < LANES; lane++) sum[lane] += (double)x[r + lane] * (double)y[r + lane];
  for (int lane = 0; r < n; r++, lane++) sum[lane] += (double)x[r] * (double)y[r];
  return ms_vector_sum_lanes(sum);
}

static double LOOP(dot)(ms_shape s, const void *x, const void *y) {
  double sum = 0;
  EACH_COMPONENT(s) {
    for (int32_t r = 0; r < s.n; r += CHUNK)
      sum += LOOP(dot_chunk)((const REAL *)x + at + r, (const REAL *)y + at + r,
                             s.n - r < CHUNK ? s.n - r : CHUNK);
  }
  return sum;
}

/* The first number that is not 0 ends the search. */
static int LOOP(is_zero)(ms_shape s, const void *vec) {
  const REAL *x = vec;
  EACH_COMPONENT(s) {
    int32_t r = 0;
    for (; r + LANES <= s.n; r += LANES) {
      int moves = 0;
      for (int lane = 0; lane < LANES; lane++) moves |= x[at + (size_t)(r + lane)] != 0;
      if (moves) return 0;
    }
    for (; r < s.n; r++)
      if (x[at + (size_t)r] != 0) return 0;
  }
  return 1;
}

static int32_t LOOP(find_above)(ms_shape s, double limit, const void *vec) {
  const REAL *x = vec;
  for (int32_t r = 0; r < s.n; r++)
    EACH_PART(s) if (!(fabs((double)x[at + (size_t)r]) <= limit)) return r;
  return -1;
}
