#include "scene/mesh_topology.h"

#include <math.h>
#include <string.h>

#include "base/buckets.h"
#include "base/vec3.h"
#include "scene/mesh_merge.h"

/* Sort n rows of `width` keys, below nkeys, lexicographically and stably: order[i] becomes the i-th
 * row. A counting sort by each key, from the last to the first. */
static int sort_rows(const msim_allocator *alloc, int32_t n, int width, const int32_t *keys,
                     int32_t nkeys, int32_t *order) {
  int32_t *to, *before;
  int ok = MS_NEW(alloc, to, n) && 1;
  ok = MS_NEW(alloc, before, n) && ok;
  for (int32_t i = 0; i < n && ok; i++) order[i] = i;
  for (int p = width - 1; p >= 0 && ok; p--) {
    ms_buckets sorted;
    for (int32_t i = 0; i < n; i++)
      to[i] = keys[(size_t)width * (size_t)order[i] + (size_t)p], before[i] = order[i];
    ok = ms_buckets_create(alloc, n, to, nkeys, &sorted);
    for (int32_t i = 0; i < n && ok; i++) order[i] = before[sorted.item[i]];
    ms_buckets_destroy(alloc, &sorted);
  }
  MS_FREE(alloc, to, before);
  return ok;
}

/*------------------------------------- faces ----------------------------------------------------*/

/* Corners become representatives; faces with two equal ones are left out. */
static void drop_degenerate(ms_surface *s, int32_t nfaces, const int32_t *faces,
                            const int32_t *representative) {
  for (int32_t f = 0; f < nfaces; f++) {
    int32_t *to = s->corners + 3 * (size_t)s->nfaces;
    for (size_t c = 0; c < 3; c++) to[c] = representative[faces[3 * (size_t)f + c]];
    if (to[0] == to[1] || to[1] == to[2] || to[2] == to[0]) s->repairs.degenerate_faces++;
    else s->nfaces++;
  }
}

static void sort_corners(const int32_t *corners, int32_t key[3]) {
  memcpy(key, corners, 3 * sizeof *key);
  for (int i = 0; i < 3; i++)
    if (key[i % 2] > key[i % 2 + 1]) {
      const int32_t larger = key[i % 2];
      key[i % 2] = key[i % 2 + 1];
      key[i % 2 + 1] = larger;
    }
}

/* Of faces with the same corners, in any order, the first one stays. */
static int drop_duplicates(const msim_allocator *alloc, int32_t n, ms_surface *s) {
  int32_t *keys, *order = NULL, nkept = 0;
  uint8_t *is_duplicate = NULL;
  int ok = MS_NEW(alloc, keys, 3 * (size_t)s->nfaces) && MS_NEW(alloc, order, s->nfaces) &&
           MS_NEW(alloc, is_duplicate, s->nfaces);
  for (size_t f = 0; f < (size_t)s->nfaces && ok; f++)
    sort_corners(s->corners + 3 * f, keys + 3 * f);
  ok = ok && sort_rows(alloc, s->nfaces, 3, keys, n, order);
  for (int32_t i = 1; i < s->nfaces && ok; i++)
    is_duplicate[order[i]] =
        memcmp(keys + 3 * (size_t)order[i], keys + 3 * (size_t)order[i - 1], 3 * sizeof *keys) == 0;
  for (int32_t f = 0; f < s->nfaces && ok; f++)
    if (!is_duplicate[f])
      memmove(s->corners + 3 * (size_t)nkept++, s->corners + 3 * (size_t)f, 3 * sizeof *s->corners);
  s->repairs.duplicate_faces = s->nfaces - nkept;
  s->nfaces = nkept;
  MS_FREE(alloc, keys, order, is_duplicate);
  return ok;
}

/* Count faces whose height over their longest edge is at most the tolerance, which is the unit of
 * length here. */
