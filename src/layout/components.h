/* components - connected components of a graph, by union-find (Tarjan 1975)
 *
 * of[p]: an element of p's component with a lower number; p itself if it is the first one, the
 * root. At the start each element is its own root. */
#ifndef MS_COMPONENTS_H
#define MS_COMPONENTS_H

#include "layout/angles.h"

static inline int32_t ms_components_find_root(int32_t *of, int32_t p) {
  while (of[p] != p) p = of[p] = of[of[p]];
  return p;
}

static inline void ms_components_join(int32_t *of, int32_t p, int32_t q) {
  p = ms_components_find_root(of, p), q = ms_components_find_root(of, q);
  if (p < q) of[q] = p;
  else of[p] = q;
}

/* of: out, nfree: the component of each unknown; pinned particles connect nothing. Components are
 * numbered by their first unknowns. Returns their number. */
int32_t ms_components_number(const ms_unknowns *rows, const ms_springs *springs,
                             const ms_angles *angles, int32_t *of);

/* The same of a scene, whose springs connect particles until they break. of: out, nparticles: -1
 * where pinned. Components are numbered by their first particles. */
int32_t ms_components_number_particles(const ms_scene *scene, int32_t *of);

#endif
