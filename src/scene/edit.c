#include "scene/edit.h"

#include <string.h>

#include "base/sized.h"

/*------------------------------------- what stays -----------------------------------------------*/

msim_status ms_edit_read(const msim_edit *edit, msim_edit *full, msim_error *err) {
  const msim_status status =
      ms_sized_check(edit, sizeof *full, MS_SIZE_THROUGH(msim_edit, law), "edit", "edit", err);
  if (!status) ms_sized_read(full, sizeof *full, edit);
  return status;
}

/* to[i] = -1 for the removed ones of n particles or springs */
static msim_status mark_removed(const char *kind, int32_t n, int32_t nremoved,
                                const int32_t *removed, int32_t *to, msim_error *err) {
  if (nremoved < 0 || (nremoved > 0 && !removed))
    return ms_error_set(err, MSIM_ERR_ARG, "removed_%s is NULL, or nremoved_%s is negative", kind,
                        kind);
  for (int32_t i = 0; i < nremoved; i++) {
    if (removed[i] < 0 || removed[i] >= n)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "removed_%s[%d] is %d; there are %d %s, counted from 0", kind, i,
                          removed[i], n, kind);
    to[removed[i]] = -1;
  }
  return MSIM_OK;
}

/* Number those that are not removed. Returns their number. */
static int32_t number_kept(int32_t n, int32_t *to) {
  int32_t kept = 0;
  for (int32_t i = 0; i < n; i++)
    if (to[i] >= 0) to[i] = kept++;
  return kept;
}

msim_status ms_edit_map_create(const ms_scene *s, const msim_edit *edit, ms_edit_map *map,
                               msim_error *err) {
  *map = (ms_edit_map){.nparticles = s->nparticles, .nsprings = s->nsprings};
  if (!MS_NEW(&s->alloc, map->particle, s->nparticles) ||
      !MS_NEW(&s->alloc, map->spring, s->nsprings) || !MS_NEW(&s->alloc, map->angle, s->angles.n))
    return ms_error_set_memory(err, "an edit");
  msim_status status = mark_removed("particles", s->nparticles, edit->nremoved_particles,
                                    edit->removed_particles, map->particle, err);
  if (!status)
    status = mark_removed("springs", s->nsprings, edit->nremoved_springs, edit->removed_springs,
                          map->spring, err);
  if (status) return status;
  for (int32_t e = 0; e < s->nsprings; e++)
    for (int end = 0; end < 2; end++)
      if (map->particle[s->ij[2 * (size_t)e + (size_t)end]] < 0) map->spring[e] = -1;
  for (int32_t e = 0; e < s->angles.n; e++)
    for (int corner = 0; corner < 3; corner++)
      if (map->particle[s->angles.ijk[3 * (size_t)e + (size_t)corner]] < 0) map->angle[e] = -1;
  map->kept_particles = number_kept(s->nparticles, map->particle);
  map->kept_angles = number_kept(s->angles.n, map->angle);
  map->kept_springs = number_kept(s->nsprings, map->spring);
  return MSIM_OK;
}

void ms_edit_map_destroy(const ms_scene *scene, ms_edit_map *map) {
  MS_FREE(&scene->alloc, map->particle, map->spring, map->angle);
}

/*------------------------------------- removal --------------------------------------------------*/

static void remove_motions(ms_scene *s, const ms_edit_map *map) {
  for (int32_t p = 0; p < s->nparticles && s->nmotions; p++)
    if (map->particle[p] < 0) ms_scene_remove_motion(s, p);
  for (int32_t k = 0; k < s->nmotions; k++) {
    const ms_motion *m = &s->motions[k];
    for (int32_t i = 0; i < m->n; i++) m->particles[i] = map->particle[m->particles[i]];
  }
}

static void move_vector(double *array, size_t from, size_t to) {
  memmove(array + 3 * to, array + 3 * from, 3 * sizeof *array);
}

static void remove_particles(ms_scene *s, const ms_edit_map *map) {
  for (size_t p = 0; p < (size_t)s->nparticles; p++) {
    if (map->particle[p] < 0) continue;
    const size_t to = (size_t)map->particle[p];
    move_vector(s->x, p, to), move_vector(s->v, p, to);
    if (s->force) move_vector(s->force, p, to);
    s->mass[to] = s->mass[p], s->pinned[to] = s->pinned[p];
  }
  s->nparticles = map->kept_particles;
}

static void remove_springs(ms_scene *s, const ms_edit_map *map) {
  for (size_t e = 0; e < (size_t)s->nsprings; e++) {
    if (map->spring[e] < 0) continue;
    const size_t to = (size_t)map->spring[e];
    for (size_t end = 0; end < 2; end++) s->ij[2 * to + end] = map->particle[s->ij[2 * e + end]];
    s->k[to] = s->k[e], s->rest[to] = s->rest[e], s->damping[to] = s->damping[e];
    if (s->law) s->law[to] = s->law[e];
    if (s->broken) s->broken[to] = s->broken[e];
  }
  s->nsprings = map->kept_springs;
}

/* Renumber three particles, if all stay; else 0. */
static int map_corners(const ms_edit_map *map, const int32_t from[3], int32_t to[3]) {
  int stay = 1;
  for (int c = 0; c < 3; c++) {
    to[c] = map->particle[from[c]];
    stay &= to[c] >= 0;
  }
  return stay;
}

