/* panels - a packed copy of CHOLMOD's supernodal factor, for many solves with one factor.
 *
 * The columns of a supernode are grouped by four. For a group J, with R the rows below it, the
 * panel is
 *   P = [L_JJ^-1; -L_RJ L_JJ^-1].
 * Forward substitution with L for the columns J is w = P w_J, and backward substitution with L' is
 * w_J = P' w, without dependences between the numbers of a panel. P is stored in the order in which
 * it is read: 4 rows of one column, the same rows of the next column; in single precision if that
 * is sufficient, because the time of a solve is that of reading P. Sums are in double precision. */
#ifndef MSIM_CHOLMOD_PANELS_H
#define MSIM_CHOLMOD_PANELS_H

#include <float.h>
#include <math.h>
#include <string.h>

#include "supernode.h"

typedef double quad __attribute__((vector_size(8 * LANES)));
typedef double loose_quad __attribute__((vector_size(8 * LANES), aligned(8), may_alias));
typedef float float_quad __attribute__((vector_size(4 * LANES)));
typedef int64_t quad_mask __attribute__((vector_size(8 * LANES)));

typedef struct panels {
  const cholmod_factor *factor;
  int single;  /* values are floats, otherwise doubles */
  void *value; /* panels_value_count numbers: all panels in order */
  double *y;   /* workspace: 4 n, right-hand sides interleaved */
  double *w;   /* workspace for the rows of a supernode: panels_work_size */
} panels;

INLINE int32_t min_int32(int32_t a, int32_t b) { return a < b ? a : b; }

/* Number of quads for the rows of a supernode from row j on. */
INLINE size_t quads_from(const supernode *s, int32_t j) {
  return (size_t)(s->rows - j + LANES - 1) / LANES;
}

/* Number of values in the panel that begins with column j. */
INLINE size_t panel_size(const supernode *s, int32_t j) {
  return LANES * (size_t)min_int32(LANES, s->width - j) * quads_from(s, j);
}

static size_t panels_value_count(const cholmod_factor *L) {
  size_t size = 0;
  for (size_t k = 0; k < L->nsuper; k++) {
    const supernode s = supernode_at(L, k);
    for (int32_t j = 0; j < s.width; j += LANES) size += panel_size(&s, j);
  }
  return size;
}

static size_t panels_work_size(const cholmod_factor *L) {
  size_t most = 0;
  for (size_t k = 0; k < L->nsuper; k++) {
    const supernode s = supernode_at(L, k);
    if (quads_from(&s, 0) > most) most = quads_from(&s, 0);
  }
  return MAX_SIDES * LANES * most;
}

/*------------------------------------- packing --------------------------------------------------*/

/* Columns J of L from row J on: column m begins at L + m apart and has `rows` rows */
typedef struct group {
  const double *L;
  size_t apart, rows, columns;
} group;

/* V = L_JJ^-1:  V_kk = 1/L_kk,  V_ik = - (sum over k <= m < i of L_im V_mk) / L_ii */
static void invert_diagonal_block(const group *J, double V[LANES][LANES]) {
  for (size_t k = 0; k < J->columns; k++)
    for (size_t i = 0; i < J->columns; i++) {
      double sum = i == k;
      for (size_t m = k; m < i; m++) sum -= J->L[m * J->apart + i] * V[m][k];
      V[i][k] = i < k ? 0 : sum / J->L[i * J->apart + i];
    }
}

INLINE quad load_quad(const double *from) {
  quad v;
  memcpy(&v, from, sizeof v);
  return v;
}

/* 4 numbers at any address, for writing. */
INLINE loose_quad *quad_at(double *to) { return (loose_quad *)to; }

/* Four values from index `at` on; `single` is a constant after inlining. */
INLINE quad load_values(const void *P, size_t at, int single) {
  if (!single) return load_quad((const double *)P + at);
  float_quad v;
  memcpy(&v, (const float *)P + at, sizeof v);
  return __builtin_convertvector(v, quad);
}

INLINE void store_values(void *P, size_t at, int single, quad v) {
  const float_quad narrow = __builtin_convertvector(v, float_quad);
  if (single) memcpy((float *)P + at, &narrow, sizeof narrow);
  else memcpy((double *)P + at, &v, sizeof v);
}

