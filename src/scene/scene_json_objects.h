/* scene_json_objects - reads the ropes, cloths and lattices of a scene file */
#ifndef MS_SCENE_JSON_OBJECTS_H
#define MS_SCENE_JSON_OBJECTS_H

#include "scene/json_reader.h"

/* Add the particles of `objects`, and later their springs. */
msim_status ms_json_add_objects(ms_json_reader *r, const char *path, ms_value objects);
msim_status ms_json_add_object_springs(const ms_json_reader *r);

#endif
