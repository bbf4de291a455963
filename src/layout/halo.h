/* halo - refreshes the ghosts of a rank's part of a scene: rows of its vectors that other ranks
 * compute */
#ifndef MS_HALO_H
#define MS_HALO_H

#include "layout/rank_part.h"
#include "layout/unknowns.h"

typedef struct ms_halo {
  ms_ranks *ranks;
  int32_t first; /* the row of the first ghost */
  int32_t n;     /* neighbours: ranks that have ghosts of each other's particles */
  int32_t *out;  /* the rows that each neighbour gets, one neighbour after the other */
  int32_t *first_out, *first_in; /* n + 1: of each neighbour, in `out` and from `first` on */
  double *send, *receive;        /* two vectors of 3 components each */
  msim_comm_message *messages;   /* n */
  int64_t bytes;                 /* sent so far */
} ms_halo;

/* Determine which rank needs which rows, for the rows of ms_rank_part_create_island; collective.
 * After an error it may be there, and must be destroyed. */
msim_status ms_halo_create(const ms_scene *scene, const ms_unknowns *rows, const ms_rank_part *part,
                           ms_halo **halo, msim_error *err);
void ms_halo_destroy(const ms_scene *scene, ms_halo *halo);

/* The ghosts of x, and of v if it is not NULL, become what their owners have; collective. Nullable:
 * halo (one process), v. */
void ms_halo_refresh(ms_halo *halo, int32_t components, int32_t stride, double *x, double *v);

/* The same for a vector of floats */
void ms_halo_refresh_floats(ms_halo *halo, int32_t components, int32_t stride, float *x);

#endif
