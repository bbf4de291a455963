#include "sim/rank_load.h"

#include <string.h>

#include "base/archive.h"
#include "methods/methods.h"
#include "scene/scene_data.h"
#include "sim/rank_distribute.h"
#include "sim/rank_gather.h"
#include "sim/rank_rest.h"
#include "sim/rank_sim.h"

/*------------------------------------- checks ---------------------------------------------------*/

/* 1: something was added that refers to particles, of which the handle has none. */
static int has_additions(const ms_scene *s, const ms_scene *rows) {
  return s->nparticles || !s->force != !rows->force || s->nlaws || s->nmotions ||
         ms_scene_has_function(s);
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
  if (!has_additions(scene->data, part->rows)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "particles, laws, forces and motions cannot be added to a part of a "
                      "scene; load the whole scene by msim_scene_load");
}

/* What ranks must have in common to gather parts; 0: the whole scene */
static uint64_t hash_part(const ms_scene_part *part) {
  if (!part) return 0;
  const int32_t counts[] = {part->nparticles, part->nsprings, part->nfaces,
                            part->rows->force != NULL, part->lacks_rest};
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
  ms_rank_scene *parts = ms_rank_scene_create_from(part);
  ms_scene *s = *whole =
      ms_scene_data_create_like(scene->data, part->nparticles, part->nsprings, part->nfaces, NULL);
  msim_status status = ms_ranks_agree_on_memory(ranks, parts && s, "the whole scene", err);
  if (!status) status = ms_rank_gather_fields(ranks, parts, MS_ALL_RANKS, s, 1, err);
  ms_rank_scene_destroy(alloc, parts);
  return status;
}

/*------------------------------------- parts ----------------------------------------------------*/

/* 1: the scene shares nothing with its part that has changed since it was loaded. */
static int is_as_loaded(const ms_scene *s, const ms_scene *rows) {
  return memcmp(&s->external, &rows->external, sizeof s->external) == 0 &&
         s->nplanes == rows->nplanes && s->ncolliders == rows->ncolliders &&
         s->self_contact.thickness == rows->self_contact.thickness &&
         strcmp(s->name, rows->name) == 0 &&
         ms_rank_sim_hash_obstacles(0, s) == ms_rank_sim_hash_obstacles(0, rows);
}

/* Methods for forces of positions only refuse the first spring that is damped. */
static int is_damped(const ms_scene *rows) {
  for (int32_t e = 0; e < rows->nsprings; e++)
    if (rows->damping[e] > 0) return 1;
  return 0;
}

static int is_separable(const msim_options *opt) {
  const ms_integrator *method;
  return opt->integrator && !ms_methods_find(opt->integrator, &method, NULL) && method->separable;
}

/* The same on all ranks; each has free particles then. */
static int distributes(const msim_scene *scene, const msim_options *opt, ms_ranks *ranks) {
  const ms_scene *rows = scene->part->rows;
  double sums[2] = {0}; /* ranks that do not, and free particles */
  sums[0] = !is_as_loaded(scene->data, rows) || (is_separable(opt) && is_damped(rows));
  for (int32_t p = 0; p < rows->nparticles; p++) sums[1] += !rows->pinned[p];
  ms_ranks_sum(ranks, 2, sums);
  return sums[0] == 0 && sums[1] >= ranks->n;
}

msim_status ms_rank_load_scene(const msim_scene *scene, const msim_options *opt, ms_ranks *ranks,
                               ms_rank_load *load, msim_error *err) {
  *load = (ms_rank_load){0};
  msim_status status = ms_ranks_agree(ranks, check_part(scene, ranks, err), err);
  if (!status) status = compare_parts(scene, ranks, err);
  if (status) return status;
  if (!scene->part) {
    load->scene = ms_scene_retain(scene->data);
    return MSIM_OK;
  }
  if (scene->part->lacks_rest) status = ms_rank_rest_compute(scene->part, ranks, err);
  const int divides = !status && distributes(scene, opt, ranks);
  status = ms_ranks_agree(ranks, status, err);
  if (status) return status;
  const int islands = !(opt->skip_off & MSIM_SKIP_ISLANDS);
  return divides ? ms_rank_distribute(scene, ranks, islands, load, err)
                 : gather_parts(scene, ranks, &load->scene, err);
}

void ms_rank_load_destroy(const msim_allocator *alloc, ms_rank_load *load) {
  ms_scene_release(load->scene);
  ms_rank_scene_destroy(alloc, load->kept);
  ms_rank_part_destroy(alloc, load->part);
}
