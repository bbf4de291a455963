/* scene_part_file - a scene file that ranks read in parts */
#ifndef TEST_SCENE_PART_FILE_H
#define TEST_SCENE_PART_FILE_H

#include "testing.h"

static const char path[] = "scene.h5";

/* Without HDF5 the tests are skipped. */
static inline void save(const msim_scene *scene) {
  msim_error why;
  const msim_status status = msim_scene_save(scene, path, &why);
  require(status != MSIM_ERR_PLUGIN && status != MSIM_ERR_NAME, "the plugin hdf5");
  if (status) fail_msg("%s", why.text);
}

#endif
