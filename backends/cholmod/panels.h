/* panels - CHOLMOD's supernodal factor, packed once more to be solved with many times.
 *
 * L L' = U D U', U with a unit diagonal. The columns J of a supernode are taken by fours:
 *   P = [U_JJ^-1; -U_RJ U_JJ^-1],  so that  w = P w_J  is U's forward substitution by J,
 *   and  w_J = P' w  that of U':
 * within a panel no number waits for another. P is kept in the order in which it is read: 4 rows of
 * one column, the same rows of the next. */
#ifndef MSIM_CHOLMOD_PANELS_H
#define MSIM_CHOLMOD_PANELS_H

#include <string.h>

#include "supernode.h"

typedef double quad __attribute__((vector_size(8 * LANES)));
typedef int64_t quad_mask __attribute__((vector_size(8 * LANES)));

typedef struct panels {
  const cholmod_factor *factor;
  double *value;     /* panels_size of them: P after P */
  double *inverse_d; /* n: the diagonal of D^-1 */
  double *y;         /* work: 4 n, right sides side by side */
  double *w;         /* work: the rows of a supernode, panels_work */
} panels;

INLINE int32_t least(int32_t a, int32_t b) { return a < b ? a : b; }

/* Quads that hold the rows of a supernode from row j on. */
INLINE size_t quads_from(const supernode *s, int32_t j) {
  return (size_t)(s->rows - j + LANES - 1) / LANES;
}

/* Numbers in the panel that begins with column j. */
INLINE size_t panel_size(const supernode *s, int32_t j) {
  return LANES * (size_t)least(LANES, s->width - j) * quads_from(s, j);
}

static size_t panels_size(const cholmod_factor *L) {
  size_t size = 0;
  for (size_t k = 0; k < L->nsuper; k++) {
    const supernode s = supernode_at(L, k);
    for (int32_t j = 0; j < s.width; j += LANES) size += panel_size(&s, j);
  }
  return size;
}

static size_t panels_work(const cholmod_factor *L) {
  size_t most = 0;
  for (size_t k = 0; k < L->nsuper; k++) {
    const supernode s = supernode_at(L, k);
    if (quads_from(&s, 0) > most) most = quads_from(&s, 0);
  }
  return MOST_SIDES * LANES * most;
}

/*------------------------------------- packing --------------------------------------------------*/

/* V = U_JJ^-1:  V_ik = - sum over k <= m < i of U_im V_mk,  U_im = L_im / L_mm */
static void invert_corner(const supernode *s, int32_t j, int32_t columns, double V[LANES][LANES]) {
  memset(V, 0, LANES * sizeof *V);
  for (int32_t k = 0; k < columns; k++) {
    V[k][k] = 1;
    for (int32_t i = k + 1; i < columns; i++)
      for (int32_t m = k; m < i; m++) {
        const double *L = s->value + (size_t)(j + m) * (size_t)s->rows + j;
        V[i][k] -= L[i] / L[m] * V[m][k];
      }
  }
}

/* Row i of P below the corner: P_ik = - sum over m >= k of L_im / L_mm V_mk; scaled: V_mk / L_mm */
INLINE double below(const supernode *s, int32_t j, int32_t i, int32_t k, int32_t columns,
                    double scaled[LANES][LANES]) {
  const double *L = s->value + (size_t)j * (size_t)s->rows + j;
  double sum = 0;
  for (int32_t m = k; m < columns; m++) sum -= L[m * s->rows + i] * scaled[m][k];
  return sum;
}

static void pack_panel(const supernode *s, int32_t j, double *P) {
  const int32_t columns = least(LANES, s->width - j), end = s->rows - j;
  const double *L = s->value + (size_t)j * (size_t)s->rows + j;
  double V[LANES][LANES], scaled[LANES][LANES];
  invert_corner(s, j, columns, V);
  for (int32_t m = 0; m < columns; m++)
    for (int32_t k = 0; k < columns; k++) scaled[m][k] = V[m][k] / L[m * s->rows + m];
  for (int32_t first = 0; first < end; first += LANES)
    for (int32_t k = 0; k < columns; k++)
      for (int32_t i = first; i < first + LANES; i++)
        *P++ = i < columns ? V[i][k] : i < end ? below(s, j, i, k, columns, scaled) : 0;
}

