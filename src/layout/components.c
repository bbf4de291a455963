#include "layout/components.h"

#include "scene/laws.h"

int32_t ms_components_number(const ms_unknowns *rows, const ms_springs *springs,
                             const ms_angles *angles, int32_t *of) {
  const int32_t nfree = rows->nfree;
  int32_t n = 0;
  for (int32_t r = 0; r < nfree; r++) of[r] = r;
  for (int32_t e = 0; e < springs->n; e++)
    if (springs->i[e] < nfree && springs->j[e] < nfree)
      ms_disjoint_sets_join(of, springs->i[e], springs->j[e]);
  for (int32_t e = 0; e < angles->n; e++)
    for (int c = 0; c < 3; c++) {
      const int32_t p = angles->row[3 * e + c], q = angles->row[3 * e + (c + 1) % 3];
      if (p < nfree && q < nfree) ms_disjoint_sets_join(of, p, q);
    }
  for (int32_t r = 0; r < nfree; r++) of[r] = ms_disjoint_sets_find_root(of, r);
  for (int32_t r = 0; r < nfree; r++) of[r] = of[r] == r ? n++ : of[of[r]];
  return n;
}

static void join_free(const ms_scene *s, int32_t p, int32_t q, int32_t *of) {
  if (!s->pinned[p] && !s->pinned[q]) ms_disjoint_sets_join(of, p, q);
}

int32_t ms_components_number_particles(const ms_scene *s, int32_t *of) {
  const int32_t *ij = s->ij, *ijk = s->angles.ijk;
  int32_t n = 0;
  for (int32_t p = 0; p < s->nparticles; p++) of[p] = p;
  for (int32_t e = 0; e < s->nsprings; e++, ij += 2)
    if (!ms_scene_is_broken(s, e)) join_free(s, ij[0], ij[1], of);
  for (int32_t e = 0; e < s->angles.n; e++, ijk += 3)
    for (int c = 0; c < 3; c++) join_free(s, ijk[c], ijk[(c + 1) % 3], of);
  for (int32_t p = 0; p < s->nparticles; p++) of[p] = ms_disjoint_sets_find_root(of, p);
  for (int32_t p = 0; p < s->nparticles; p++)
    of[p] = s->pinned[p] ? -1 : of[p] == p ? n++ : of[of[p]];
  return n;
}
