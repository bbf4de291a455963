/* supernode - access to the supernodes of CHOLMOD's factor L */
#ifndef MSIM_CHOLMOD_SUPERNODE_H
#define MSIM_CHOLMOD_SUPERNODE_H

#include <cholmod.h>
#include <stdint.h>

/* The warning concerns calls with wide vectors, but all such functions are inlined. */
#pragma GCC diagnostic ignored "-Wpsabi"

enum { LANES = 4, MAX_SIDES = 3 }; /* doubles read at once; right-hand sides solved at once */

#define INLINE static inline __attribute__((always_inline))

/* Right-hand sides: `count` vectors, each `apart` numbers after the one before */
typedef struct sides {
  double *at;
  size_t apart;
  int count;
} sides;

INLINE double *side(sides w, int c) { return w.at + (size_t)c * w.apart; }

/* The same vectors without their first i numbers */
INLINE sides sides_from(sides w, size_t i) { return (sides){w.at + i, w.apart, w.count}; }

/* Consecutive columns of L with the same pattern: a lower triangle and full rows below it. Column j
 * starts at value + j rows. Lanes past the end of a column read the next column: the results are
 * ignored, but the memory must exist, so the last supernodes round `end` down. */
typedef struct supernode {
  int32_t width, rows;
  int32_t end;        /* end of the rows that are read in whole lanes: rows, or LANES - 1 less */
  const int32_t *row; /* rows indices, ascending; the first `width` are those of the columns */
  const double *value;
} supernode;

INLINE supernode supernode_at(const cholmod_factor *L, size_t s) {
  const int32_t *super = L->super, *pi = L->pi, *px = L->px;
  const int32_t rows = pi[s + 1] - pi[s];
  const int ends_inside = (size_t)px[s + 1] + LANES <= L->xsize;
  return (supernode){.width = super[s + 1] - super[s],
                     .rows = rows,
                     .end = ends_inside ? rows : rows - LANES + 1,
                     .row = (const int32_t *)L->s + pi[s],
                     .value = (const double *)L->x + px[s]};
}

#endif