/* Rows first to first + 3 of -L_RJ V, column k; rows of J and rows past the end are arbitrary. */
INLINE quad compute_panel_rows(const group *J, size_t first, double V[LANES][LANES], size_t k) {
  quad sum = {0};
  for (size_t m = k; m < J->columns; m++) {
    const double *column = J->L + m * J->apart;
    quad l = {0};
    if (first + LANES <= J->rows) l = load_quad(column + first);
    else
      for (size_t i = first; i < J->rows; i++) l[i - first] = column[i];
    sum -= l * V[m][k];
  }
  return sum;
}

/* Returns 0 if a float cannot represent the panel: V_kk must be normal, all others finite. */
INLINE int pack_panel(const supernode *s, int32_t j, int single, void *P, size_t at) {
  const size_t apart = (size_t)s->rows, columns = (size_t)min_int32(LANES, s->width - j);
  const group J = {s->value + (size_t)j * apart + j, apart, apart - (size_t)j, columns};
  double V[LANES][LANES], least_V = INFINITY;
  quad sum = {0}; /* sum of 0 times each value: 0, or NaN */
  invert_diagonal_block(&J, V);
  for (size_t k = 0; k < columns; k++) least_V = V[k][k] < least_V ? V[k][k] : least_V;
  for (size_t first = 0; first < J.rows; first += LANES)
    for (size_t k = 0; k < columns; k++, at += LANES) {
      quad v = compute_panel_rows(&J, first, V, k);
      for (size_t i = 0; i < columns && first == 0; i++) v[i] = V[i][k];
      store_values(P, at, single, v);
      if (single) sum += 0 * load_values(P, at, single);
    }
  return !single || (least_V >= FLT_MIN && sum[0] + sum[1] + sum[2] + sum[3] == 0);
}

INLINE int pack_panels(const panels *p, int single) {
  size_t at = 0;
  int whole = 1;
  for (size_t k = 0; k < p->factor->nsuper; k++) {
    const supernode s = supernode_at(p->factor, k);
    for (int32_t j = 0; j < s.width; at += panel_size(&s, j), j += LANES)
      whole &= pack_panel(&s, j, single, p->value, at);
  }
  return whole;
}

/*------------------------------------- products -------------------------------------------------*/

/* Lanes i, j, k, l of the lanes of a (0 to 3) and b (4 to 7). */
#if defined(__clang__) || __GNUC__ >= 12
#  define PICK(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
#  define PICK(a, b, i, j, k, l) __builtin_shuffle(a, b, (quad_mask){i, j, k, l})
#endif

/* Transpose a 4 x 4 matrix. */
INLINE void transpose(quad v[LANES]) {
  const quad a = PICK(v[0], v[1], 0, 4, 2, 6), b = PICK(v[0], v[1], 1, 5, 3, 7);
  const quad c = PICK(v[2], v[3], 0, 4, 2, 6), d = PICK(v[2], v[3], 1, 5, 3, 7);
  v[0] = PICK(a, c, 0, 1, 4, 5), v[1] = PICK(b, d, 0, 1, 4, 5);
  v[2] = PICK(a, c, 2, 3, 6, 7), v[3] = PICK(b, d, 2, 3, 6, 7);
}

/* A panel P, from index `at` of the values on; `single` and `columns` are constants after
 * inlining. */
typedef struct panel {
  const void *value;
  int single, columns;
  size_t at, quads;
} panel;

/* w = P w_J: replace the first numbers of w, one per column, add to the others. */
INLINE void multiply(panel P, sides w) {
  quad x[LANES][MAX_SIDES] = {{{0}}};
  for (int c = 0; c < w.count; c++) {
    quad corner = load_quad(side(w, c));
    for (int j = 0; j < P.columns; j++) {
      x[j][c] = (quad){corner[j], corner[j], corner[j], corner[j]};
      corner[j] = 0;
    }
    *quad_at(side(w, c)) = corner;
  }
  for (size_t q = 0; q < P.quads; q++, w.at += LANES) {
    quad sum[MAX_SIDES];
    for (int c = 0; c < w.count; c++) sum[c] = load_quad(side(w, c));
    for (int j = 0; j < P.columns; j++, P.at += LANES)
      for (int c = 0; c < w.count; c++) sum[c] += load_values(P.value, P.at, P.single) * x[j][c];
    for (int c = 0; c < w.count; c++) *quad_at(side(w, c)) = sum[c];
  }
}

