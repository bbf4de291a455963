/* saved_scene - what a checkpoint contains of a scene: forces that were changed since the sim was
 * created, and springs that solvers were chosen for */
#ifndef MS_SAVED_SCENE_H
#define MS_SAVED_SCENE_H

#include "sim/sim.h"

/* MS_ARCHIVE_COUNT reserves room for forces that may be set later. */
void ms_saved_scene_write_forces(ms_archive *b, const msim_sim *sim);

/* *scene: a reference to the sim's scene, or to a copy of it with the forces of the checkpoint;
 * *changed: 1 if the sim of the checkpoint had other forces than those it was created with. Values
 * that are impossible set the failure of the archive; *scene is NULL then, or after an error. */
msim_status ms_saved_scene_read_forces(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                       int32_t *changed, msim_error *err);

/* The springs that solvers were chosen for, where the sim has others. *scene: a copy of the sim's
 * scene with these springs; impossible values set the failure of the archive. */
void ms_saved_scene_write_springs(ms_archive *b, const msim_sim *sim);
msim_status ms_saved_scene_read_springs(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                        msim_error *err);

#endif
