/* scene_json - builds a scene from the tree of a scene file */
#ifndef MS_SCENE_JSON_H
#define MS_SCENE_JSON_H

#include "scene/json_reader.h"

/* Build the scene that a tree describes, in r->scene. */
msim_status ms_json_build_scene(ms_json_reader *r, ms_value root);

#endif
