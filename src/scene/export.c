#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "scene/import.h"
#include "scene/laws.h"
#include "scene/options.h"

/* A path, and the data of a node that the scene does not store in this form. */
typedef struct node_storage {
  char path[64];
  double real;
  int64_t whole;
} node_storage;

/* The list of n nodes of a scene. */
typedef struct export_state {
  const ms_scene *scene;
  msim_node *nodes;
  node_storage *entries;
  int32_t n;
  int64_t *pinned, *ij, *ijk, *law, *faces, *moving, *counts;
  int32_t nmoving;
} export_state;

/*------------------------------------- nodes ----------------------------------------------------*/

static msim_node *append_node(export_state *e, int32_t kind, int32_t rank, const void *data,
                              const char *format, ...) {
  char *path = e->entries[e->n].path;
  msim_node *node = &e->nodes[e->n++];
  va_list args;
  va_start(args, format);
  vsnprintf(path, sizeof e->entries->path, format, args);
  va_end(args);
  *node = (msim_node){.size = sizeof *node, .path = path, .kind = kind, .rank = rank, .data = data};
  return node;
}

static void append_array(export_state *e, int32_t kind, int64_t rows, int64_t width,
                         const void *data, const char *path) {
  msim_node *node = append_node(e, kind, width > 1 ? 2 : 1, data, "%s", path);
  node->dims[0] = rows;
  node->dims[1] = width;
}

/* One number if all are the same, else an array. */
static void append_repeated(export_state *e, int64_t count, const double *numbers,
                            const char *path) {
  if (ms_scene_all_equal(count, numbers)) append_node(e, MSIM_NODE_REAL, 0, numbers, "%s", path);
  else append_array(e, MSIM_NODE_REAL, count, 1, numbers, path);
}

static void append_text(export_state *e, const char *text, const char *path) {
  if (*text) append_node(e, MSIM_NODE_TEXT, 1, text, "%s", path)->dims[0] = (int64_t)strlen(text);
}

/* A node of its own number: of what a scene does not store as int64_t */
static void append_whole(export_state *e, int64_t value, const char *path) {
  node_storage *own = &e->entries[e->n];
  own->whole = value;
  append_node(e, MSIM_NODE_WHOLE, 0, &own->whole, "%s", path);
}

/*------------------------------------- sections -------------------------------------------------*/

static void export_particles(export_state *e) {
  const ms_scene *s = e->scene;
  const int64_t n = s->nparticles;
  int64_t npinned = 0;
  for (int32_t i = 0; i < s->nparticles; i++)
    if (s->pinned[i]) e->pinned[npinned++] = i;
  append_array(e, MSIM_NODE_REAL, n, 3, s->x, "particles/x");
  if (!ms_scene_all_zero(3 * n, s->v)) append_array(e, MSIM_NODE_REAL, n, 3, s->v, "particles/v");
  append_repeated(e, n, s->mass, "particles/mass");
  if (npinned) append_array(e, MSIM_NODE_WHOLE, npinned, 1, e->pinned, "particles/pinned");
  if (s->force) append_array(e, MSIM_NODE_REAL, n, 3, s->force, "particles/force");
}

static void export_springs(export_state *e) {
  const ms_scene *s = e->scene;
  const int64_t n = s->nsprings;
  if (n == 0) return;
  for (size_t i = 0; i < 2 * (size_t)n; i++) e->ij[i] = s->ij[i];
  append_array(e, MSIM_NODE_WHOLE, n, 2, e->ij, "springs/ij");
  append_repeated(e, n, s->k, "springs/k");
  append_repeated(e, n, s->rest, "springs/rest");
  if (!ms_scene_all_zero(n, s->damping)) append_repeated(e, n, s->damping, "springs/damping");
}

