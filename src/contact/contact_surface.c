#include "contact/contact_surface.h"

#include <stdlib.h>
#include <string.h>

/*------------------------------------- elements -------------------------------------------------*/

static void count_springs(const ms_scene *s, int32_t *nsprings) {
  for (size_t i = 0; i < 2 * (size_t)s->nsprings; i++) nsprings[s->ij[i]]++;
}

/* node[p] is 1 for the particles of faces. */
static int is_in_rope(const ms_scene *s, const ms_contact_surface *to, const int32_t *nsprings,
                      size_t e) {
  for (size_t end = 0; end < 2; end++) {
    const int32_t p = s->ij[2 * e + end];
    if (!to->node[p] && nsprings[p] <= 2) return 1;
  }
  return 0;
}

static int32_t count_rope_springs(const ms_scene *s, const ms_contact_surface *to,
                                  const int32_t *nsprings) {
  int32_t n = 0;
  for (size_t e = 0; e < (size_t)s->nsprings; e++) n += is_in_rope(s, to, nsprings, e);
  return n;
}

/* Corners are particles at first. */
static void list_elements(const ms_scene *s, const int32_t *nsprings, ms_contact_surface *to) {
  int32_t n = to->nfaces;
  for (size_t i = 0; i < 3 * (size_t)s->nfaces; i++) to->corner[i / 3][i % 3] = s->faces[i];
  for (size_t e = 0; e < (size_t)s->nsprings; e++) {
    if (!is_in_rope(s, to, nsprings, e)) continue;
    to->spring[n - to->nfaces] = (int32_t)e;
    to->corner[n][0] = s->ij[2 * e];
    to->corner[n][1] = to->corner[n][2] = s->ij[2 * e + 1];
    n++;
  }
}

/* Number the particles of elements in the order in which these name them. */
static void number_nodes(ms_contact_surface *to) {
  int32_t n = 0;
  for (int32_t i = 0; i < to->nelements; i++)
    for (int c = 0; c < 3; c++) {
      int32_t *node = &to->node[to->corner[i][c]];
      if (*node == 0) {
        *node = ++n;
        to->owns[i] |= (uint8_t)(1 << c);
      }
      to->corner[i][c] = *node - 1;
    }
  to->nnodes = n;
}

/*------------------------------------- edges ----------------------------------------------------*/

typedef struct edge_use {
  int32_t low, high, element;
  int which;
} edge_use;

static int compare_edges(const void *a, const void *b) {
  const edge_use *p = a, *q = b;
  if (p->low != q->low) return (p->low > q->low) - (p->low < q->low);
  if (p->high != q->high) return (p->high > q->high) - (p->high < q->high);
  return (p->element > q->element) - (p->element < q->element);
}

static msim_status assign_edges(const msim_allocator *alloc, ms_contact_surface *s,
                                msim_error *err) {
  edge_use *edges;
  size_t n = 0;
  if (!MS_NEW(alloc, edges, 3 * (size_t)s->nelements))
    return ms_error_set_memory(err, "the surface");
  for (int32_t i = 0; i < s->nelements; i++)
    for (int e = 0; e < ms_contact_surface_count_edges(s, i); e++) {
      const int32_t a = s->corner[i][e], b = s->corner[i][(e + 1) % 3];
      edges[n++] = (edge_use){a < b ? a : b, a < b ? b : a, i, e};
    }
  qsort(edges, n, sizeof *edges, compare_edges);
  for (size_t i = 0; i < n; i++)
    if (i == 0 || edges[i].low != edges[i - 1].low || edges[i].high != edges[i - 1].high)
      s->owns[edges[i].element] |= (uint8_t)(8 << edges[i].which);
  ms_memory_free(alloc, edges);
  return MSIM_OK;
}

/*------------------------------------- nodes ----------------------------------------------------*/

static void describe_nodes(const ms_model *model, ms_contact_surface *s) {
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t k = 0; k < s->nnodes; k++) s->row[k] = -1;
  for (int32_t p = 0; p < model->scene->nparticles; p++)
    if (s->node[p])
      memcpy(s->x_rest + 3 * (size_t)(s->node[p] - 1), model->scene->x + 3 * (size_t)p,
             3 * sizeof *s->x_rest);
  for (int32_t r = 0; r < rows->nfree; r++) {
    const int32_t k = s->node[rows->particle[r]] - 1;
    if (k >= 0) s->row[k] = r, s->inv_mass[k] = model->inv_mass[r];
  }
}

/* While elements are listed, node[p] is 1 for the particles of faces. nsprings: scratch, 0 */
static msim_status fill_surface(const ms_model *model, int32_t *nsprings, ms_contact_surface *s,
                                msim_error *err) {
  const ms_scene *scene = model->scene;
  const msim_allocator *alloc = &scene->alloc;
  count_springs(scene, nsprings);
  for (size_t i = 0; i < 3 * (size_t)scene->nfaces; i++) s->node[scene->faces[i]] = 1;
  s->nfaces = scene->nfaces;
  s->nelements = s->nfaces + count_rope_springs(scene, s, nsprings);
  if (!MS_NEW(alloc, s->corner, s->nelements) || !MS_NEW(alloc, s->owns, s->nelements) ||
      !MS_NEW(alloc, s->spring, s->nelements - s->nfaces))
    return ms_error_set_memory(err, "the surface");
  list_elements(scene, nsprings, s);
  memset(s->node, 0, (size_t)scene->nparticles * sizeof *s->node);
  number_nodes(s);
  if (!MS_NEW(alloc, s->row, s->nnodes) || !MS_NEW(alloc, s->inv_mass, s->nnodes) ||
      !MS_NEW(alloc, s->x_rest, 3 * (size_t)s->nnodes))
    return ms_error_set_memory(err, "the surface");
  describe_nodes(model, s);
  return assign_edges(alloc, s, err);
}

msim_status ms_contact_surface_create(const ms_model *model, ms_contact_surface *surface,
                                      msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const int32_t n = model->scene->nparticles;
  int32_t *nsprings;
  *surface = (ms_contact_surface){0};
  if (!MS_NEW(alloc, nsprings, n)) return ms_error_set_memory(err, "the surface");
  const msim_status status = MS_NEW(alloc, surface->node, n)
                                 ? fill_surface(model, nsprings, surface, err)
                                 : ms_error_set_memory(err, "the surface");
  ms_memory_free(alloc, nsprings);
  return status;
}

void ms_contact_surface_destroy(const ms_scene *scene, ms_contact_surface *surface) {
  MS_FREE(&scene->alloc, surface->node, surface->row, surface->inv_mass, surface->x_rest,
          surface->corner, surface->owns, surface->spring);
}
