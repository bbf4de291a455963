/* saved_scene - what a checkpoint contains of a scene: forces and pins that were changed since the
 * sim was created, and springs that solvers were chosen for */
#ifndef MS_SAVED_SCENE_H
#define MS_SAVED_SCENE_H

#include "sim/sim.h"

/* What a checkpoint contains of the changes of a scene since the sim was created: forces and pins,
 * or all that edits change, too */
enum { MS_SCENE_CHANGED = 1, MS_SCENE_EDITED = 2 };

/* Gravity, drag, constant forces, pins and motions, if they were changed; of edited scenes also all
 * particles, springs and faces; and broken springs. MS_ARCHIVE_COUNT reserves room for forces and
 * pins that may be changed later. */
void ms_saved_scene_write_changes(ms_archive *b, const msim_sim *sim);

/* *scene: a reference to the sim's scene, or, if it has others, to a copy with the changes of the
 * checkpoint;
 * *changed: MS_SCENE_...; 0: the sim of the checkpoint had none. Impossible values set the failure
 * of the archive or are refused; *scene is NULL then. */
msim_status ms_saved_scene_read_changes(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                        int32_t *changed, msim_error *err);

/* The broken springs that follow the changes: nsprings flags of this scene; NULL: none can break.
 * */
void ms_saved_scene_archive_broken(ms_archive *b, const ms_scene *scene, uint8_t *broken);

/* The springs that solvers were chosen for, where the sim has others. *scene: a copy of the sim's
 * scene with these springs; impossible values set the failure of the archive. */
void ms_saved_scene_write_springs(ms_archive *b, const msim_sim *sim);
msim_status ms_saved_scene_read_springs(ms_archive *b, const msim_sim *sim, ms_scene **scene,
                                        msim_error *err);

/* *scene: the same copy, with the springs of `from` */
msim_status ms_saved_scene_copy_springs(const ms_scene *from, const msim_sim *sim, ms_scene **scene,
                                        msim_error *err);

#endif