/* The factor is new. */
static void panels_pack(panels *p) {
  double *value = p->value, *d = p->inverse_d;
  for (size_t k = 0; k < p->factor->nsuper; k++) {
    const supernode s = supernode_at(p->factor, k);
    for (int32_t j = 0; j < s.width; value += panel_size(&s, j), j += LANES)
      pack_panel(&s, j, value);
    for (int32_t j = 0; j < s.width; j++) {
      const double l = s.value[(size_t)j * (size_t)s.rows + (size_t)j];
      *d++ = 1 / l / l;
    }
  }
}

/*------------------------------------- products -------------------------------------------------*/

INLINE quad load_quad(const double *from) {
  quad v;
  memcpy(&v, from, sizeof v);
  return v;
}

INLINE void store_quad(double *to, quad v) { memcpy(to, &v, sizeof v); }

/* Rows of 4 numbers to columns, or back. */
INLINE void transpose(quad v[LANES]) {
  const quad_mask even = {0, 4, 2, 6}, odd = {1, 5, 3, 7}, low = {0, 1, 4, 5}, high = {2, 3, 6, 7};
  const quad a = __builtin_shuffle(v[0], v[1], even), b = __builtin_shuffle(v[0], v[1], odd);
  const quad c = __builtin_shuffle(v[2], v[3], even), d = __builtin_shuffle(v[2], v[3], odd);
  v[0] = __builtin_shuffle(a, c, low), v[1] = __builtin_shuffle(b, d, low);
  v[2] = __builtin_shuffle(a, c, high), v[3] = __builtin_shuffle(b, d, high);
}

/* w = P w_J: the first `columns` numbers of w are replaced, to the others P's share is added.
 * The sides of w lie `apart`. */
INLINE void multiply(const double *P, size_t quads, int columns, double *w, size_t apart,
                     int sides) {
  quad x[LANES][MOST_SIDES];
  for (int c = 0; c < sides; c++) {
    quad corner = load_quad(w + (size_t)c * apart);
    for (int j = 0; j < columns; j++) {
      x[j][c] = (quad){corner[j], corner[j], corner[j], corner[j]};
      corner[j] = 0;
    }
    store_quad(w + (size_t)c * apart, corner);
  }
  for (size_t q = 0; q < quads; q++, w += LANES) {
    quad sum[MOST_SIDES];
    for (int c = 0; c < sides; c++) sum[c] = load_quad(w + (size_t)c * apart);
    for (int j = 0; j < columns; j++, P += LANES)
      for (int c = 0; c < sides; c++) sum[c] += load_quad(P) * x[j][c];
    for (int c = 0; c < sides; c++) store_quad(w + (size_t)c * apart, sum[c]);
  }
}

/* w_J = P' w */
INLINE void multiply_transposed(const double *P, size_t quads, int columns, double *w, size_t apart,
                                int sides) {
  quad sum[MOST_SIDES][LANES] = {{{0}}};
  for (size_t q = 0; q < quads; q++)
    for (int j = 0; j < columns; j++, P += LANES)
      for (int c = 0; c < sides; c++)
        sum[c][j] += load_quad(P) * load_quad(w + (size_t)c * apart + LANES * q);
  for (int c = 0; c < sides; c++) {
    transpose(sum[c]);
    const quad total = (sum[c][0] + sum[c][1]) + (sum[c][2] + sum[c][3]);
    quad corner = load_quad(w + (size_t)c * apart);
    for (int j = 0; j < columns; j++) corner[j] = total[j];
    store_quad(w + (size_t)c * apart, corner);
  }
}

/* Either one by the panel that begins with column j; the number of columns is a constant. */
INLINE void by_panel(const supernode *s, int32_t j, const double *P, int transposed, double *w,
                     size_t apart, int sides) {
  const size_t quads = quads_from(s, j);
  switch (least(LANES, s->width - j)) {
#define CASE(columns)                                                            \
  case columns:                                                                  \
    if (transposed) multiply_transposed(P, quads, columns, w + j, apart, sides); \
    else multiply(P, quads, columns, w + j, apart, sides);                       \
    return
    CASE(1);
    CASE(2);
    CASE(3);
    CASE(4);
#undef CASE
  }
}

/*------------------------------------- solving --------------------------------------------------*/

