/* scene_json_objects - reads the ropes, cloths and lattices of a scene file */
#ifndef MS_SCENE_JSON_OBJECTS_H
#define MS_SCENE_JSON_OBJECTS_H

#include "scene/json_reader.h"

/* Add the particles of `objects`, and later their springs. */
msim_status ms_json_add_objects(ms_json_reader *r, const char *path, ms_value objects);
msim_status ms_json_add_object_springs(const ms_json_reader *r);

/* The i-th name of a group of particles of a cloth, for `pinned`; NULL past the end. */
const char *ms_json_objects_particle_name(int32_t i);

#endif
