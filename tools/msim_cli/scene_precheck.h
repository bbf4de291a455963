/* scene_precheck - load a scene file in a child process first, because libhdf5 and Assimp may crash
 * on it */
#ifndef CLI_SCENE_PRECHECK_H
#define CLI_SCENE_PRECHECK_H

/* Load a scene, or the part of one of several ranks, in a child process if it is HDF5 or has a
 * mesh, and print an error if that crashes: the libraries that read such files do so on some
 * damaged ones. */
int precheck_scene(const char *path, int rank, int nranks);

#endif
