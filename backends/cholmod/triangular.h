/* triangular - y = (L L')^-1 y by the supernodal factor of CHOLMOD, for few right-hand sides.
 *
 * CHOLMOD calls BLAS for each supernode, whose overhead exceeds the work for few right-hand sides.
 * Here the rows of a supernode are gathered once; its columns are then read in pairs, from first to
 * last, for all right-hand sides at once. The order of summation is the same with all register
 * widths. */
#ifndef MSIM_CHOLMOD_TRIANGULAR_H
#define MSIM_CHOLMOD_TRIANGULAR_H

#include <string.h>

#include "supernode.h"

typedef double lanes __attribute__((vector_size(8 * LANES)));

/* Also compiled for wider registers; the CPU decides when the plugin is loaded. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__linux__)
#  define FOR_EACH_CPU __attribute__((target_clones("avx2", "default")))
#else
#  define FOR_EACH_CPU
#endif

INLINE void load_lanes(lanes *to, const double *from) { memcpy(to, from, sizeof *to); }

/* w_i -= sum over the `columns` columns j, j + 1 of L_ij w_j, for the rows i below them */
INLINE void subtract_columns(const supernode *s, int32_t j, int columns, sides w) {
  const int32_t rows = s->rows;
  const double *L = s->value + (size_t)j * (size_t)rows;
  double solved[2][MAX_SIDES];
  for (int q = 0; q < columns; q++)
    for (int c = 0; c < w.count; c++) solved[q][c] = side(w, c)[j + q];
  int32_t i = j + columns;
  for (; i < s->end; i += LANES) {
    lanes first, second, rest;
    load_lanes(&first, L + i);
    if (columns == 2) load_lanes(&second, L + rows + i);
    for (int c = 0; c < w.count; c++) {
      double *wi = side(w, c) + i;
      load_lanes(&rest, wi);
      rest -= first * solved[0][c];
      if (columns == 2) rest -= second * solved[1][c];
      memcpy(wi, &rest, sizeof rest);
    }
  }
  for (; i < rows; i++)
    for (int c = 0; c < w.count; c++)
      for (int q = 0; q < columns; q++) side(w, c)[i] -= L[q * rows + i] * solved[q][c];
}

/* forward substitution, L w' = w, for column j and, if columns = 2, column j + 1 */
INLINE void forward_columns(const supernode *s, int32_t j, int columns, sides w) {
  const int32_t rows = s->rows;
  const double *L = s->value + (size_t)j * (size_t)rows;
  for (int c = 0; c < w.count; c++) {
    double *wc = side(w, c);
    wc[j] /= L[j];
    if (columns == 2) wc[j + 1] = (wc[j + 1] - L[j + 1] * wc[j]) / L[rows + j + 1];
  }
  subtract_columns(s, j, columns, w);
}

/* backward substitution, L' w' = w, for the same columns */
INLINE void backward_columns(const supernode *s, int32_t j, int columns, sides w) {
  const int32_t rows = s->rows;
  const double *L = s->value + (size_t)j * (size_t)rows;
  lanes sum[2][MAX_SIDES] = {{{0}}};
  int32_t i = j + columns;
  for (; i < s->end; i += LANES) {
    lanes first, second, x;
    load_lanes(&first, L + i);
    if (columns == 2) load_lanes(&second, L + rows + i);
    for (int c = 0; c < w.count; c++) {
      load_lanes(&x, side(w, c) + i);
      sum[0][c] += first * x;
      if (columns == 2) sum[1][c] += second * x;
    }
  }
  for (int c = 0; c < w.count; c++) {
    double *wc = side(w, c);
    for (int q = columns - 1; q >= 0; q--) {
      const lanes part = sum[q][c];
      const double *column = L + q * rows;
      double total = (part[0] + part[2]) + (part[1] + part[3]);
      for (int32_t r = i; r < rows; r++) total += column[r] * wc[r];
      if (columns == 2 && q == 0) total += column[j + 1] * wc[j + 1];
      wc[j + q] = (wc[j + q] - total) / column[j + q];
    }
  }
}

/* w = the rows of y of the supernode, and zeros for the last lanes */
INLINE void gather_sides(const supernode *s, sides y, sides w) {
  for (int c = 0; c < w.count; c++) {
    double *wc = side(w, c);
    for (int32_t i = 0; i < s->rows; i++) wc[i] = side(y, c)[s->row[i]];
    for (int32_t i = s->rows; i < s->rows + LANES; i++) wc[i] = 0;
  }
}

/* The first `count` rows of the supernode in y = w */
INLINE void scatter_sides(const supernode *s, int32_t count, sides w, sides y) {
  for (int c = 0; c < w.count; c++)
    for (int32_t i = 0; i < count; i++) side(y, c)[s->row[i]] = side(w, c)[i];
}

/* If the width is odd, the first column is processed alone. */
INLINE void solve_sides(const cholmod_factor *L, sides y, double *work) {
  for (size_t k = 0; k < L->nsuper; k++) {
    const supernode s = supernode_at(L, k);
    const sides w = {work, (size_t)s.rows + LANES, y.count};
    gather_sides(&s, y, w);
    if (s.width % 2) forward_columns(&s, 0, 1, w);
    for (int32_t j = s.width % 2; j < s.width; j += 2) forward_columns(&s, j, 2, w);
    scatter_sides(&s, s.rows, w, y);
  }
  for (size_t k = L->nsuper; k-- > 0;) {
    const supernode s = supernode_at(L, k);
    const sides w = {work, (size_t)s.rows + LANES, y.count};
    gather_sides(&s, y, w);
    for (int32_t j = s.width - 2; j >= 0; j -= 2) backward_columns(&s, j, 2, w);
    if (s.width % 2) backward_columns(&s, 0, 1, w);
    scatter_sides(&s, s.width, w, y);
  }
}

/* y = (L L')^-1 y for 1 to 3 right-hand sides, n apart. work: triangular_work_size(L) doubles. */
FOR_EACH_CPU static void triangular_solve(const cholmod_factor *L, double *y, int count,
                                          double *work) {
  if (count == 1) solve_sides(L, (sides){y, L->n, 1}, work);
  else if (count == 2) solve_sides(L, (sides){y, L->n, 2}, work);
  else solve_sides(L, (sides){y, L->n, 3}, work);
}

static size_t triangular_work_size(const cholmod_factor *L) {
  const int32_t *pi = L->pi;
  int32_t most = 0;
  for (size_t k = 0; k < L->nsuper; k++)
    if (pi[k + 1] - pi[k] > most) most = pi[k + 1] - pi[k];
  return MAX_SIDES * ((size_t)most + LANES);
}

#endif
