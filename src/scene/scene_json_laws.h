/* scene_json_laws - `laws` and `springs.law` of scene files */
#ifndef MS_SCENE_JSON_LAWS_H
#define MS_SCENE_JSON_LAWS_H

#include "scene/json_reader.h"

msim_status ms_json_read_laws(ms_json_reader *r, const char *path, ms_value laws);

/* The laws of n springs from spring `first` on. scratch: n */
msim_status ms_json_read_spring_laws(const ms_json_reader *r, ms_value value, int32_t first,
                                     int32_t n, double *scratch);

#endif
