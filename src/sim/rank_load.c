#include "sim/rank_load.h"

#include "base/archive.h"
#include "scene/scene_data.h"
#include "scene/section.h"
#include "sim/rank_gather.h"

/*------------------------------------- checks ---------------------------------------------------*/

/* 1: something was added that refers to particles, of which the handle has none. */
static int has_additions(const ms_scene *s) {
  return s->nparticles || s->nlaws || s->nmotions || ms_scene_has_function(s);
}

static msim_status check_part(const msim_scene *scene, const ms_ranks *ranks, msim_error *err) {
  const ms_scene_part *part = scene->part;
  if (!part) return MSIM_OK;
  const int32_t n = ranks ? ranks->n : 1, rank = ranks ? ranks->rank : 0;
  if (part->nranks != n || part->rank != rank)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the scene is the part of rank %d of %d ranks, but this is rank %d of %d; "
                        "set options.comm to the communicator for which it was loaded",
                        part->rank, part->nranks, rank, n);
  if (!has_additions(scene->data)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "particles, laws, motions and force functions cannot be added to a part of a "
                      "scene; load the whole scene by msim_scene_load");
}

/* What ranks must have in common to gather parts; 0: the whole scene */
static uint64_t hash_part(const ms_scene_part *part) {
  if (!part) return 0;
  const int32_t counts[] = {part->nparticles, part->nsprings, part->nfaces,
                            part->rows->force != NULL};
  return ms_archive_hash(1, counts, sizeof counts);
}

static msim_status compare_parts(const msim_scene *scene, ms_ranks *ranks, msim_error *err) {
  if (!ranks || ms_ranks_have_same(ranks, hash_part(scene->part))) return MSIM_OK;
  if (ranks->failed) return ms_ranks_agree(ranks, MSIM_OK, err);
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the %d ranks have parts of different scenes; load them from the same file",
                      ranks->n);
}

/*------------------------------------- gathering ------------------------------------------------*/

static msim_status gather_parts(const msim_scene *scene, ms_ranks *ranks, ms_scene **whole,
                                msim_error *err) {
  const ms_scene_part *part = scene->part;
  const msim_allocator *alloc = &scene->data->alloc;
  ms_rank_scene *parts =
      ms_rank_scene_create(alloc, ranks->n, part->nparticles, part->nsprings, part->nfaces);
  if (parts) parts->slice = ms_scene_retain(part->rows), parts->is = ms_section_of_part(part);
  ms_scene *s =
      ms_scene_data_create_like(scene->data, part->nparticles, part->nsprings, part->nfaces, NULL);
  int fits = parts && s;
  if (fits && part->rows->force && !s->force)
    fits = MS_NEW(alloc, s->force, 3 * (size_t)part->nparticles) != 0;
  msim_status status =
      ms_ranks_agree(ranks, fits ? MSIM_OK : ms_error_set_memory(err, "the whole scene"), err);
  if (!status)
    status = ms_rank_gather_fields(ranks, parts, MS_ALL_RANKS, MS_MOST_FIELDS, s, 1, err);
  ms_rank_scene_destroy(alloc, parts);
  if (status) ms_scene_release(s);
  else *whole = s;
  return status;
}

msim_status ms_rank_load_scene(const msim_scene *scene, ms_ranks *ranks, ms_scene **whole,
                               msim_error *err) {
  *whole = NULL;
  msim_status status = ms_ranks_agree(ranks, check_part(scene, ranks, err), err);
  if (!status) status = compare_parts(scene, ranks, err);
  if (status) return status;
  if (scene->part) return gather_parts(scene, ranks, whole, err);
  *whole = ms_scene_retain(scene->data);
  return MSIM_OK;
}
