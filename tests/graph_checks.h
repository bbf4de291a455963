/* graph_checks - properties of graphs as backends get them: rows of ascending columns */
#ifndef TEST_GRAPH_CHECKS_H
#define TEST_GRAPH_CHECKS_H

#include <stdint.h>

static inline int ascending(int32_t n, const int32_t *ptr, const int32_t *ind) {
  if (ptr[0] != 0) return 0;
  for (int32_t r = 0; r < n; r++) {
    if (ptr[r + 1] < ptr[r]) return 0;
    for (int32_t e = ptr[r]; e < ptr[r + 1]; e++)
      if (ind[e] < 0 || ind[e] >= n || (e > ptr[r] && ind[e] <= ind[e - 1])) return 0;
  }
  return 1;
}

/* The position of the entry (row, column); -1: there is none. */
static inline int32_t find_entry(const int32_t *ptr, const int32_t *ind, int32_t row,
                                 int32_t column) {
  for (int32_t e = ptr[row]; e < ptr[row + 1]; e++)
    if (ind[e] == column) return e;
  return -1;
}

static inline int has_both_triangles(int32_t n, const int32_t *ptr, const int32_t *ind) {
  for (int32_t r = 0; r < n; r++)
    for (int32_t e = ptr[r]; e < ptr[r + 1]; e++)
      if (find_entry(ptr, ind, ind[e], r) < 0) return 0;
  return 1;
}

static inline int is_permutation(int32_t n, const int32_t *perm) {
  int32_t found = 0;
  for (int32_t row = 0; row < n; row++) {
    int32_t k = 0;
    while (k < n && perm[k] != row) k++;
    found += k < n;
  }
  return found == n;
}

static inline int has_diagonal(int32_t n, const int32_t *ptr, const int32_t *ind) {
  for (int32_t r = 0; r < n; r++)
    if (find_entry(ptr, ind, r, r) < 0) return 0;
  return 1;
}

#endif
