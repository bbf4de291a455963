/* scene_json_colliders - reads the colliders of scene files */
#ifndef MS_SCENE_JSON_COLLIDERS_H
#define MS_SCENE_JSON_COLLIDERS_H

#include "scene/json_reader.h"

/* Add all of `colliders`, a list at `path`, to the scene. */
msim_status ms_json_add_colliders(ms_json_reader *r, const char *path, ms_value colliders);

#endif