/* w_J = P' w. Panels are read from last to first, which the hardware does not prefetch. */
INLINE void multiply_transposed(panel P, sides w) {
  enum { LINE = 64, AHEAD = 8192 };
  const size_t bytes = P.single ? sizeof(float) : sizeof(double);
  quad sum[MAX_SIDES][LANES] = {{{0}}};
  for (size_t q = 0; q < P.quads; q++) {
    const uintptr_t here = (uintptr_t)P.value + P.at * bytes;
    for (size_t b = 0; b < LANES * (size_t)P.columns * bytes; b += LINE)
      __builtin_prefetch((const void *)(here + b - AHEAD));
    for (int j = 0; j < P.columns; j++, P.at += LANES)
      for (int c = 0; c < w.count; c++)
        sum[c][j] += load_values(P.value, P.at, P.single) * load_quad(side(w, c) + LANES * q);
  }
  for (int c = 0; c < w.count; c++) {
    transpose(sum[c]);
    const quad total = (sum[c][0] + sum[c][1]) + (sum[c][2] + sum[c][3]);
    quad corner = load_quad(side(w, c));
    for (int j = 0; j < P.columns; j++) corner[j] = total[j];
    *quad_at(side(w, c)) = corner;
  }
}

/* One of the two products, with a constant number of columns */
INLINE void multiply_by_panel(panel P, int transposed, sides w) {
  switch (P.columns) {
#define CASE(number)                           \
  case number:                                 \
    P.columns = number;                        \
    if (transposed) multiply_transposed(P, w); \
    else multiply(P, w);                       \
    return
    CASE(1);
    CASE(2);
    CASE(3);
    CASE(4);
#undef CASE
  }
}

/*------------------------------------- solving --------------------------------------------------*/

/* 4 rows of y; zeros for rows past the `count`-th */
INLINE void load_rows(const int32_t *row, int32_t count, const double *y, quad v[LANES]) {
  for (int32_t l = 0; l < LANES; l++)
    v[l] = l < count ? load_quad(y + LANES * (size_t)row[l]) : (quad){0};
}

INLINE void store_rows(const int32_t *row, int32_t count, const quad v[LANES], double *y) {
  for (int32_t l = 0; l < LANES; l++)
    if (l < count) *quad_at(y + LANES * (size_t)row[l]) = v[l];
}

INLINE void gather_quad(const int32_t *row, int32_t count, const double *y, sides w) {
  quad v[LANES];
  load_rows(row, count, y, v);
  transpose(v);
  for (int c = 0; c < w.count; c++) *quad_at(side(w, c)) = v[c];
}

INLINE void scatter_quad(const int32_t *row, int32_t count, sides w, double *y) {
  quad v[LANES] = {{0}};
  for (int c = 0; c < w.count; c++) v[c] = load_quad(side(w, c));
  transpose(v);
  store_rows(row, count, v, y);
}

/* w = the rows of y of the supernode, and zeros up to a whole quad */
INLINE void gather_rows(const supernode *s, const double *y, sides w) {
  int32_t i = 0;
  for (; i < (int32_t)w.apart && w.count == 1; i++) w.at[i] = i < s->rows ? y[s->row[i]] : 0;
  for (; i + LANES <= s->rows; i += LANES)
    gather_quad(s->row + i, LANES, y, sides_from(w, (size_t)i));
  if (i < s->rows) gather_quad(s->row + i, s->rows - i, y, sides_from(w, (size_t)i));
}

/* store w to the first `count` rows of the supernode in y */
INLINE void scatter_rows(const supernode *s, int32_t count, sides w, double *y) {
  int32_t i = 0;
  for (; i < count && w.count == 1; i++) y[s->row[i]] = w.at[i];
  for (; i + LANES <= count; i += LANES)
    scatter_quad(s->row + i, LANES, sides_from(w, (size_t)i), y);
  if (i < count) scatter_quad(s->row + i, count - i, sides_from(w, (size_t)i), y);
}

