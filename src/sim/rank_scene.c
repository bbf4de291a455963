#include "sim/rank_scene.h"

#include <string.h>

#include "layout/rank_order.h"
#include "scene/scene_data.h"
#include "sim/rank_fetch.h"
#include "sim/rank_section.h"
#include "sim/reuse.h"

/*------------------------------------- creation and destruction ---------------------------------*/

/* Without arrays */
static ms_rank_scene *create_kept(const msim_allocator *alloc, int32_t nranks, int32_t nparticles,
                                  int32_t nsprings, int32_t nfaces) {
  ms_rank_scene *kept = ms_memory_allocate(alloc, 1, sizeof *kept);
  if (!kept) return NULL;
  kept->nparticles = nparticles, kept->nsprings = nsprings, kept->nfaces = nfaces;
  if (MS_NEW(alloc, kept->lengths, nranks) && MS_NEW(alloc, kept->send_bytes, nranks) &&
      MS_NEW(alloc, kept->receive_bytes, nranks))
    return kept;
  ms_rank_scene_destroy(alloc, kept);
  return NULL;
}

void ms_rank_scene_destroy(const msim_allocator *alloc, ms_rank_scene *kept) {
  if (!kept) return;
  if (kept->order) ms_rank_order_destroy(kept->slice, kept->order);
  ms_memory_free(alloc, kept->order);
  ms_scene_release(kept->slice);
  MS_FREE(alloc, kept->particle, kept->spring, kept->owner, kept->send_bytes, kept->receive_bytes,
          kept->lengths, kept);
}

void ms_rank_scene_take_order(const msim_allocator *alloc, ms_rank_scene *kept,
                              ms_rank_order *order) {
  *order = *kept->order;
  ms_memory_free(alloc, kept->order);
  kept->order = NULL;
}

ms_rank_scene *ms_rank_scene_create_from(const ms_scene_part *part) {
  ms_rank_scene *kept =
      create_kept(&part->rows->alloc, part->nranks, part->nparticles, part->nsprings, part->nfaces);
  if (kept) kept->slice = ms_scene_retain(part->rows), kept->in_whole = ms_section_of_part(part);
  return kept;
}

/*------------------------------------- division -------------------------------------------------*/

/* Laws, angular springs and force functions refer to the whole scene. Arrays of the whole state, as
 * with motions of pins and after a change of the scene, take about as much. The same on all ranks.
 */
static int may_divide(const msim_sim *sim) {
  const ms_scene *s = sim->scene;
  return sim->part && !sim->kept && !sim->state_x && s->nlaws == 0 && s->angles.n == 0 &&
         !ms_scene_has_function(s);
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
  for (int32_t e = 0; e < model->springs.n; e++)
    map->spring[ms_springs_number(&model->springs, e)] = 0;
  if (!list_places(&sim->alloc, s->nparticles, map->particle, &cut.nparticles, &kept->particle) ||
      !list_places(&sim->alloc, s->nsprings, map->spring, &cut.nsprings, &kept->spring))
    return NULL;
  cut.particle = kept->particle, cut.spring = kept->spring, cut.place = map->particle;
  return ms_scene_data_cut(s, &cut, NULL);
}

/* particle, spring: to be freed. place: NULL where there is no section for output */
static int cut_rows(const msim_sim *sim, ms_rank_scene *kept, int32_t *particle, int32_t *spring,
                    int32_t *place) {
  const ms_section *section = &kept->in_whole;
  const ms_scene_cut cut = {.nparticles = section->n + section->nothers,
                            .nsprings = section->nsprings + section->nother_springs,
                            .particle = particle,
                            .spring = spring,
                            .first_face = section->first_face,
                            .nfaces = section->nfaces,
                            .place = place};
  for (int32_t i = 0; i < cut.nparticles; i++) {
    particle[i] = ms_section_particle(section, (size_t)i);
    if (place) place[particle[i]] = i;
  }
  for (int32_t i = 0; i < cut.nsprings; i++) spring[i] = ms_section_spring(section, i);
  kept->slice = ms_scene_data_cut(sim->scene, &cut, NULL);
  if (!kept->slice || !sim->scene->source || sim->ranks->rank > 0) return kept->slice != NULL;
  kept->slice->source = ms_memory_copy_string(&sim->alloc, sim->scene->source);
  return kept->slice->source != NULL;
}

/* The slice has other particles and springs, too. */
static void set_rows(ms_rank_scene *kept, ms_scene *slice, const ms_section *section) {
  kept->slice = slice, kept->in_whole = *section, kept->has_rows = 1;
  kept->rows = (ms_section){.n = section->n,
                            .nsprings = section->nsprings,
                            .nfaces = section->nfaces,
                            .nothers = section->nothers,
                            .nother_springs = section->nother_springs};
}

