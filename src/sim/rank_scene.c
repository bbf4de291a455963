#include "sim/rank_scene.h"

#include "scene/scene_data.h"
#include "sim/rank_section.h"
#include "sim/reuse.h"

/*------------------------------------- division -------------------------------------------------*/

/* Laws, angular springs, motions, force functions and contact sets refer to the whole scene, and
 * arrays of the whole state take more than it. The same on all ranks. */
static int may_divide(const msim_sim *sim) {
  const ms_scene *s = sim->scene;
  return sim->part && !sim->kept && !sim->state_x && !sim->created_from && !sim->edited_from &&
         !sim->chosen_for && s->nlaws == 0 && s->angles.n == 0 && s->nmotions == 0 &&
         !ms_collider_motion_is_there(s) && !ms_scene_has_function(s) &&
         !sim->islands->stepper.events;
}

/* Number those of n whose place is not -1, and list them. Returns 0 without memory. */
static int list_places(const msim_allocator *alloc, int32_t n, int32_t *place, int32_t *count,
                       int32_t **list) {
  *count = 0;
  for (int32_t i = 0; i < n; i++)
    if (place[i] >= 0) place[i] = (*count)++;
  if (!MS_NEW(alloc, *list, *count)) return 0;
  for (int32_t i = 0; i < n; i++)
    if (place[i] >= 0) (*list)[place[i]] = i;
  return 1;
}

static int create_places(const msim_allocator *alloc, int32_t n, int32_t **place) {
  if (!MS_NEW(alloc, *place, n)) return 0;
  for (int32_t i = 0; i < n; i++) (*place)[i] = -1;
  return 1;
}

/* The scene of the model; map: from numbers of the whole scene */
static ms_scene *cut_model_scene(const msim_sim *sim, ms_rank_scene *kept, ms_edit_map *map) {
  const ms_model *model = &sim->islands->model;
  const ms_scene *s = sim->scene;
  ms_scene_cut cut = {0};
  if (!create_places(&sim->alloc, s->nparticles, &map->particle) ||
      !create_places(&sim->alloc, s->nsprings, &map->spring))
    return NULL;
  for (int32_t r = 0; r < model->unknowns.stride; r++)
    if (model->unknowns.particle[r] >= 0) map->particle[model->unknowns.particle[r]] = 0;
  for (int32_t e = 0; e < model->springs.n; e++) map->spring[model->springs.spring[e]] = 0;
  if (!list_places(&sim->alloc, s->nparticles, map->particle, &cut.nparticles, &kept->particle) ||
      !list_places(&sim->alloc, s->nsprings, map->spring, &cut.nsprings, &kept->spring))
    return NULL;
  cut.particle = kept->particle, cut.spring = kept->spring, cut.place = map->particle;
  return ms_scene_data_cut(s, &cut, NULL);
}

/* particle, spring: to be freed. place: NULL where there is no section for output */
static int cut_rows(const msim_sim *sim, ms_rank_scene *kept, int32_t *particle, int32_t *spring,
                    int32_t *place) {
  const ms_section *is = &kept->is;
  const ms_scene_cut cut = {.nparticles = is->n + is->nothers,
                            .nsprings = is->nsprings + is->nother_springs,
                            .particle = particle,
                            .spring = spring,
                            .first_face = is->first_face,
                            .nfaces = is->nfaces,
                            .place = place};
  for (int32_t i = 0; i < cut.nparticles; i++) {
    particle[i] = ms_section_particle(is, (size_t)i);
    if (place) place[particle[i]] = i;
  }
  for (int32_t i = 0; i < cut.nsprings; i++) spring[i] = ms_section_spring(is, i);
  kept->slice = ms_scene_data_cut(sim->scene, &cut, NULL);
  if (!kept->slice || !sim->scene->source || sim->ranks->rank > 0) return kept->slice != NULL;
  kept->slice->source = ms_memory_copy_string(&sim->alloc, sim->scene->source);
  return kept->slice->source != NULL;
}

static int cut_slice(const msim_sim *sim, ms_rank_scene *kept) {
  const msim_allocator *alloc = &sim->alloc;
  int32_t *particle = NULL, *spring = NULL, *place = NULL;
  kept->has_rows = sim->section != NULL;
  kept->is = sim->section ? sim->section->is
                          : ms_section_of_rank(sim->scene, sim->ranks->rank, sim->ranks->n);
  const ms_section *is = &kept->is;
  const int fits = MS_NEW(alloc, particle, is->n + is->nothers) &&
                   MS_NEW(alloc, spring, is->nsprings + is->nother_springs) &&
                   (!kept->has_rows || MS_NEW(alloc, place, sim->scene->nparticles)) &&
                   cut_rows(sim, kept, particle, spring, place);
  MS_FREE(alloc, particle, spring, place);
  kept->rows = (ms_section){.n = is->n,
                            .nsprings = is->nsprings,
                            .nfaces = is->nfaces,
                            .nothers = is->nothers,
                            .nother_springs = is->nother_springs};
  return fits;
}

void ms_rank_scene_destroy(const msim_allocator *alloc, ms_rank_scene *kept) {
  if (!kept) return;
  ms_scene_release(kept->slice);
  MS_FREE(alloc, kept->particle, kept->spring, kept);
}

