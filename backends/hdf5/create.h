/* create - creation of a trajectory file with all planned frames and the constant data */
#ifndef HDF5_CREATE_H
#define HDF5_CREATE_H

#include "file.h"

void h5_create(recorder *r, const msim_recording *what);

#endif
