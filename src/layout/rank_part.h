/* rank_part - the part of a scene that one rank computes: its own particles, the springs and
 * angular springs at them, and the particles at the other ends
 *
 * Ghosts are unknowns of other ranks at the other end of such springs. Kernels treat them as pinned
 * particles, which they read and never write; halo.h refreshes them. While it is built every rank
 * has the whole scene, and all particles have their numbers in it. */
#ifndef MS_RANK_PART_H
#define MS_RANK_PART_H

#include "base/ranks.h"
#include "layout/islands.h"

/* The islands of one process and the order of their unknowns, in which checkpoints have them */
typedef struct ms_whole_islands {
  int32_t n;
  int32_t *first;    /* n + 1: the first unknown of each */
  int32_t *particle; /* of each unknown, island by island; NULL: only in ms_whole_order */
  uint64_t *hash;    /* n: of the particles of all rows (unknowns.h) */
} ms_whole_islands;

void ms_whole_islands_destroy(const msim_allocator *alloc, ms_whole_islands *islands);

struct ms_rank_order;

typedef struct ms_rank_part {
  ms_ranks *ranks;
  /* nparticles: the rank of each free particle (bisection.h); NULL where the rank does not have the
   * whole scene, as is `all` */
  int32_t *owner;
  const int32_t *number; /* of the particles of a part of the scene, which is all that the rank has,
                             their numbers in the whole one, ascending; NULL: it has the whole */
  ms_whole_islands whole; /* own unknowns are in this order; empty before islands are built */
  int32_t *place;         /* of each own unknown, in this order */
  int64_t *bytes;         /* nranks: those of one number of each own particle */
  /* Scratch: nranks each; of ms_rank_part_gather a number of each own and of each free particle */
  int64_t *next, *send_bytes, *receive_bytes;
  double *own, *all;
  /* Of checkpoints: nranks + 1, which bytes each rank writes; rows that are sent and received */
  size_t *bounds;
  struct ms_placed_row *send, *receive;
  int32_t most_received; /* rows at a time */
} ms_rank_part;

/* A row of a checkpoint by its place in a component of a vector */
typedef struct ms_placed_row {
  int64_t place;
  double value;
} ms_placed_row;

/* Keep the islands of one process, and the place of each own unknown among theirs, which the order
 * then has no more. */
void ms_rank_part_keep_order(const msim_allocator *alloc, ms_rank_part *part,
                             struct ms_rank_order *order);

/* Divide the scene among `ranks`, which the part borrows. After an error it may be there, and must
 * be destroyed. */
msim_status ms_rank_part_create(const ms_scene *scene, ms_ranks *ranks, ms_rank_part **part,
                                msim_error *err);

/* The same where rank 0 alone has the scene: x and pinned. The others have no owners. Collective,
 * with the same status on all ranks. */
msim_status ms_rank_part_create_on_root(const ms_scene *scene, ms_ranks *ranks, ms_rank_part **part,
                                        msim_error *err);

/* Free what refers to the whole scene; make room for it again: 0 without memory. */
void ms_rank_part_forget_whole(const msim_allocator *alloc, ms_rank_part *part);
int ms_rank_part_provide_whole(const ms_scene *scene, ms_rank_part *part);

void ms_rank_part_destroy(const msim_allocator *alloc, ms_rank_part *part);

/* The part of this rank as the only island, whatever springs connect. Its first pinned particles
 * are ghosts, by owner and then by number; free particles are in the order of `order`, which the
 * island borrows. */
msim_status ms_rank_part_create_island(const ms_scene *scene, const ms_rank_part *part,
                                       const struct ms_rank_order *order, ms_islands *islands,
                                       msim_error *err);

/* The values of all free particles, which their owners have; collective. array: 3 numbers of each
 * particle of the scene */
void ms_rank_part_gather(ms_rank_part *part, int32_t nparticles, double *array);

/* The number of own particles of a rank */
static inline int64_t ms_rank_part_count(const ms_rank_part *part, int32_t rank) {
  return part->bytes[rank] / (int64_t)sizeof(double);
}

/* Largest number of own particles of a rank over the mean of all. */
double ms_rank_part_imbalance(const ms_scene *scene, const ms_rank_part *part);

#endif
