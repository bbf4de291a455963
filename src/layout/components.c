#include "layout/components.h"

int32_t ms_components_number(const ms_unknowns *rows, const ms_springs *springs,
                             const ms_angles *angles, int32_t *of) {
  const int32_t nfree = rows->nfree;
  int32_t n = 0;
  for (int32_t r = 0; r < nfree; r++) of[r] = r;
  for (int32_t e = 0; e < springs->n; e++)
    if (springs->i[e] < nfree && springs->j[e] < nfree)
      ms_components_join(of, springs->i[e], springs->j[e]);
  for (int32_t e = 0; e < angles->n; e++)
    for (int c = 0; c < 3; c++) {
      const int32_t p = angles->row[3 * e + c], q = angles->row[3 * e + (c + 1) % 3];
      if (p < nfree && q < nfree) ms_components_join(of, p, q);
    }
  for (int32_t r = 0; r < nfree; r++) of[r] = ms_components_find_root(of, r);
  for (int32_t r = 0; r < nfree; r++) of[r] = of[r] == r ? n++ : of[of[r]];
  return n;
}
