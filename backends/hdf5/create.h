/* create - a new trajectory: all planned frames, and what holds for all of them */
#ifndef HDF5_CREATE_H
#define HDF5_CREATE_H

#include "file.h"

void h5_create(recorder *r, const msim_recording *what);

#endif
