/* halves - every spring seen from each of its unknown ends, for loops that gather and never scatter
 *
 * Rows come in groups of 8 lanes. A slot holds up to one half spring for each lane of its group
 * (sliced ELLPACK; Monakov, Lokhmotov and Avetisyan 2010). Slots are filled so that neighbours of
 * consecutive rows are consecutive rows wherever the mesh has any such order: these are read by one
 * vector load. Each row meets its halves in one fixed order. */
#ifndef MS_HALVES_H
#define MS_HALVES_H

#include "layout/rows.h"

typedef struct ms_halves {
  int32_t ngroups;    /* first_pinned / 8: the unknowns */
  int32_t nslots;     /* of 8 halves each */
  int32_t *first;     /* ngroups + 1: the first slot of each group */
  int32_t *start;     /* nslots: the neighbour of lane l is row start + l; -1: see neighbour */
  int32_t *neighbour; /* 8 nslots: the row at the other end; padding: any row */
  int32_t *spring;    /* 8 nslots: its index in ms_springs; padding: -1 */
  double *k, *rest, *damping; /* 8 nslots; padding: 0 */
} ms_halves;

msim_status ms_halves_create(const ms_scene *scene, const ms_rows *rows, const ms_springs *springs,
                             ms_halves *halves, msim_error *err);

/* Take k, rest and damping from the springs again. */
void ms_halves_update(const ms_springs *springs, ms_halves *halves);
void ms_halves_destroy(const ms_scene *scene, ms_halves *halves);

#endif
