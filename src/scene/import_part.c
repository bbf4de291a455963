#include "scene/import_part.h"

#include <string.h>

#include "scene/scene_data.h"
#include "scene/section.h"

/*------------------------------------- arrays ---------------------------------------------------*/

/* An array that may be divided: n rows of `width` numbers */
typedef struct divided {
  const char *section, *key; /* key NULL: the section is an array itself */
  int is_each;               /* 1: or one number for all rows */
  int64_t width;             /* 1: a list */
} divided;

static const divided of_particles[] = {{"particles", "x", 0, 3},
                                       {"particles", "v", 0, 3},
                                       {"particles", "force", 0, 3},
                                       {"particles", "mass", 1, 1},
                                       {NULL, NULL, 0, 0}};
static const divided of_springs[] = {{"springs", "ij", 0, 2},
                                     {"springs", "k", 1, 1},
                                     {"springs", "rest", 1, 1},
                                     {"springs", "damping", 1, 1},
                                     {NULL, NULL, 0, 0}};
static const divided of_faces[] = {{"faces", NULL, 0, 3}, {NULL, NULL, 0, 0}};

static ms_value root_of(const ms_import_nodes *in) {
  return (ms_value){.json = in->root, .columns = in->columns};
}

static ms_value find_value(ms_value root, const divided *d) {
  const ms_value section = ms_value_member(root, d->section);
  return d->key ? ms_value_member(section, d->key) : section;
}

/* The number of rows of the first array, if it is one of numbers; 0: it is not there; else -1 */
static int64_t count_rows(ms_value root, const divided *d) {
  const ms_value value = find_value(root, d);
  if (!value.json) return 0;
  const ms_column *c = ms_value_column(value);
  return c && c->rank == 2 && c->dims[0] <= INT32_MAX / 3 ? c->dims[0] : -1;
}

static int has_rows(ms_value root, const divided *d, int64_t n) {
  const ms_value value = find_value(root, d);
  const ms_column *c = ms_value_column(value);
  if (!value.json) return 1;
  if (!c || c->rank == 0) return c && d->is_each;
  return c->dims[0] == n && (d->width == 1 ? c->rank == 1 : c->rank == 2 && c->dims[1] == d->width);
}

static int have_rows(ms_value root, const divided *d, int64_t n) {
  for (; d->section; d++)
    if (!has_rows(root, d, n)) return 0;
  return 1;
}

static void limit_rows(ms_value root, const divided *d, int32_t first, int32_t n) {
  for (; d->section; d++) {
    const ms_value value = find_value(root, d);
    ms_column *c = ms_value_column(value);
    if (!c || c->rank == 0) continue;
    c->first = (size_t)first * (size_t)d->width;
    c->dims[0] = n;
  }
}

/*------------------------------------- the scene ------------------------------------------------*/

static int has_member(ms_value root, const char *section, const char *key) {
  return find_value(root, &(divided){section, key, 0, 0}).json != NULL;
}

static int may_be_divided(ms_value root, const ms_scene_part *part) {
  static const int whole[] = {MS_KEY_LAWS, MS_KEY_OBJECTS, MS_KEY_ANGLES, MS_KEY_MOTIONS};
  for (size_t i = 0; i < sizeof whole / sizeof *whole; i++)
    if (has_member(root, ms_section_keys[whole[i]].key, NULL)) return 0;
  if (has_member(root, "springs", "law")) return 0;
  return part->nparticles >= part->nranks && part->nsprings >= 0 && part->nfaces >= 0 &&
         have_rows(root, of_particles, part->nparticles) &&
         have_rows(root, of_springs, part->nsprings) && have_rows(root, of_faces, part->nfaces);
}

int ms_import_part_select(ms_import_nodes *in, ms_scene_part *part) {
  const ms_value root = root_of(in);
  part->nparticles = (int32_t)count_rows(root, of_particles);
  part->nsprings = (int32_t)count_rows(root, of_springs);
  part->nfaces = (int32_t)count_rows(root, of_faces);
  if (!may_be_divided(root, part)) return 0;
  part->lacks_rest = part->nsprings && !has_member(root, "springs", "rest");
  const ms_section section = ms_section_of_part(part);
  limit_rows(root, of_particles, section.first, section.n);
  limit_rows(root, of_springs, section.first_spring, section.nsprings);
  limit_rows(root, of_faces, section.first_face, section.nfaces);
  in->reader.first_particle = section.first, in->reader.nends = part->nparticles;
  return 1;
}

msim_status ms_import_part_detach(msim_scene *scene, const ms_scene_part *part, msim_error *err) {
  ms_scene *rows = scene->data;
  if (!MS_NEW(&rows->alloc, scene->part, 1)) return ms_error_set_memory(err, "a part of the scene");
  ms_scene *shared = ms_scene_data_create_like(rows, 0, 0, 0, err);
  if (!shared) return MSIM_ERR_MEMORY;
  *scene->part = *part, scene->part->rows = rows;
  scene->data = shared;
  return MSIM_OK;
}
