#include "contact/surface_tree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct middle {
  double x[3]; /* times the number of corners, 3 */
  double key;
  int32_t element;
} middle;

/* Elements [begin, end) of the list become the subtree from node on. */
typedef struct subtree {
  int32_t begin, end, node;
} subtree;

static int compare_keys(const void *a, const void *b) {
  const middle *p = a, *q = b;
  if (p->key != q->key) return p->key > q->key ? 1 : -1;
  return (p->element > q->element) - (p->element < q->element);
}

/* Sort by the coordinate in which the middles extend farthest. */
static void sort_along_longest_axis(middle *first, int32_t n) {
  double low[3], high[3];
  int longest = 0;
  memcpy(low, first->x, sizeof low), memcpy(high, first->x, sizeof high);
  for (int32_t i = 1; i < n; i++)
    for (int c = 0; c < 3; c++)
      low[c] = fmin(low[c], first[i].x[c]), high[c] = fmax(high[c], first[i].x[c]);
  for (int c = 1; c < 3; c++)
    if (high[c] - low[c] > high[longest] - low[longest]) longest = c;
  for (int32_t i = 0; i < n; i++) first[i].key = first[i].x[longest];
  qsort(first, (size_t)n, sizeof *first, compare_keys);
}

static void build(ms_surface_tree *t, middle *list, int32_t n) {
  subtree stack[64] = {{0, n, 0}}; /* one half waits for each level */
  for (int waiting = 1; waiting;) {
    const subtree s = stack[--waiting];
    const int32_t size = s.end - s.begin, half = size / 2;
    t->end[s.node] = s.node + 2 * size - 1;
    t->element[s.node] = size == 1 ? list[s.begin].element : -1;
    if (size == 1) {
      t->leaf[list[s.begin].element] = s.node;
      continue;
    }
    sort_along_longest_axis(list + s.begin, size);
    stack[waiting++] = (subtree){s.begin + half, s.end, s.node + 2 * half};
    stack[waiting++] = (subtree){s.begin, s.begin + half, s.node + 1};
  }
}

msim_status ms_surface_tree_create(const ms_scene *scene, const ms_contact_surface *surface,
                                   ms_surface_tree *tree, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const int32_t n = surface->nelements;
  middle *list = NULL;
  *tree = (ms_surface_tree){.nnodes = n > 0 ? 2 * n - 1 : 0};
  const int fits = MS_NEW(alloc, tree->end, tree->nnodes) &&
                   MS_NEW(alloc, tree->element, tree->nnodes) && MS_NEW(alloc, tree->leaf, n) &&
                   MS_NEW(alloc, tree->box, tree->nnodes) && MS_NEW(alloc, list, n);
  for (int32_t i = 0; i < n && fits; i++) {
    list[i].element = i;
    for (int c = 0; c < 3; c++)
      for (int axis = 0; axis < 3; axis++)
        list[i].x[axis] += surface->x_rest[3 * (size_t)surface->corner[i][c] + (size_t)axis];
  }
  if (fits && n > 0) build(tree, list, n);
  ms_memory_free(alloc, list);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the tree of the surface");
}

void ms_surface_tree_destroy(const ms_scene *scene, ms_surface_tree *tree) {
  MS_FREE(&scene->alloc, tree->end, tree->element, tree->leaf, tree->box);
}

void ms_surface_tree_update(ms_surface_tree *t) {
  for (int32_t k = t->nnodes - 1; k >= 0; k--) {
    if (t->element[k] >= 0) continue;
    const ms_box *left = &t->box[k + 1], *right = &t->box[t->end[k + 1]];
    for (int c = 0; c < 3; c++) {
      const double *low = &left->low[c], *high = &left->high[c];
      t->box[k].low[c] = *low < right->low[c] ? *low : right->low[c];
      t->box[k].high[c] = *high > right->high[c] ? *high : right->high[c];
    }
  }
}

static int overlap(const ms_box *a, const ms_box *b) {
  return a->low[0] <= b->high[0] && b->low[0] <= a->high[0] && a->low[1] <= b->high[1] &&
         b->low[1] <= a->high[1] && a->low[2] <= b->high[2] && b->low[2] <= a->high[2];
}

int32_t ms_surface_tree_next(const ms_surface_tree *t, int32_t element, int32_t *node) {
  const int32_t leaf = t->leaf[element];
  const ms_box *box = &t->box[leaf];
  for (int32_t k = *node; k < t->nnodes;) {
    if (t->end[k] <= leaf + 1 || !overlap(box, &t->box[k])) k = t->end[k];
    else if (t->element[k] < 0) k++;
    else {
      *node = k + 1;
      return t->element[k];
    }
  }
  return -1;
}
