/* collider_storage - copies and frees the colliders of a scene, with their motions and samples */
#ifndef MS_COLLIDER_STORAGE_H
#define MS_COLLIDER_STORAGE_H

#include "scene/scene.h"

/* Copy all colliders to a scene that has none, but room for them. Samples are shared. After
 * MSIM_ERR_MEMORY it has some. */
msim_status ms_collider_storage_copy(const ms_scene *from, ms_scene *to, msim_error *err);

void ms_collider_storage_free(ms_scene *scene);

#endif
