/* scene_json_angles - reads the angular springs of a scene file */
#ifndef MS_SCENE_JSON_ANGLES_H
#define MS_SCENE_JSON_ANGLES_H

#include "scene/json_reader.h"

msim_status ms_json_read_angles(ms_json_reader *r, const char *path, ms_value section);

#endif