static void export_angles(export_state *e) {
  const ms_scene_angles *g = &e->scene->angles;
  if (g->n == 0) return;
  for (size_t i = 0; i < 3 * (size_t)g->n; i++) e->ijk[i] = g->ijk[i];
  append_array(e, MSIM_NODE_WHOLE, g->n, 3, e->ijk, "angles/ijk");
  append_repeated(e, g->n, g->k, "angles/k");
  append_repeated(e, g->n, g->rest, "angles/rest");
  if (!ms_scene_all_zero(g->n, g->damping)) append_repeated(e, g->n, g->damping, "angles/damping");
}

static void append_list(export_state *e, int32_t law, int32_t n, const double *numbers,
                        const ms_scene_key *key) {
  if (!numbers) return;
  append_node(e, MSIM_NODE_REAL, 1, numbers, "laws/%d/%s", law, key->key)->dims[0] = n;
}

static void append_member(export_state *e, int32_t law, const double *number,
                          const ms_scene_key *key) {
  append_node(e, MSIM_NODE_REAL, 0, number, "laws/%d/%s", law, key->key);
}

/* Law 0 is the linear one: numbers are positions in the list. */
static void export_laws(export_state *e) {
  const ms_scene *s = e->scene;
  for (int32_t i = 0; i <= s->nlaws && s->nlaws; i++) {
    const msim_law *law = i ? &s->laws[i - 1].given : NULL;
    const char *type = ms_laws_kind_name(law ? law->kind : MSIM_LAW_LINEAR);
    append_node(e, MSIM_NODE_TEXT, 1, type, "laws/%d/type", i)->dims[0] = (int64_t)strlen(type);
    if (!law) continue;
    if (law->kind == MSIM_LAW_DEAD_BAND)
      append_member(e, i, &law->half_width, &ms_law_keys[MS_KEY_HALF_WIDTH]);
    if (law->kind == MSIM_LAW_POLYNOMIAL)
      append_member(e, i, &law->limit, &ms_law_keys[MS_KEY_LIMIT]);
    append_list(e, i, law->n, law->coefficients, &ms_law_keys[MS_KEY_COEFFICIENTS]);
    append_list(e, i, law->n, law->stretch, &ms_law_keys[MS_KEY_STRETCH]);
    append_list(e, i, law->n, law->force, &ms_law_keys[MS_KEY_LAW_FORCE]);
    if (law->break_strain > 0)
      append_member(e, i, &law->break_strain, &ms_law_keys[MS_KEY_BREAK_STRAIN]);
    if (law->break_force > 0)
      append_member(e, i, &law->break_force, &ms_law_keys[MS_KEY_BREAK_FORCE]);
  }
  if (!s->law) return;
  for (int32_t i = 0; i < s->nsprings; i++) e->law[i] = s->law[i];
  append_array(e, MSIM_NODE_WHOLE, s->nsprings, 1, e->law, "springs/law");
}

static void export_faces(export_state *e) {
  const int64_t n = e->scene->nfaces;
  if (n == 0) return;
  for (size_t i = 0; i < 3 * (size_t)n; i++) e->faces[i] = e->scene->faces[i];
  append_array(e, MSIM_NODE_WHOLE, n, 3, e->faces, "faces");
}

static void export_planes(export_state *e) {
  for (int32_t i = 0; i < e->scene->nplanes; i++) {
    const msim_plane *p = &e->scene->planes[i];
    append_node(e, MSIM_NODE_REAL, 1, p->normal, "planes/%d/normal", i)->dims[0] = 3;
    append_node(e, MSIM_NODE_REAL, 0, &p->offset, "planes/%d/offset", i);
    append_node(e, MSIM_NODE_REAL, 0, &p->restitution, "planes/%d/restitution", i);
    append_node(e, MSIM_NODE_REAL, 0, &p->friction, "planes/%d/friction", i);
  }
  if (e->scene->planes_constrain) append_whole(e, 1, ms_section_keys[MS_KEY_PLANES_CONSTRAIN].key);
}

