/* rank_scene - what a rank keeps of the scene after creation, so that its memory falls with the
 * number of ranks
 *
 * sim->scene becomes the part that the model of this rank refers to: own particles, ghosts and
 * pinned particles at their springs, under numbers of its own. Beside it the rank keeps a slice of
 * the whole scene, the section of rank_section.h, so that all slices, one behind the other, are the
 * whole scene. What speaks of numbers in the whole scene gathers it first. */
#ifndef MS_RANK_SCENE_H
#define MS_RANK_SCENE_H

#include "scene/section.h"
#include "sim/sim.h"

typedef struct ms_rank_scene {
  int32_t nparticles, nsprings, nfaces; /* of the whole scene */
  int32_t *particle, *spring;           /* of each one of sim->scene: its number there */
  int32_t *owner;                       /* in_whole.n: of the slice, as in ms_rank_part */
  ms_scene *slice;     /* x and v of own rows only, once the section has those of the others */
  ms_section in_whole; /* what the slice has, in the numbers of the whole scene */
  ms_section rows;     /* the same in the numbers of the slice, the rows of the section */
  int has_rows; /* 0: the sim has no section for output: the slice has no other particles, and its
                   springs and faces refer to numbers of the whole scene */
  int64_t *lengths, *send_bytes, *receive_bytes; /* nranks: scratch */
  struct ms_rank_order *order; /* of own unknowns, where no rank had the whole scene; NULL once the
                                  island is there */
} ms_rank_scene;

/* Move the order from `kept` to *order. */
void ms_rank_scene_take_order(const msim_allocator *alloc, ms_rank_scene *kept,
                              struct ms_rank_order *order);

/* An object whose slice is what a rank has read of the scene; NULL: out of memory. */
ms_rank_scene *ms_rank_scene_create_from(const ms_scene_part *part);
void ms_rank_scene_destroy(const msim_allocator *alloc, ms_rank_scene *kept);

/* Keep only the parts of this rank, where several ranks share a scene that needs no more; its
 * arrays have been hashed (sim->scene_hashes). Collective; on failure nothing changes. */
msim_status ms_rank_scene_divide(msim_sim *sim, msim_error *err);

/* Gather the whole scene on each rank. Collective; on failure nothing changes. */
msim_status ms_rank_scene_gather(msim_sim *sim, msim_error *err);

/* Gather the whole scene temporarily: rank 0 has its arrays, the others what is not divided.
 * Collective; to be returned, also after an error. */
msim_status ms_rank_scene_borrow(const msim_sim *sim, ms_scene **whole, msim_error *err);
void ms_rank_scene_return(const msim_sim *sim, ms_scene *whole);

/* What rank 0 computes from the whole scene, `bytes` of data, becomes that of all. Collective, with
 * the same status on all ranks */
typedef msim_status ms_rank_scene_function(const ms_scene *whole, void *data, msim_error *err);
msim_status ms_rank_scene_compute(const msim_sim *sim, ms_rank_scene_function *compute,
                                  size_t bytes, void *data, msim_error *err);

/* The owner of each particle of a section, in the order of its rows. Collective, with the same
 * status on all ranks */
msim_status ms_rank_scene_find_owners(const msim_sim *sim, const ms_section *section,
                                      int32_t *owner, msim_error *err);

/* Let the slice have the other particles and springs of a section, too. Collective; on failure
 * nothing changes. */
msim_status ms_rank_scene_extend(msim_sim *sim, const ms_section *section, msim_error *err);

/* Free x and v of other rows, of which the section has copies. */
void ms_rank_scene_trim(msim_sim *sim);

/* The section of a rank */
static inline ms_section ms_rank_scene_section(const ms_rank_scene *kept, int32_t rank,
                                               int32_t nranks) {
  const ms_scene counts = {
      .nparticles = kept->nparticles, .nsprings = kept->nsprings, .nfaces = kept->nfaces};
  return ms_section_of_rank(&counts, rank, nranks);
}

/* Of the whole scene, and the number in it of a particle or spring of the model */
static inline int32_t ms_rank_scene_count_particles(const msim_sim *sim) {
  return sim->kept ? sim->kept->nparticles : sim->scene->nparticles;
}
static inline int32_t ms_rank_scene_count_springs(const msim_sim *sim) {
  return sim->kept ? sim->kept->nsprings : sim->scene->nsprings;
}
static inline int32_t ms_rank_scene_get_particle(const msim_sim *sim, int32_t p) {
  return sim->kept && p >= 0 ? sim->kept->particle[p] : p;
}
/* The particle of the model that has a number in the whole scene */
static inline int32_t ms_rank_scene_find_particle(const msim_sim *sim, int32_t number) {
  if (!sim->kept) return number;
  return ms_section_search(sim->scene->nparticles, sim->kept->particle, number);
}
static inline int32_t ms_rank_scene_get_spring(const msim_sim *sim, int32_t e) {
  return sim->kept && e >= 0 ? sim->kept->spring[e] : e;
}

#endif
