/* scene_json_motions - reads the motions of a scene file, of pinned particles and of colliders */
#ifndef MS_SCENE_JSON_MOTIONS_H
#define MS_SCENE_JSON_MOTIONS_H

#include "scene/json_reader.h"

msim_status ms_json_read_motions(ms_json_reader *r, const char *path, ms_value motions);

/* path: of the motion */
msim_status ms_json_read_collider_motion(const ms_json_reader *r, const char *path, ms_value motion,
                                         int32_t collider);

#endif
