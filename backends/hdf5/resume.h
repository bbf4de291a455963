/* resume - a trajectory that is there already, to go on with it */
#ifndef HDF5_RESUME_H
#define HDF5_RESUME_H

#include "file.h"

/* Open the file and find where it goes on; it stays as it is. */
void h5_resume(recorder *r, const msim_recording *what, msim_resumption *from);

/* 1: the file is one that h5_create has made. */
int h5_recognize(recorder *r, const char *path);

#endif
