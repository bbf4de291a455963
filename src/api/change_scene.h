/* change_scene - start a run in the present state with a changed copy of the sim's scene */
#ifndef MS_CHANGE_SCENE_H
#define MS_CHANGE_SCENE_H

#include "sim/sim.h"

/* A change of `copy`, and of the state x, v that the run starts from */
typedef msim_status ms_scene_change(msim_scene *copy, const void *data, double *x, double *v,
                                    msim_error *err);

/* moves: 1 if only motions differ; the islands stay then. The change of energy is work. On failure
 * nothing is changed. */
msim_status ms_change_scene(msim_sim *sim, ms_scene_change *change, const void *data, int moves,
                            msim_error *err);

#endif