static int cut_slice(const msim_sim *sim, ms_rank_scene *kept) {
  const msim_allocator *alloc = &sim->alloc;
  int32_t *particle = NULL, *spring = NULL, *place = NULL;
  kept->has_rows = sim->section != NULL;
  kept->in_whole = sim->section ? sim->section->in_whole
                                : ms_section_of_rank(sim->scene, sim->ranks->rank, sim->ranks->n);
  const ms_section *section = &kept->in_whole;
  const int fits = MS_NEW(alloc, kept->owner, section->n) &&
                   MS_NEW(alloc, particle, section->n + section->nothers) &&
                   MS_NEW(alloc, spring, section->nsprings + section->nother_springs) &&
                   (!kept->has_rows || MS_NEW(alloc, place, sim->scene->nparticles)) &&
                   cut_rows(sim, kept, particle, spring, place);
  MS_FREE(alloc, particle, spring, place);
  for (int32_t i = 0; i < section->n && fits; i++)
    kept->owner[i] = sim->part->owner[section->first + i];
  if (kept->has_rows) set_rows(kept, kept->slice, section);
  return fits;
}

/* Without memory the longer arrays stay. */
void ms_rank_scene_trim(msim_sim *sim) {
  if (!sim->kept || !sim->kept->has_rows) return;
  ms_scene *s = sim->kept->slice;
  const size_t n = 3 * (size_t)sim->kept->in_whole.n;
  double *x, *v = NULL;
  if (MS_NEW(&s->alloc, x, n) && MS_NEW(&s->alloc, v, n)) {
    memcpy(x, s->x, n * sizeof *x), memcpy(v, s->v, n * sizeof *v);
    MS_FREE(&s->alloc, s->x, s->v);
    s->x = x, s->v = v;
  } else MS_FREE(&s->alloc, x, v);
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
  ms_rank_scene *kept =
      create_kept(&sim->alloc, sim->ranks->n, s->nparticles, s->nsprings, s->nfaces);
  ms_scene *own = kept ? cut_model_scene(sim, kept, &map) : NULL;
  const int fits = own && cut_slice(sim, kept);
  msim_status status =
      fits ? MSIM_OK : ms_error_set_memory(err, "what this rank keeps of the scene");
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status) {
    set_scene(sim, own, &map);
    sim->kept = kept;
    ms_rank_part_forget_whole(&sim->alloc, sim->part);
    ms_rank_scene_trim(sim);
  } else {
    ms_scene_release(own);
    ms_rank_scene_destroy(&sim->alloc, kept);
  }
  MS_FREE(&sim->alloc, map.particle, map.spring);
  return status;
}

/*------------------------------------- gathering ------------------------------------------------*/

static ms_scene *create_whole(const ms_rank_scene *kept) {
  return ms_scene_data_create_like(kept->slice, kept->nparticles, kept->nsprings, kept->nfaces,
                                   NULL);
}

/* The same without arrays */
static ms_scene *create_counts(const ms_rank_scene *kept) {
  ms_scene *s = ms_scene_data_create_like(kept->slice, 0, 0, 0, NULL);
  if (s) s->nparticles = kept->nparticles, s->nsprings = kept->nsprings, s->nfaces = kept->nfaces;
  return s;
}

static void move_source(ms_scene *from, ms_scene *to) {
  to->source = from->source, from->source = NULL;
}

static void gather_owners(const msim_sim *sim, int32_t *owner) {
  const ms_field f = {MS_PARTICLES, sizeof *owner, sim->kept->owner, 0};
  ms_rank_gather_field(sim->ranks, sim->kept, MS_ALL_RANKS, &f, NULL, owner);
}

msim_status ms_rank_scene_gather(msim_sim *sim, msim_error *err) {
  ms_rank_scene *kept = sim->kept;
  if (!kept) return MSIM_OK;
  ms_scene *whole = create_whole(kept);
  const int fits = whole && ms_rank_part_provide_whole(whole, sim->part);
  msim_status status = ms_rank_gather_fields(sim->ranks, kept, MS_ALL_RANKS, whole, fits, err);
  if (!status) {
    gather_owners(sim, sim->part->owner);
    status = ms_ranks_agree(sim->ranks, MSIM_OK, err);
  }
  if (status) {
    ms_rank_part_forget_whole(&sim->alloc, sim->part);
    ms_scene_release(whole);
    return status;
  }
  move_source(kept->slice, whole);
  set_scene(sim, whole, &(ms_edit_map){.particle = kept->particle, .spring = kept->spring});
  sim->kept = NULL;
  ms_rank_scene_destroy(&sim->alloc, kept);
  return MSIM_OK;
}