/* Replace the scene of the sim, whose model gets other numbers. */
static void set_scene(msim_sim *sim, ms_scene *scene, const ms_edit_map *map) {
  ms_reuse_renumber(&sim->islands->model, scene, map);
  ms_scene_release(sim->scene);
  sim->scene = scene;
}

msim_status ms_rank_scene_divide(msim_sim *sim, msim_error *err) {
  if (!may_divide(sim)) return MSIM_OK;
  const ms_scene *s = sim->scene;
  ms_edit_map map = {0};
  ms_rank_scene *kept = ms_memory_allocate(&sim->alloc, 1, sizeof *kept);
  if (kept)
    kept->nparticles = s->nparticles, kept->nsprings = s->nsprings, kept->nfaces = s->nfaces;
  ms_scene *own = kept ? cut_model_scene(sim, kept, &map) : NULL;
  const int fits = own && cut_slice(sim, kept);
  msim_status status =
      fits ? MSIM_OK : ms_error_set_memory(err, "what this rank keeps of the scene");
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status) {
    set_scene(sim, own, &map);
    sim->kept = kept;
  } else {
    ms_scene_release(own);
    ms_rank_scene_destroy(&sim->alloc, kept);
  }
  MS_FREE(&sim->alloc, map.particle, map.spring);
  return status;
}

/*------------------------------------- gathering ------------------------------------------------*/

/* Which of its elements the section of a rank has */
enum { PARTICLES, SPRINGS, FACES };

static int64_t count_in_section(const ms_section *s, int what) {
  return what == PARTICLES ? s->n : what == SPRINGS ? s->nsprings : s->nfaces;
}

static void gather_array(const msim_sim *sim, const ms_scene *whole, int what, size_t size,
                         const void *mine, void *all) {
  int64_t *bytes = sim->part->send_bytes;
  for (int32_t r = 0; r < sim->ranks->n; r++) {
    const ms_section s = ms_section_of_rank(whole, r, sim->ranks->n);
    bytes[r] = count_in_section(&s, what) * (int64_t)size;
  }
  ms_ranks_gather_parts(sim->ranks, bytes, mine, all);
}

/* n particles of springs or faces of the slice, by their numbers in the whole scene */
static const int32_t *number_ends(const ms_rank_scene *kept, int64_t n, const int32_t *end,
                                  int32_t *scratch) {
  for (int64_t i = 0; i < n && kept->has_rows; i++)
    scratch[i] = ms_section_particle(&kept->is, (size_t)end[i]);
  return kept->has_rows ? scratch : end;
}

static void gather_arrays(const msim_sim *sim, ms_scene *to, int32_t *scratch) {
  const ms_rank_scene *kept = sim->kept;
  const ms_scene *s = kept->slice;
  const size_t real = sizeof(double), number = sizeof(int32_t);
  gather_array(sim, to, PARTICLES, 3 * real, s->x, to->x);
  gather_array(sim, to, PARTICLES, 3 * real, s->v, to->v);
  gather_array(sim, to, PARTICLES, real, s->mass, to->mass);
  gather_array(sim, to, PARTICLES, 1, s->pinned, to->pinned);
  if (s->force) gather_array(sim, to, PARTICLES, 3 * real, s->force, to->force);
  gather_array(sim, to, SPRINGS, 2 * number,
               number_ends(kept, 2 * (int64_t)kept->is.nsprings, s->ij, scratch), to->ij);
  gather_array(sim, to, SPRINGS, real, s->k, to->k);
  gather_array(sim, to, SPRINGS, real, s->rest, to->rest);
  gather_array(sim, to, SPRINGS, real, s->damping, to->damping);
  gather_array(sim, to, FACES, 3 * number,
               number_ends(kept, 3 * (int64_t)kept->is.nfaces, s->faces, scratch), to->faces);
}

msim_status ms_rank_scene_gather(msim_sim *sim, msim_error *err) {
  ms_rank_scene *kept = sim->kept;
  if (!kept) return MSIM_OK;
  const int64_t nends = 2 * (int64_t)kept->is.nsprings + 3 * (int64_t)kept->is.nfaces;
  int32_t *scratch = NULL;
  ms_scene *whole =
      ms_scene_data_create_like(kept->slice, kept->nparticles, kept->nsprings, kept->nfaces, NULL);
  const int fits = whole && MS_NEW(&sim->alloc, scratch, nends);
  msim_status status = fits ? MSIM_OK : ms_error_set_memory(err, "the whole scene");
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status) {
    gather_arrays(sim, whole, scratch);
    status = ms_ranks_agree(sim->ranks, MSIM_OK, err);
  }
  ms_memory_free(&sim->alloc, scratch);
  if (status) {
    ms_scene_release(whole);
    return status;
  }
  whole->source = kept->slice->source, kept->slice->source = NULL;
  set_scene(sim, whole, &(ms_edit_map){.particle = kept->particle, .spring = kept->spring});
  sim->kept = NULL;
  ms_rank_scene_destroy(&sim->alloc, kept);
  return MSIM_OK;
}