static void export_samples(export_state *e, int32_t i) {
  const msim_collider *c = &e->scene->colliders[i];
  const ms_scene_key *count = ms_colliders_get_count_key(c->type);
  if (!count) return;
  for (int32_t k = 0; k < count->count; k++) e->counts[3 * (size_t)i + (size_t)k] = c->n[k];
  append_node(e, MSIM_NODE_WHOLE, 1, e->counts + 3 * (size_t)i, "colliders/%d/%s", i, count->key)
      ->dims[0] = count->count;
  append_node(e, MSIM_NODE_REAL, 1, c->values, "colliders/%d/%s", i,
              ms_colliders_get_values_key(c->type)->key)
      ->dims[0] = (int64_t)ms_colliders_count_values(c);
}

static void export_points(export_state *e, int32_t i, const ms_motion *m, const char *key) {
  if (m->nt == 0) return;
  msim_node *x = append_node(e, MSIM_NODE_REAL, 2, m->x, "colliders/%d/motion/%s", i, key);
  x->dims[0] = m->nt, x->dims[1] = 3;
}

static void export_collider_motion(export_state *e, int32_t i) {
  const ms_collider_motion *m = &e->scene->collider_motions[i];
  const char *word = ms_motion_interpolations[m->x.interpolation];
  if (m->x.nt == 0) return;
  append_node(e, MSIM_NODE_REAL, 1, m->x.t, "colliders/%d/motion/t", i)->dims[0] = m->x.nt;
  export_points(e, i, &m->x, "x");
  export_points(e, i, &m->rotation, "rotation");
  append_node(e, MSIM_NODE_TEXT, 1, word, "colliders/%d/motion/interpolation", i)->dims[0] =
      (int64_t)strlen(word);
}

static void export_collider(export_state *e, int32_t i) {
  const msim_collider *c = &e->scene->colliders[i];
  const char *type = ms_colliders_get_type(c->type)->name;
  node_storage *own;
  append_node(e, MSIM_NODE_TEXT, 1, type, "colliders/%d/type", i)->dims[0] = (int64_t)strlen(type);
  for (int k = 0; k < MS_COLLIDER_MEMBERS; k++) {
    const ms_collider_member *m = &ms_collider_members[k];
    if (!ms_colliders_type_has(c->type, m)) continue;
    append_node(e, MSIM_NODE_REAL, m->key.count > 1, ms_colliders_get_member(c, m),
                "colliders/%d/%s", i, m->key.key)
        ->dims[0] = m->key.count;
  }
  own = &e->entries[e->n];
  own->whole = c->inside;
  append_node(e, MSIM_NODE_WHOLE, 0, &own->whole, "colliders/%d/%s", i, ms_collider_inside_key.key);
  export_samples(e, i);
  export_collider_motion(e, i);
}

static void export_motion(export_state *e, int32_t i) {
  const ms_motion *m = &e->scene->motions[i];
  const char *word = ms_motion_interpolations[m->interpolation];
  append_node(e, MSIM_NODE_WHOLE, 1, e->moving + e->nmoving, "motions/%d/particles", i)->dims[0] =
      m->n;
  for (int32_t k = 0; k < m->n; k++) e->moving[e->nmoving++] = m->particles[k];
  append_node(e, MSIM_NODE_REAL, 1, m->t, "motions/%d/t", i)->dims[0] = m->nt;
  msim_node *x = append_node(e, MSIM_NODE_REAL, 3, m->x, "motions/%d/x", i);
  x->dims[0] = m->nt, x->dims[1] = m->n, x->dims[2] = 3;
  append_node(e, MSIM_NODE_TEXT, 1, word, "motions/%d/interpolation", i)->dims[0] =
      (int64_t)strlen(word);
}

static void export_self_contact(export_state *e) {
  const ms_scene_self_contact *of = &e->scene->self_contact;
  if (!ms_scene_has_self_contact(e->scene)) return;
  append_node(e, MSIM_NODE_REAL, 0, &of->thickness, "self_contact/thickness");
  append_node(e, MSIM_NODE_REAL, 0, &of->friction, "self_contact/friction");
}

