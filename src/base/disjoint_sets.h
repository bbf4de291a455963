/* disjoint_sets - connected components of a graph, by union-find (Tarjan 1975)
 *
 * of[p]: an element of p's component with a lower number; p itself if it is the first one, the
 * root. At the start each element is its own root. */
#ifndef MS_DISJOINT_SETS_H
#define MS_DISJOINT_SETS_H

#include <stdint.h>

static inline int32_t ms_disjoint_sets_find_root(int32_t *of, int32_t p) {
  while (of[p] != p) p = of[p] = of[of[p]];
  return p;
}

static inline void ms_disjoint_sets_join(int32_t *of, int32_t p, int32_t q) {
  p = ms_disjoint_sets_find_root(of, p), q = ms_disjoint_sets_find_root(of, q);
  if (p < q) of[q] = p;
  else of[p] = q;
}

#endif
