/* edit - removes and adds particles and springs of a scene, all at once (msim_edit) */
#ifndef MS_EDIT_H
#define MS_EDIT_H

#include "scene/scene.h"

/* The numbers that particles, springs and angular springs have after an edit; -1: they are removed.
 * What stays keeps its order, and what is added follows it. */
typedef struct ms_edit_map {
  int32_t nparticles, nsprings;                      /* before the edit */
  int32_t kept_particles, kept_springs, kept_angles; /* that stay */
  int32_t *particle, *spring, *angle; /* nparticles, nsprings, and for each angular spring */
} ms_edit_map;

/* Copy the members that the caller's struct has. MSIM_ERR_SIZE */
msim_status ms_edit_read(const msim_edit *edit, msim_edit *full, msim_error *err);

/* Check what is to be removed, and number what stays. */
msim_status ms_edit_map_create(const ms_scene *scene, const msim_edit *edit, ms_edit_map *map,
                               msim_error *err);
void ms_edit_map_destroy(const ms_scene *scene, ms_edit_map *map);

/* *edited: a new scene, the edited copy of this one. On failure NULL. */
msim_status ms_edit_copy(ms_scene *scene, const msim_edit *edit, const ms_edit_map *map,
                         ms_scene **edited, msim_error *err);

#endif