static void export_run(export_state *e) {
  for (int32_t i = 0; i < e->scene->nrun; i++) {
    const ms_run_option *run = &e->scene->run[i];
    node_storage *own = &e->entries[e->n];
    char path[64];
    int number;
    const msim_option_entry *option = ms_options_find(run->name, &number);
    snprintf(path, sizeof path, "run/%s", run->name);
    if (!number || ms_options_accepts_word(option, run->value)) append_text(e, run->value, path);
    else if (ms_text_parse_int64(run->value, &own->whole))
      append_node(e, MSIM_NODE_WHOLE, 0, &own->whole, "%s", path);
    else if (ms_text_parse_double(run->value, &own->real))
      append_node(e, MSIM_NODE_REAL, 0, &own->real, "%s", path);
  }
}

/*------------------------------------- the whole ------------------------------------------------*/

static int allocate_nodes(export_state *e) {
  const ms_scene *s = e->scene;
  const size_t most = 24 + 4 * ((size_t)s->nplanes + (size_t)s->nmotions) + 6 * (size_t)s->nlaws +
                      (8 + MS_COLLIDER_MEMBERS) * (size_t)s->ncolliders + (size_t)s->nrun;
  return MS_NEW(&s->alloc, e->nodes, most) && MS_NEW(&s->alloc, e->entries, most) &&
         MS_NEW(&s->alloc, e->pinned, s->nparticles) &&
         MS_NEW(&s->alloc, e->ij, 2 * (size_t)s->nsprings) &&
         MS_NEW(&s->alloc, e->ijk, 3 * (size_t)s->angles.n) &&
         MS_NEW(&s->alloc, e->law, s->law ? s->nsprings : 0) &&
         MS_NEW(&s->alloc, e->counts, 3 * (size_t)s->ncolliders) &&
         MS_NEW(&s->alloc, e->moving, s->nmotions ? s->nparticles : 0) &&
         MS_NEW(&s->alloc, e->faces, 3 * (size_t)s->nfaces);
}

static void export_all(export_state *e) {
  append_whole(e, 1, "msim");
  append_text(e, e->scene->name, "name");
  for (int i = 0; i < MS_SCENE_PARAMETERS; i++) {
    const ms_scene_parameter *p = &ms_scene_parameters[i];
    const double *numbers = ms_scene_get_parameter(e->scene, p);
    if (p->key.count == 1) append_node(e, MSIM_NODE_REAL, 0, numbers, "%s", p->key.key);
    else append_array(e, MSIM_NODE_REAL, p->key.count, 1, numbers, p->key.key);
  }
  export_particles(e);
  export_springs(e);
  export_angles(e);
  export_laws(e);
  export_faces(e);
  export_planes(e);
  for (int32_t i = 0; i < e->scene->ncolliders; i++) export_collider(e, i);
  for (int32_t i = 0; i < e->scene->nmotions; i++) export_motion(e, i);
  export_self_contact(e);
  export_run(e);
}

static msim_status save_tree(export_state *e, const msim_importer *table, const char *path,
                             const char *label, msim_error *err) {
  ms_plugin_host host;
  msim_status status = ms_scene_check_savable(e->scene, err);
  if (status) return status;
  if (!allocate_nodes(e)) return ms_error_set_memory(err, "a scene file");
  export_all(e);
  ms_plugin_init_host(&host, &e->scene->alloc);
  status = table->save(&host.base, path, e->n, e->nodes);
  return status ? ms_plugin_fail(&host, label, status, err) : ms_error_clear(err);
}

msim_status ms_export_scene(const ms_scene *scene, const msim_importer *table, const char *path,
                            const char *label, msim_error *err) {
  export_state e = {.scene = scene};
  const msim_status status = save_tree(&e, table, path, label, err);
  MS_FREE(&scene->alloc, e.nodes, e.entries, e.pinned, e.ij, e.ijk, e.law, e.faces, e.moving,
          e.counts);
  return status;
}
