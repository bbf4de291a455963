#include "layout/order.h"

#include <stdlib.h>
#include <string.h>

/*------------------------------------- the present order ----------------------------------------*/

/* The number of neighbours j of a row such that j + 1 is a neighbour of the next row. */
static int32_t count_continued(const ms_adjacency *a, int32_t row) {
  const ms_half_edge *here = a->half_edges + a->first[row],
                     *end = a->half_edges + a->first[row + 1];
  const ms_half_edge *next = end, *next_end = a->half_edges + a->first[row + 2];
  int32_t count = 0;
  while (here < end && next < next_end) {
    const int32_t ahead = next->neighbour - here->neighbour - 1;
    count += ahead == 0;
    here += ahead >= 0;
    next += ahead <= 0;
  }
  return count;
}

/* The neighbours in most entries will be consecutive rows, or nearly so. */
static int is_contiguous(const ms_adjacency *a, int32_t nfree) {
  int64_t continued = 0;
  for (int32_t r = 0; r + 1 < nfree; r++) continued += count_continued(a, r);
  return 2 * continued >= a->first[nfree];
}

/*------------------------------------- breadth-first search -------------------------------------*/

enum { NONE = -1, QUEUED = -2 };

/* Hubs (unknowns with very many springs) are excluded from the breadth-first search: through them
 * all rows would be close to each other. */
typedef struct node {
  int32_t degree;   /* number of springs; NONE: excluded */
  int32_t position; /* in the new order; QUEUED: reached, but not placed yet */
  int32_t second;   /* the place of the second neighbour to be placed */
} node;

typedef struct search {
  const ms_adjacency *a;
  int32_t nfree;
  int32_t *order; /* nfree: the row at each place */
  node *node;     /* stride */
} search;

/* most: the largest number of springs of a row that is not a hub */
static void init_nodes(search *s, int32_t stride, int64_t most) {
  for (int32_t r = 0; r < stride; r++) {
    const int32_t degree = ms_adjacency_degree(s->a, r);
    s->node[r] = (node){r < s->nfree && degree <= most ? degree : NONE, NONE, NONE};
  }
}

/* Place a row, and record this in neighbours for which it is the second. */
static void place_row(search *s, int32_t row, int32_t at) {
  s->order[at] = row;
  s->node[row].position = at;
  for (int32_t e = s->a->first[row]; e < s->a->first[row + 1]; e++) {
    int32_t *second = &s->node[s->a->half_edges[e].neighbour].second;
    if (*second == NONE) *second = INT32_MAX;
    else if (*second == INT32_MAX) *second = at;
  }
}

/* By number of springs, then by `second`, which keeps parallel lines of a grid in the same order */
static int precedes(const search *s, int32_t i, int32_t j) {
  const node *p = &s->node[i], *q = &s->node[j];
  if (p->degree != q->degree) return p->degree < q->degree;
  if (p->second != q->second) return p->second < q->second;
  return i < j;
}

/* Place the other neighbours of a row from `begin` on. Returns their end. */
static int32_t place_neighbours(search *s, int32_t row, int32_t begin) {
  int32_t end = begin;
  for (int32_t e = s->a->first[row]; e < s->a->first[row + 1]; e++) {
    const int32_t j = s->a->half_edges[e].neighbour;
    if (s->node[j].degree == NONE || s->node[j].position != NONE) continue;
    s->node[j].position = QUEUED;
    s->order[end++] = j;
  }
  for (int32_t at = begin; at < end; at++) {
    int32_t best = at;
    for (int32_t k = at + 1; k < end; k++)
      if (precedes(s, s->order[k], s->order[best])) best = k;
    const int32_t chosen = s->order[best];
    s->order[best] = s->order[at];
    place_row(s, chosen, at);
  }
  return end;
}

/* Place the connected component of `start` from `begin` on. Returns its end. */
static int32_t place_component(search *s, int32_t start, int32_t begin) {
  int32_t end = begin + 1;
  place_row(s, start, begin);
  for (int32_t at = begin; at < end; at++) end = place_neighbours(s, s->order[at], end);
  return end;
}

static void clear_places(search *s, int32_t begin, int32_t end) {
  for (int32_t at = begin; at < end; at++) {
    node *p = &s->node[s->order[at]];
    p->position = p->second = NONE;
  }
}

/* Place each connected component from a peripheral row, the last one of a first search. Hubs come
 * last. */
static void order_breadth_first(search *s) {
  int32_t end = 0;
  for (int32_t r = 0; r < s->nfree; r++) {
    if (s->node[r].degree == NONE || s->node[r].position != NONE) continue;
    const int32_t begin = end;
    end = place_component(s, r, begin);
    const int32_t far = s->order[end - 1];
    clear_places(s, begin, end);
    end = place_component(s, far, begin);
  }
  for (int32_t r = 0; r < s->nfree; r++)
    if (s->node[r].degree == NONE) s->order[end++] = r;
}

