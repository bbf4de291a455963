/* supernode - the parts in which CHOLMOD keeps a factor L */
#ifndef MSIM_CHOLMOD_SUPERNODE_H
#define MSIM_CHOLMOD_SUPERNODE_H

#include <cholmod.h>
#include <stdint.h>

/* Wide vectors never leave the functions into which those here are inlined. */
#pragma GCC diagnostic ignored "-Wpsabi"

enum { LANES = 4, MOST_SIDES = 3 }; /* doubles read at once; right sides solved at once */

#define INLINE static inline __attribute__((always_inline))

/* Some columns of L: a lower triangle, and full rows below it. Column j begins at value + j rows.
 * Lanes past the end of a column meet the next one: what they make is not used, but it must be
 * there, so the last supernodes go without. */
typedef struct supernode {
  int32_t width, rows;
  int32_t end;        /* of the rows that are taken in whole lanes: rows, rounded up or down */
  const int32_t *row; /* rows of them, ascending; the first `width` are the columns' own */
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
