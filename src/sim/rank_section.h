/* rank_section - the state of the section of a scene that a rank has for output, whatever particles
 * it computes
 *
 * Ranks exchange it for each state that is written, so that none needs that of the whole scene. */
#ifndef MS_RANK_SECTION_H
#define MS_RANK_SECTION_H

#include "base/buckets.h"
#include "scene/section.h"
#include "sim/rank_scene.h"

typedef struct ms_rank_section {
  ms_section in_whole; /* in the numbers of the whole scene */
  double *x, *v;       /* of its rows, as last updated; where nothing moves as in the scene */
  int32_t *other, *other_spring; /* of `in_whole` */
  ms_buckets in;                 /* the rows that each rank sends */
  int32_t nout;
  int32_t *out; /* nout: the unknowns that each rank gets, one rank after the other */
  /* nranks each: bytes of one number of each of these; and the numbers themselves */
  int64_t *send_bytes, *receive_bytes;
  double *send, *receive;
} ms_rank_section;

/* Make the section of a rank, unless it is there, in sim->section; collective. It lasts as long as
 * the islands. */
msim_status ms_rank_section_create(msim_sim *sim, msim_error *err);
void ms_rank_section_destroy(msim_sim *sim);

/* The scene that has the particles, springs and faces of the section, and their numbers there */
static inline const ms_scene *ms_rank_section_scene(const msim_sim *sim) {
  return sim->kept ? sim->kept->slice : sim->scene;
}
static inline ms_section ms_rank_section_numbers(const msim_sim *sim) {
  return sim->kept ? sim->kept->rows : sim->section->in_whole;
}

/* Set its x and v from arrays of all particles of that scene, or those of free ones from vectors of
 * the islands of all ranks, along the axes that these have; the latter is collective, and a
 * failure of the communicator is kept for the next agreement. */
void ms_rank_section_copy(const msim_sim *sim, const double *x, const double *v);
void ms_rank_section_exchange(const msim_sim *sim, const double *x, const double *v);

/* The energy of the whole scene in the state of all sections, with the bits of one process;
 * collective, as above. */
msim_energy ms_rank_section_sum_energy(const msim_sim *sim);

#endif