static void count_flat(ms_surface *s, double tolerance) {
  for (size_t f = 0; f < (size_t)s->nfaces; f++) {
    double edge[3][3], normal[3], longest = 0;
    for (size_t c = 0; c < 3; c++) {
      const double *a = s->x + 3 * (size_t)s->corners[3 * f + c],
                   *b = s->x + 3 * (size_t)s->corners[3 * f + (c + 1) % 3];
      for (size_t d = 0; d < 3; d++) edge[c][d] = (b[d] - a[d]) / tolerance;
      longest = fmax(longest, ms_vec3_norm(edge[c]));
    }
    for (int c = 0; c < 3; c++) {
      const int d = (c + 1) % 3, e = (c + 2) % 3;
      normal[c] = edge[0][d] * edge[1][e] - edge[0][e] * edge[1][d];
    }
    s->repairs.flat_faces += ms_vec3_norm(normal) <= longest;
  }
}

/*------------------------------------- vertices -------------------------------------------------*/

/* representative[v] = 0 of each vertex that a face uses, -1 of all others */
static void mark_used(int32_t n, int32_t nfaces, const int32_t *faces, int32_t *representative) {
  for (int32_t v = 0; v < n; v++) representative[v] = -1;
  for (size_t i = 0; i < 3 * (size_t)nfaces; i++) representative[faces[i]] = 0;
}

/* Keep the vertices that the faces still use, in their order. number: n, scratch */
static int keep_vertices(const msim_allocator *alloc, int32_t n, const double *x, int32_t *number,
                         ms_surface *s) {
  mark_used(n, s->nfaces, s->corners, number);
  for (int32_t v = 0; v < n; v++)
    if (number[v] == 0) number[v] = s->nvertices++;
  if (!MS_NEW(alloc, s->x, 3 * (size_t)s->nvertices)) return 0;
  for (int32_t v = 0; v < n; v++)
    if (number[v] >= 0) memcpy(s->x + 3 * (size_t)number[v], x + 3 * (size_t)v, 3 * sizeof *x);
  for (size_t i = 0; i < 3 * (size_t)s->nfaces; i++) s->corners[i] = number[s->corners[i]];
  s->repairs.unused_vertices =
      n - s->nvertices - s->repairs.equal_vertices - s->repairs.near_vertices;
  return 1;
}

/*------------------------------------- edges ----------------------------------------------------*/

/* A new edge begins at each half-edge whose ends are not those of the one before it in order. */
static void count_edges(ms_surface *s, const int32_t *ends, const int32_t *order) {
  const int32_t n = 3 * s->nfaces;
  for (int32_t i = 0; i < n; i++) {
    const int32_t *now = ends + 2 * (size_t)order[i];
    s->half[i] = order[i];
    if (i > 0 && memcmp(now, ends + 2 * (size_t)order[i - 1], 2 * sizeof *ends) == 0) continue;
    memcpy(s->ij + 2 * (size_t)s->nedges, now, 2 * sizeof *ends);
    s->first[s->nedges++] = i;
  }
  s->first[s->nedges] = n;
  for (int32_t e = 0; e < s->nedges; e++) {
    const int32_t count = s->first[e + 1] - s->first[e];
    s->repairs.open_edges += count == 1;
    s->repairs.nonmanifold_edges += count > 2;
  }
}

static int list_edges(const msim_allocator *alloc, ms_surface *s) {
  const size_t n = 3 * (size_t)s->nfaces;
  int32_t *ends, *order = NULL;
  int ok = MS_NEW(alloc, ends, 2 * n) && MS_NEW(alloc, order, n) && MS_NEW(alloc, s->half, n) &&
           MS_NEW(alloc, s->ij, 2 * n) && MS_NEW(alloc, s->first, n + 1);
  for (size_t h = 0; h < n && ok; h++) {
    const int32_t a = s->corners[h], b = s->corners[h / 3 * 3 + (h + 1) % 3];
    ends[2 * h] = a < b ? a : b, ends[2 * h + 1] = a < b ? b : a;
  }
  ok = ok && sort_rows(alloc, (int32_t)n, 2, ends, s->nvertices, order);
  if (ok) count_edges(s, ends, order);
  MS_FREE(alloc, ends, order);
  return ok;
}

/*------------------------------------- orientation ----------------------------------------------*/

/* A part of the surface that edges of two faces connect */
typedef struct orientation {
  int32_t *edge;  /* 3 nfaces: of each half-edge */
  int8_t *turned; /* nfaces: -1: not visited, 1: against the first face of its part */
  int32_t *faces; /* nfaces: those of the present part, in the order of the visits */
} orientation;

