/* scene_json_motions - reads the motions of a scene file */
#ifndef MS_SCENE_JSON_MOTIONS_H
#define MS_SCENE_JSON_MOTIONS_H

#include "scene/json_reader.h"

msim_status ms_json_read_motions(ms_json_reader *r, const char *path, ms_value motions);

#endif