static void remove_angles(ms_scene *s, const ms_edit_map *map) {
  ms_scene_angles *g = &s->angles;
  for (size_t e = 0; e < (size_t)g->n; e++) {
    if (map->angle[e] < 0) continue;
    const size_t to = (size_t)map->angle[e];
    for (size_t c = 0; c < 3; c++) g->ijk[3 * to + c] = map->particle[g->ijk[3 * e + c]];
    g->k[to] = g->k[e], g->rest[to] = g->rest[e], g->damping[to] = g->damping[e];
  }
  g->n = map->kept_angles;
}

static void remove_faces(ms_scene *s, const ms_edit_map *map) {
  int32_t kept = 0;
  for (size_t i = 0; i < (size_t)s->nfaces; i++) {
    int32_t corner[3];
    if (map_corners(map, s->faces + 3 * i, corner))
      memcpy(s->faces + 3 * (size_t)kept++, corner, sizeof corner);
  }
  s->nfaces = kept;
}

/*------------------------------------- addition -------------------------------------------------*/

/* The particles of n springs to add, `each` of each, as they are numbered after the edit. *to is to
 * be freed. */
static msim_status map_particles(const msim_edit *edit, const ms_edit_map *map, const char *what,
                                 int32_t n, size_t each, const int32_t *from,
                                 const msim_allocator *alloc, int32_t **to, msim_error *err) {
  const int64_t total = (int64_t)map->nparticles + edit->nparticles;
  if (!from) return ms_error_set(err, MSIM_ERR_ARG, "%s is NULL", strchr(what, '.') + 1);
  if (!MS_NEW(alloc, *to, each * (size_t)n)) return ms_error_set_memory(err, "an edit");
  for (size_t i = 0; i < each * (size_t)n; i++) {
    const int32_t p = from[i];
    if (p < 0 || p >= total)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s[%zu] refers to particle %d; with those to add there are %lld "
                          "particles, counted from 0",
                          what, i / each, p, (long long)total);
    (*to)[i] = p < map->nparticles ? map->particle[p] : p - map->nparticles + map->kept_particles;
    if ((*to)[i] < 0)
      return ms_error_set(err, MSIM_ERR_ARG, "%s[%zu] refers to particle %d, which is removed",
                          what, i / each, p);
  }
  return MSIM_OK;
}

static msim_status set_laws(msim_scene *scene, const msim_edit *edit, int32_t first,
                            msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t e = 0; edit->law && e < edit->nsprings && !status; e++)
    status = msim_scene_set_law(scene, 1, &(int32_t){first + e}, edit->law[e], err);
  return status;
}

static msim_status add_springs(msim_scene *scene, const msim_edit *edit, const ms_edit_map *map,
                               msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  int32_t *ij = NULL;
  msim_status status = ms_scene_check_count(edit->nsprings, "springs", err);
  if (status || edit->nsprings == 0) return status;
  status = map_particles(edit, map, "springs.ij", edit->nsprings, 2, edit->ij, &alloc, &ij, err);
  if (!status)
    status =
        msim_scene_add_springs(scene, edit->nsprings, ij, edit->k, edit->rest, edit->damping, err);
  ms_memory_free(&alloc, ij);
  return status ? status : set_laws(scene, edit, map->kept_springs, err);
}

static msim_status add_angles(msim_scene *scene, const msim_edit *edit, const ms_edit_map *map,
                              msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  int32_t *ijk = NULL;
  msim_status status = ms_scene_check_count(edit->nangles, "angles", err);
  if (status || edit->nangles == 0) return status;
  status = map_particles(edit, map, "angles.ijk", edit->nangles, 3, edit->ijk, &alloc, &ijk, err);
  if (!status)
    status = msim_scene_add_angles(scene, edit->nangles, ijk, edit->angle_k, edit->angle_rest,
                                   edit->angle_damping, err);
  ms_memory_free(&alloc, ijk);
  return status;
}

/*------------------------------------- both -----------------------------------------------------*/

msim_status ms_edit_copy(ms_scene *scene, const msim_edit *edit, const ms_edit_map *map,
                         ms_scene **edited, msim_error *err) {
  msim_scene copy = {.data = ms_scene_retain(scene)}; /* shared, and so copied */
  ms_scene *s = ms_scene_make_writable(&copy, err);
  msim_status status = s ? MSIM_OK : MSIM_ERR_MEMORY;
  *edited = NULL;
  if (s) {
    remove_motions(s, map);
    remove_faces(s, map);
    remove_angles(s, map);
    remove_springs(s, map);
    remove_particles(s, map);
    status = msim_scene_add_particles(&copy, edit->nparticles, edit->x, edit->v, edit->mass, err);
  }
  if (!status) status = add_springs(&copy, edit, map, err);
  if (!status) status = add_angles(&copy, edit, map, err);
  if (status) ms_scene_release(copy.data);
  else *edited = copy.data;
  return status;
}

msim_status msim_scene_edit(msim_scene *scene, const msim_edit *edit, msim_error *err) {
  if (!scene || !edit) return ms_error_set(err, MSIM_ERR_ARG, "scene or edit is NULL");
  msim_edit full;
  ms_edit_map map;
  ms_scene *edited;
  msim_status status = ms_edit_read(edit, &full, err);
  if (status) return status;
  status = ms_edit_map_create(scene->data, &full, &map, err);
  if (!status) status = ms_edit_copy(scene->data, &full, &map, &edited, err);
  ms_edit_map_destroy(scene->data, &map);
  if (status) return status;
  ms_scene_release(scene->data);
  scene->data = edited;
  return ms_error_clear(err);
}
