/* resume - continuation of an existing trajectory file */
#ifndef HDF5_RESUME_H
#define HDF5_RESUME_H

#include "file.h"

/* Open the file and find the frame after which it continues; the file is not changed. */
void h5_resume(recorder *r, const msim_recording *what, msim_resumption *from);

/* Open the file, which another process has created or resumed, to write rows of frames. */
void h5_join(recorder *r, const msim_recording *what);

/* 1: h5_create created the file. */
int h5_recognize(recorder *r, const char *path);

#endif
