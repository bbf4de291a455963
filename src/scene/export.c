#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "scene/import.h"
#include "scene/options.h"

/* A path, and the data of a node that the scene does not store in this form. */
typedef struct entry {
  char path[64];
  double real;
  int64_t whole;
} entry;

/* The list of n nodes of a scene. */
typedef struct export {
  const ms_scene *scene;
  msim_node *nodes;
  entry *entries;
  int32_t n;
  int64_t *pinned, *ij;
}
export;

/*------------------------------------- nodes ----------------------------------------------------*/

static msim_node *put(export *e, int32_t kind, int32_t rank, const void *data, const char *format,
                      ...) {
  char *path = e->entries[e->n].path;
  msim_node *node = &e->nodes[e->n++];
  va_list args;
  va_start(args, format);
  vsnprintf(path, sizeof e->entries->path, format, args);
  va_end(args);
  *node = (msim_node){.size = sizeof *node, .path = path, .kind = kind, .rank = rank, .data = data};
  return node;
}

static void put_rows(export *e, int32_t kind, int64_t rows, int64_t width, const void *data,
                     const char *path) {
  msim_node *node = put(e, kind, width > 1 ? 2 : 1, data, "%s", path);
  node->dims[0] = rows;
  node->dims[1] = width;
}

/* One number if all are the same, else an array. */
static void put_each(export *e, int64_t count, const double *numbers, const char *path) {
  if (ms_all_equal(count, numbers)) put(e, MSIM_NODE_REAL, 0, numbers, "%s", path);
  else put_rows(e, MSIM_NODE_REAL, count, 1, numbers, path);
}

static void put_text(export *e, const char *text, const char *path) {
  if (*text) put(e, MSIM_NODE_TEXT, 1, text, "%s", path)->dims[0] = (int64_t)strlen(text);
}

/*------------------------------------- sections -------------------------------------------------*/

static void put_particles(export *e) {
  const ms_scene *s = e->scene;
  const int64_t n = s->nparticles;
  int64_t npinned = 0;
  for (int32_t i = 0; i < s->nparticles; i++)
    if (s->pinned[i]) e->pinned[npinned++] = i;
  put_rows(e, MSIM_NODE_REAL, n, 3, s->x, "particles/x");
  if (!ms_all_zero(3 * n, s->v)) put_rows(e, MSIM_NODE_REAL, n, 3, s->v, "particles/v");
  put_each(e, n, s->mass, "particles/mass");
  if (npinned) put_rows(e, MSIM_NODE_WHOLE, npinned, 1, e->pinned, "particles/pinned");
}

static void put_springs(export *e) {
  const ms_scene *s = e->scene;
  const int64_t n = s->nsprings;
  if (n == 0) return;
  for (size_t i = 0; i < 2 * (size_t)n; i++) e->ij[i] = s->ij[i];
  put_rows(e, MSIM_NODE_WHOLE, n, 2, e->ij, "springs/ij");
  put_each(e, n, s->k, "springs/k");
  put_each(e, n, s->rest, "springs/rest");
  if (!ms_all_zero(n, s->damping)) put_each(e, n, s->damping, "springs/damping");
}

static void put_planes(export *e) {
  for (int32_t i = 0; i < e->scene->nplanes; i++) {
    const msim_plane *p = &e->scene->planes[i];
    put(e, MSIM_NODE_REAL, 1, p->normal, "planes/%d/normal", i)->dims[0] = 3;
    put(e, MSIM_NODE_REAL, 0, &p->offset, "planes/%d/offset", i);
    put(e, MSIM_NODE_REAL, 0, &p->restitution, "planes/%d/restitution", i);
    put(e, MSIM_NODE_REAL, 0, &p->friction, "planes/%d/friction", i);
  }
}

static void put_run(export *e) {
  for (int32_t i = 0; i < e->scene->nrun; i++) {
    const ms_run_entry *run = &e->scene->run[i];
    entry *own = &e->entries[e->n];
    char path[64];
    int number;
    const msim_option_entry *option = ms_option_find(run->name, &number);
    snprintf(path, sizeof path, "run/%s", run->name);
    if (!number || ms_option_is_word(option, run->value)) put_text(e, run->value, path);
    else if (ms_parse_int64(run->value, &own->whole))
      put(e, MSIM_NODE_WHOLE, 0, &own->whole, "%s", path);
    else if (ms_parse_double(run->value, &own->real))
      put(e, MSIM_NODE_REAL, 0, &own->real, "%s", path);
  }
}

/*------------------------------------- the whole ------------------------------------------------*/

static int make_room(export *e) {
  const ms_scene *s = e->scene;
  const size_t most = 16 + 4 * (size_t)s->nplanes + (size_t)s->nrun;
  e->nodes = ms_new(&s->alloc, most, sizeof *e->nodes);
  e->entries = ms_new(&s->alloc, most, sizeof *e->entries);
  e->pinned = ms_new(&s->alloc, (size_t)s->nparticles, sizeof *e->pinned);
  e->ij = ms_new(&s->alloc, (size_t)s->nsprings, 2 * sizeof *e->ij);
  return e->nodes && e->entries && e->pinned && e->ij;
}

static void put_scene(export *e) {
  entry *version = &e->entries[e->n];
  version->whole = 1;
  put(e, MSIM_NODE_WHOLE, 0, &version->whole, "msim");
  put_text(e, e->scene->name, "name");
  put_rows(e, MSIM_NODE_REAL, 3, 1, e->scene->gravity, "gravity");
  put(e, MSIM_NODE_REAL, 0, &e->scene->drag, "drag");
  put_particles(e);
  put_springs(e);
  put_planes(e);
  put_run(e);
}

static msim_status save(export *e, const msim_importer *table, const char *path, const char *label,
                        msim_error *err) {
  ms_host host;
  msim_status status = ms_scene_check_file(e->scene, err);
  if (status) return status;
  if (!make_room(e)) return ms_fail_memory(err, "a scene file");
  put_scene(e);
  ms_host_init(&host, &e->scene->alloc);
  status = table->save(&host.base, path, e->n, e->nodes);
  return status ? ms_host_fail(&host, label, status, err) : ms_ok(err);
}

msim_status ms_scene_export(const ms_scene *scene, const char *name, const char *path,
                            const char *label, msim_error *err) {
  export e = {.scene = scene};
  const msim_importer *table;
  msim_error why;
  ms_text where = {.alloc = &scene->alloc};
  msim_status status = ms_importer_find(name, NULL, &table, &where, &why);
  ms_text_free(&where);
  if (status) return ms_fail(err, status, "%s: %s", label, why.text);
  status = save(&e, table, path, label, err);
  void *rooms[] = {e.nodes, e.entries, e.pinned, e.ij};
  for (int i = 0; i < 4; i++) ms_delete(&scene->alloc, rooms[i]);
  return status;
}
