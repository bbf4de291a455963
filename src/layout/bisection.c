#include "layout/bisection.h"

#include <math.h>

/* Particles and the axis along which they are compared */
typedef struct part {
  const double *x;
  int32_t *item;
  int32_t axis;
} part;

static int is_before(const part *p, int32_t i, int32_t j) {
  const double a = p->x[3 * (size_t)i + (size_t)p->axis], b = p->x[3 * (size_t)j + (size_t)p->axis];
  return a != b ? a < b : i < j;
}

static void swap_items(int32_t *a, int32_t *b) {
  const int32_t between = *a;
  *a = *b, *b = between;
}

/* The middle one of three items of the range */
static int32_t choose_pivot(const part *p, int64_t begin, int64_t end) {
  int32_t a = p->item[begin], b = p->item[begin + (end - begin) / 2], c = p->item[end - 1];
  if (is_before(p, b, a)) swap_items(&a, &b);
  if (is_before(p, c, b)) swap_items(&b, &c);
  return is_before(p, b, a) ? a : b;
}

/* Reorder items [begin, end) so that none of the first `n` is behind any other (Hoare's FIND,
 * Commun. ACM 4 (1961) 321). */
static void select_first(const part *p, int64_t begin, int64_t end, int64_t n) {
  const int64_t border = begin + n;
  while (end - begin > 1 && border > begin && border < end) {
    const int32_t pivot = choose_pivot(p, begin, end);
    int64_t i = begin, j = end - 1;
    while (i <= j) {
      while (is_before(p, p->item[i], pivot)) i++;
      while (is_before(p, pivot, p->item[j])) j--;
      if (i <= j) swap_items(&p->item[i++], &p->item[j--]);
    }
    if (border <= j + 1) end = j + 1;
    else begin = i;
  }
}

static int32_t find_longest_axis(const part *p, int64_t begin, int64_t end) {
  double side[3];
  for (size_t c = 0; c < 3; c++) {
    double low = INFINITY, high = -INFINITY;
    for (int64_t k = begin; k < end; k++) {
      const double x = p->x[3 * (size_t)p->item[k] + c];
      low = fmin(low, x), high = fmax(high, x);
    }
    side[c] = high - low;
  }
  return side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
}

/* Items [begin, end) to the ranks from `first` on; the depth of the recursion is log2 nranks. */
static void bisect(part *p, int64_t begin, int64_t end, int32_t first, int32_t nranks,
                   int32_t *owner) {
  const int32_t half = nranks / 2;
  if (half == 0) {
    for (int64_t k = begin; k < end; k++) owner[p->item[k]] = first;
    return;
  }
  const int64_t n = (end - begin) * half / nranks;
  p->axis = find_longest_axis(p, begin, end);
  select_first(p, begin, end, n);
  bisect(p, begin, begin + n, first, half, owner);
  bisect(p, begin + n, end, first + half, nranks - half, owner);
}

void ms_bisection_assign(const ms_scene *scene, int32_t nranks, int32_t *owner, int32_t *scratch) {
  part all = {.x = scene->x, .item = scratch};
  int32_t n = 0;
  for (int32_t p = 0; p < scene->nparticles; p++) {
    owner[p] = MS_NO_OWNER;
    if (!scene->pinned[p]) scratch[n++] = p;
  }
  bisect(&all, 0, n, 0, nranks, owner);
}
