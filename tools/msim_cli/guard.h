/* guard - a scene file that a library cannot stand is met by a child process first */
#ifndef CLI_GUARD_H
#define CLI_GUARD_H

/* Loads a scene of HDF5 in a child process; complains where that crashes. libhdf5 does so over some
 * damaged files, before anything of it can be looked at. */
int guard_scene(const char *path);

#endif
