/* scene_part_file - a scene file that ranks read in parts */
#ifndef TEST_SCENE_PART_FILE_H
#define TEST_SCENE_PART_FILE_H

#include "scene/scene.h"
#include "testing.h"

static const char path[] = "scene.h5";

/* Without HDF5 the tests are skipped. */
static inline void save(const msim_scene *scene) {
  msim_error why;
  const msim_status status = msim_scene_save(scene, path, &why);
  require(status != MSIM_ERR_PLUGIN && status != MSIM_ERR_NAME, "the plugin hdf5");
  if (status) fail_msg("%s", why.text);
}

/* A part as if the file had no rest lengths */
static inline void forget_rest(const msim_scene *part) {
  const ms_scene *rows = part->part->rows;
  part->part->lacks_rest = rows->nsprings > 0 || part->part->nsprings > 0;
  for (int32_t e = 0; e < rows->nsprings; e++) rows->rest[e] = -1;
}

#endif