/* w = the rows of y, and zeros up to a whole quad */
INLINE void gather_rows(const supernode *s, const double *y, double *w, size_t apart, int sides) {
  for (int32_t i = 0; i < (int32_t)apart && sides == 1; i++) w[i] = i < s->rows ? y[s->row[i]] : 0;
  for (int32_t i = 0; i < s->rows && sides > 1; i += LANES) {
    quad v[LANES] = {{0}};
    for (int32_t l = 0; l < LANES && i + l < s->rows; l++)
      v[l] = load_quad(y + LANES * (size_t)s->row[i + l]);
    transpose(v);
    for (int c = 0; c < sides; c++) store_quad(w + (size_t)c * apart + i, v[c]);
  }
}

/* the first `count` rows of y = w */
INLINE void scatter_rows(const supernode *s, int32_t count, const double *w, size_t apart,
                         double *y, int sides) {
  for (int32_t i = 0; i < count && sides == 1; i++) y[s->row[i]] = w[i];
  for (int32_t i = 0; i < count && sides > 1; i += LANES) {
    quad v[LANES] = {{0}};
    for (int c = 0; c < sides; c++) v[c] = load_quad(w + (size_t)c * apart + i);
    transpose(v);
    for (int32_t l = 0; l < LANES && i + l < count; l++)
      store_quad(y + LANES * (size_t)s->row[i + l], v[l]);
  }
}

/* U y' = y */
INLINE void panels_forward(const panels *p, int sides) {
  const double *P = p->value;
  for (size_t k = 0; k < p->factor->nsuper; k++) {
    const supernode s = supernode_at(p->factor, k);
    const size_t apart = LANES * quads_from(&s, 0);
    gather_rows(&s, p->y, p->w, apart, sides);
    for (int32_t j = 0; j < s.width; P += panel_size(&s, j), j += LANES)
      by_panel(&s, j, P, 0, p->w, apart, sides);
    scatter_rows(&s, s.rows, p->w, apart, p->y, sides);
  }
}

/* U' y' = y; end: of the values */
INLINE void panels_backward(const panels *p, const double *end, int sides) {
  const double *P = end;
  for (size_t k = p->factor->nsuper; k-- > 0;) {
    const supernode s = supernode_at(p->factor, k);
    const size_t apart = LANES * quads_from(&s, 0);
    gather_rows(&s, p->y, p->w, apart, sides);
    for (int32_t j = (s.width - 1) / LANES * LANES; j >= 0; j -= LANES) {
      P -= panel_size(&s, j);
      by_panel(&s, j, P, 1, p->w, apart, sides);
    }
    scatter_rows(&s, s.width, p->w, apart, p->y, sides);
  }
}

/* U D U' x = b */
INLINE void solve_by_panels(const panels *p, const double *b, double *x, int sides) {
  const size_t n = p->factor->n, width = sides == 1 ? 1 : LANES;
  for (size_t i = 0; i < n; i++)
    for (size_t c = 0; c < width; c++) p->y[width * i + c] = c < (size_t)sides ? b[c * n + i] : 0;
  panels_forward(p, sides);
  for (size_t i = 0; i < n; i++)
    for (size_t c = 0; c < width; c++) p->y[width * i + c] *= p->inverse_d[i];
  panels_backward(p, p->value + panels_size(p->factor), sides);
  for (size_t i = 0; i < n; i++)
    for (size_t c = 0; c < (size_t)sides; c++) x[c * n + i] = p->y[width * i + c];
}

INLINE void solve_up_to_3(const panels *p, const double *b, double *x, int sides) {
  if (sides == 1) solve_by_panels(p, b, x, 1);
  else if (sides == 2) solve_by_panels(p, b, x, 2);
  else solve_by_panels(p, b, x, 3);
}

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
/* Products and sums are rounded once here. */
__attribute__((target("avx2,fma"), optimize("fp-contract=fast"))) static void solve_fused(
    const panels *p, const double *b, double *x, int sides) {
  solve_up_to_3(p, b, x, sides);
}

static int is_fused(void) {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}
#else
#  define solve_fused solve_up_to_3
static int is_fused(void) { return 0; }
#endif

/* x = (L L')^-1 b for 1 to 3 right sides, n apart. */
static void panels_solve(const panels *p, const double *b, double *x, int sides) {
  if (is_fused()) solve_fused(p, b, x, sides);
  else solve_up_to_3(p, b, x, sides);
}

#endif