msim_status ms_rank_scene_borrow(const msim_sim *sim, ms_scene **whole, msim_error *err) {
  const ms_rank_scene *kept = sim->kept;
  if (!kept) *whole = ms_scene_retain(sim->scene);
  if (!kept) return MSIM_OK;
  *whole = sim->ranks->rank == 0 ? create_whole(kept) : create_counts(kept);
  const msim_status status =
      ms_rank_gather_fields(sim->ranks, kept, 0, *whole, *whole != NULL, err);
  if (!status) move_source(kept->slice, *whole);
  return status;
}

void ms_rank_scene_return(const msim_sim *sim, ms_scene *whole) {
  if (whole && sim->kept && whole->source) move_source(whole, sim->kept->slice);
  ms_scene_release(whole);
}

msim_status ms_rank_scene_compute(const msim_sim *sim, ms_rank_scene_function *compute,
                                  size_t bytes, void *data, msim_error *err) {
  ms_scene *whole;
  msim_status status = ms_rank_scene_borrow(sim, &whole, err);
  if (!status && sim->ranks->rank == 0) status = compute(whole, data, err);
  ms_rank_scene_return(sim, whole);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (status) return status;
  ms_ranks_broadcast(sim->ranks, 0, (int64_t)bytes, data);
  return ms_ranks_agree(sim->ranks, MSIM_OK, err);
}

/*------------------------------------- other rows -----------------------------------------------*/

msim_status ms_rank_scene_find_owners(const msim_sim *sim, const ms_section *section,
                                      int32_t *owner, msim_error *err) {
  const ms_rank_scene *kept = sim->kept;
  const int32_t *of = kept ? kept->owner - section->first : sim->part->owner;
  ms_rank_fetch f = {0};
  for (int32_t i = 0; i < section->n; i++) owner[i] = of[section->first + i];
  for (int32_t i = 0; i < section->nothers && !kept; i++)
    owner[section->n + i] = of[section->other[i]];
  if (!kept) return MSIM_OK;
  msim_status status = ms_rank_fetch_create(sim->ranks, kept, MS_PARTICLES, section->nothers,
                                            section->other, &f, err);
  if (!status) ms_rank_fetch_rows(&f, sizeof *owner, kept->owner, owner + section->n);
  ms_rank_fetch_destroy(&f);
  return status ? status : ms_ranks_agree(sim->ranks, MSIM_OK, err);
}

/* Behind the n own particles or springs of a new slice come others, of these numbers. */
static msim_status fetch_others(const msim_sim *sim, ms_element of, int32_t n, int32_t nothers,
                                const int32_t *number, ms_scene *slice, msim_error *err) {
  ms_field from[MS_MOST_FIELDS], to[MS_MOST_FIELDS];
  ms_rank_fetch f = {0};
  const int count = ms_rank_gather_list(sim->kept->slice, from);
  ms_rank_gather_list(slice, to);
  const msim_status status =
      ms_rank_fetch_create(sim->ranks, sim->kept, of, nothers, number, &f, err);
  for (int i = 0; i < count && !status; i++) {
    const size_t bytes = (size_t)n * to[i].size;
    if (to[i].of != of) continue;
    if (bytes) memcpy(to[i].data, from[i].data, bytes);
    ms_rank_fetch_rows(&f, to[i].size, from[i].data, (char *)to[i].data + bytes);
  }
  ms_rank_fetch_destroy(&f);
  return status ? status : ms_ranks_agree(sim->ranks, MSIM_OK, err);
}

static void number_rows(const ms_section *section, int64_t n, int32_t *end) {
  for (int64_t i = 0; i < n; i++) end[i] = (int32_t)ms_section_row(section, end[i]);
}

msim_status ms_rank_scene_extend(msim_sim *sim, const ms_section *section, msim_error *err) {
  ms_rank_scene *kept = sim->kept;
  if (!kept) return MSIM_OK;
  ms_scene *slice =
      ms_scene_data_create_like(kept->slice, section->n + section->nothers,
                                section->nsprings + section->nother_springs, section->nfaces, NULL);
  msim_status status =
      ms_ranks_agree_on_memory(sim->ranks, slice != NULL, "the rows of a frame", err);
  if (!status)
    status =
        fetch_others(sim, MS_PARTICLES, section->n, section->nothers, section->other, slice, err);
  if (!status)
    status = fetch_others(sim, MS_SPRINGS, section->nsprings, section->nother_springs,
                          section->other_spring, slice, err);
  if (status) {
    ms_scene_release(slice);
    return status;
  }
  if (slice->nfaces) memcpy(slice->faces, kept->slice->faces, 3 * (size_t)slice->nfaces * 4);
  number_rows(section, 3 * (int64_t)slice->nfaces, slice->faces);
  number_rows(section, 2 * (int64_t)slice->nsprings, slice->ij);
  move_source(kept->slice, slice);
  ms_scene_release(kept->slice);
  set_rows(kept, slice, section);
  return MSIM_OK;
}