/* Sums of |row - neighbour| in the present and in the new order. */
static void sum_distances(const search *s, double *before, double *after) {
  *before = *after = 0;
  for (int32_t position = 0; position < s->nfree; position++) {
    const int32_t r = s->order[position];
    if (s->node[r].degree == NONE) continue;
    for (int32_t e = s->a->first[r]; e < s->a->first[r + 1]; e++) {
      const int32_t j = s->a->half_edges[e].neighbour;
      if (s->node[j].degree == NONE) continue;
      *before += abs(r - j);
      *after += abs(position - s->node[j].position);
    }
  }
}

/*------------------------------------- sorting by degree ----------------------------------------*/

/* Entries of all slices but the last, each as many as its longest row has springs */
static int64_t count_padded_entries(const search *s) {
  int64_t slots = 0;
  for (int32_t k = 0, longest = 0; k < s->nfree; k++) {
    if (k % MS_SLICE == 0) slots += longest, longest = 0;
    const int32_t degree = s->node[s->order[k]].degree;
    if (degree > longest) longest = degree;
  }
  return slots;
}

/* Stable sort by descending number of springs, within windows so that neighbours stay near. Returns
 * 1 if this saves at least 5 % of the entries. */
static int sort_windows(search *s) {
  enum { WINDOW = 64 };
  for (int32_t r = 0; r < s->nfree; r++) s->order[r] = r;
  const int64_t before = count_padded_entries(s);
  for (int32_t r = 0; r < s->nfree; r++) {
    int32_t to = r;
    for (; to > r / WINDOW * WINDOW; to--) {
      if (s->node[s->order[to - 1]].degree >= s->node[r].degree) break;
      s->order[to] = s->order[to - 1];
    }
    s->order[to] = r;
  }
  return 20 * count_padded_entries(s) <= 19 * before;
}

/*------------------------------------- renumbering ----------------------------------------------*/

/* Pinned rows follow in the order in which the unknowns refer to them. */
static void number_pinned_rows(const ms_unknowns *rows, const ms_adjacency *a, const int32_t *order,
                               int32_t *new_row) {
  int32_t next = rows->first_pinned;
  for (int32_t r = rows->first_pinned; r < rows->stride; r++) new_row[r] = NONE;
  for (int32_t k = 0; k < rows->nfree; k++)
    for (int32_t e = a->first[order[k]]; e < a->first[order[k] + 1]; e++) {
      const int32_t j = a->half_edges[e].neighbour;
      if (j >= rows->nfree && new_row[j] == NONE) new_row[j] = next++;
    }
  for (int32_t r = rows->first_pinned; r < rows->stride; r++)
    if (new_row[r] == NONE) new_row[r] = next++;
}

static msim_status apply_order(const ms_scene *scene, const int32_t *order, ms_unknowns *rows,
                               ms_springs *springs, ms_adjacency *a, msim_error *err) {
  int32_t *new_row = NULL, *particle = NULL;
  if (!MS_NEW(&scene->alloc, new_row, rows->stride) ||
      !MS_NEW(&scene->alloc, particle, rows->stride)) {
    ms_memory_free(&scene->alloc, new_row);
    return ms_error_set_memory(err, "the numbering of the particles");
  }
  for (int32_t k = 0; k < rows->first_pinned; k++) new_row[k < rows->nfree ? order[k] : k] = k;
  number_pinned_rows(rows, a, order, new_row);
  for (int32_t r = 0; r < rows->stride; r++) particle[new_row[r]] = rows->particle[r];
  ms_memory_free(&scene->alloc, rows->particle);
  rows->particle = particle;
  for (int32_t e = 0; e < springs->n; e++) {
    springs->i[e] = new_row[springs->i[e]];
    springs->j[e] = new_row[springs->j[e]];
  }
  ms_memory_free(&scene->alloc, new_row);
  ms_adjacency_destroy(scene, a);
  return ms_adjacency_create(scene, rows, springs, a, err);
}

static msim_status find_order(const ms_scene *scene, search *s, ms_unknowns *rows,
                              ms_springs *springs, ms_adjacency *a, msim_error *err) {
  const int64_t most = 32 + 8 * (2 * (int64_t)springs->n / rows->nfree);
  double before, after;
  init_nodes(s, rows->stride, most);
  order_breadth_first(s);
  sum_distances(s, &before, &after);
  if (after > 0 && 2 * after <= before) {
    rows->distance_reduction = before / after;
    msim_status status = apply_order(scene, s->order, rows, springs, a, err);
    if (status || is_contiguous(a, rows->nfree)) return status;
    init_nodes(s, rows->stride, most);
  }
  rows->sorted_by_degree = sort_windows(s);
  return rows->sorted_by_degree ? apply_order(scene, s->order, rows, springs, a, err) : MSIM_OK;
}

msim_status ms_order_unknowns(const ms_scene *scene, ms_unknowns *rows, ms_springs *springs,
                              ms_adjacency *a, msim_error *err) {
  if (is_contiguous(a, rows->nfree)) return MSIM_OK;
  search s = {.a = a, .nfree = rows->nfree};
  const int fits =
      MS_NEW(&scene->alloc, s.order, rows->nfree) && MS_NEW(&scene->alloc, s.node, rows->stride);
  msim_status status = fits ? find_order(scene, &s, rows, springs, a, err)
                            : ms_error_set_memory(err, "the numbering of the particles");
  MS_FREE(&scene->alloc, s.order, s.node);
  return status;
}