/* Visit the part of a face; neighbours have the same orientation if they run through their common
 * edge in opposite directions. Returns the number of its faces, and of those that are turned. */
static int32_t visit_part(const ms_surface *s, orientation *o, int32_t face, int32_t *nturned) {
  int32_t n = 0;
  *nturned = 0;
  o->turned[face] = 0;
  o->faces[n++] = face;
  for (int32_t i = 0; i < n; i++)
    for (int32_t h = 3 * o->faces[i]; h < 3 * o->faces[i] + 3; h++) {
      const int32_t *pair = s->half + s->first[o->edge[h]];
      if (s->first[o->edge[h] + 1] - s->first[o->edge[h]] != 2) continue;
      const int32_t other = pair[0] == h ? pair[1] : pair[0];
      if (o->turned[other / 3] >= 0) continue;
      const int same = ms_surface_ascends(s, h) != ms_surface_ascends(s, other);
      o->turned[other / 3] = (int8_t)(same ? o->turned[h / 3] : !o->turned[h / 3]);
      *nturned += o->turned[other / 3];
      o->faces[n++] = other / 3;
    }
  return n;
}

/* The half-edges of a turned face change their places with its corners 1 and 2. */
static void turn_faces(ms_surface *s, const orientation *o) {
  for (size_t f = 0; f < (size_t)s->nfaces; f++) {
    int32_t *corner = s->corners + 3 * f;
    const int32_t second = corner[1];
    if (!o->turned[f]) continue;
    corner[1] = corner[2], corner[2] = second;
    s->repairs.turned_faces++;
  }
  for (size_t i = 0; i < 3 * (size_t)s->nfaces; i++)
    if (o->turned[s->half[i] / 3]) s->half[i] = s->half[i] / 3 * 3 + 2 - s->half[i] % 3;
}

static int orient_faces(const msim_allocator *alloc, ms_surface *s) {
  orientation o = {0};
  const int ok = MS_NEW(alloc, o.edge, 3 * (size_t)s->nfaces) &&
                 MS_NEW(alloc, o.turned, s->nfaces) && MS_NEW(alloc, o.faces, s->nfaces);
  for (int32_t e = 0; e < s->nedges && ok; e++)
    for (int32_t i = s->first[e]; i < s->first[e + 1]; i++) o.edge[s->half[i]] = e;
  if (ok) memset(o.turned, -1, (size_t)s->nfaces);
  for (int32_t f = 0; f < s->nfaces && ok; f++) {
    if (o.turned[f] >= 0) continue;
    int32_t nturned;
    const int32_t n = visit_part(s, &o, f, &nturned);
    for (int32_t i = 0; i < n && nturned > n - nturned; i++)
      o.turned[o.faces[i]] = !o.turned[o.faces[i]];
  }
  if (ok) turn_faces(s, &o);
  MS_FREE(alloc, o.edge, o.turned, o.faces);
  return ok;
}

/*------------------------------------- the whole ------------------------------------------------*/

int ms_surface_create(const msim_allocator *alloc, int32_t n, const double *x, int32_t nfaces,
                      const int32_t *faces, ms_surface *s) {
  int32_t *representative;
  double tolerance;
  *s = (ms_surface){0};
  int ok = MS_NEW(alloc, representative, n) && MS_NEW(alloc, s->corners, 3 * (size_t)nfaces);
  if (ok) mark_used(n, nfaces, faces, representative);
  ok = ok && ms_mesh_merge(alloc, n, x, representative, &tolerance, &s->repairs);
  if (ok) drop_degenerate(s, nfaces, faces, representative);
  ok = ok && drop_duplicates(alloc, n, s) && keep_vertices(alloc, n, x, representative, s) &&
       list_edges(alloc, s) && orient_faces(alloc, s);
  if (ok) count_flat(s, tolerance);
  ms_memory_free(alloc, representative);
  return ok;
}

void ms_surface_destroy(const msim_allocator *alloc, ms_surface *s) {
  MS_FREE(alloc, s->x, s->corners, s->ij, s->first, s->half);
}