/* The panel of column j */
INLINE panel panel_of(const panels *p, int single, const supernode *s, int32_t j, size_t at) {
  return (panel){p->value, single, min_int32(LANES, s->width - j), at, quads_from(s, j)};
}

/* L y' = y */
INLINE void panels_forward(const panels *p, int single, int count) {
  size_t at = 0;
  for (size_t k = 0; k < p->factor->nsuper; k++) {
    const supernode s = supernode_at(p->factor, k);
    const sides w = {p->w, LANES * quads_from(&s, 0), count};
    gather_rows(&s, p->y, w);
    for (int32_t j = 0; j < s.width; at += panel_size(&s, j), j += LANES)
      multiply_by_panel(panel_of(p, single, &s, j, at), 0, sides_from(w, (size_t)j));
    scatter_rows(&s, s.rows, w, p->y);
  }
}

/* L' y' = y */
INLINE void panels_backward(const panels *p, int single, int count) {
  size_t at = panels_value_count(p->factor);
  for (size_t k = p->factor->nsuper; k-- > 0;) {
    const supernode s = supernode_at(p->factor, k);
    const sides w = {p->w, LANES * quads_from(&s, 0), count};
    gather_rows(&s, p->y, w);
    for (int32_t j = (s.width - 1) / LANES * LANES; j >= 0; j -= LANES) {
      at -= panel_size(&s, j);
      multiply_by_panel(panel_of(p, single, &s, j, at), 1, sides_from(w, (size_t)j));
    }
    scatter_rows(&s, s.width, w, p->y);
  }
}

/* y = b, from right-hand sides n apart to interleaved ones */
INLINE void interleave_sides(size_t n, const double *b, double *y, int count) {
  size_t i = 0;
  for (; i + LANES <= n && count > 1; i += LANES) {
    quad v[LANES] = {{0}};
    for (int c = 0; c < count; c++) v[c] = load_quad(b + (size_t)c * n + i);
    transpose(v);
    for (size_t l = 0; l < LANES; l++) *quad_at(y + LANES * (i + l)) = v[l];
  }
  for (; i < n; i++)
    for (int c = 0; c < count; c++)
      y[(count > 1 ? LANES : 1) * i + (size_t)c] = b[(size_t)c * n + i];
}

INLINE void separate_sides(size_t n, const double *y, double *x, int count) {
  size_t i = 0;
  for (; i + LANES <= n && count > 1; i += LANES) {
    quad v[LANES];
    for (size_t l = 0; l < LANES; l++) v[l] = load_quad(y + LANES * (i + l));
    transpose(v);
    for (int c = 0; c < count; c++) *quad_at(x + (size_t)c * n + i) = v[c];
  }
  for (; i < n; i++)
    for (int c = 0; c < count; c++)
      x[(size_t)c * n + i] = y[(count > 1 ? LANES : 1) * i + (size_t)c];
}

/* L L' x = b */
INLINE void solve_by_panels(const panels *p, int single, const double *b, double *x, int count) {
  interleave_sides(p->factor->n, b, p->y, count);
  panels_forward(p, single, count);
  panels_backward(p, single, count);
  separate_sides(p->factor->n, p->y, x, count);
}

/* Compiled with fused multiply-add. With registers of 2 doubles panels are slower than
 * triangular_solve. */
#if defined(__x86_64__)
#  if defined(__clang__)
#    define FUSED __attribute__((target("avx2,fma")))
#  else
#    define FUSED __attribute__((target("avx2,fma"), optimize("fp-contract=fast")))
#  endif
static int panels_are_faster(void) {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}
#else
#  define FUSED
static int panels_are_faster(void) { return 1; }
#endif

/* Pack a new factor. 0: it is out of the range of single precision. */
FUSED static int panels_pack(const panels *p) {
  return p->single ? pack_panels(p, 1) : pack_panels(p, 0);
}

/* x = (L L')^-1 b for 1 to 3 right-hand sides, n apart. */
FUSED static void panels_solve(const panels *p, const double *b, double *x, int count) {
  if (p->single && count == 1) solve_by_panels(p, 1, b, x, 1);
  else if (count == 1) solve_by_panels(p, 0, b, x, 1);
  else if (count == 2) solve_by_panels(p, 0, b, x, 2);
  else solve_by_panels(p, 0, b, x, 3);
}

#endif
