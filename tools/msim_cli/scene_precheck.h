/* scene_precheck - load a scene file in a child process first, because libhdf5 may crash on it */
#ifndef CLI_SCENE_PRECHECK_H
#define CLI_SCENE_PRECHECK_H

/* Load an HDF5 scene in a child process, and print an error if that crashes: libhdf5 does so on
 * some damaged files before their content can be checked. */
int precheck_scene(const char *path);

#endif
