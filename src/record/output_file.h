/* output_file - the output file of a recorder: lock it, write it under a temporary name, rename it
 *
 * A recorder holds a lock on one byte far beyond the end of its file, which ends with the process.
 * Readers do not meet it: libhdf5 locks whole files, by locks of another kind. */
#ifndef MS_OUTPUT_FILE_H
#define MS_OUTPUT_FILE_H

#include "base/text.h"

typedef struct ms_output_file {
  const char *path;       /* final name; borrowed until the file is renamed */
  ms_text temporary_name; /* temporary name of a new file, until it is renamed */
  int fd;                 /* the new file, which is locked; -1: none */
  int replaced_fd;        /* the locked file that still has the final name; -1: none */
} ms_output_file;

/* Lock the file at `path`, if there is one. MSIM_ERR_IO: another recorder has locked it, or it is a
 * device, a pipe or a folder, which must not be replaced. *taken: it is there and not empty. */
msim_status ms_output_file_lock(ms_output_file *file, const msim_allocator *alloc, const char *path,
                                int *taken, msim_error *err);

/* Create the new file under its temporary name, and lock it. */
msim_status ms_output_file_create(ms_output_file *file, msim_error *err);

/* Rename the new file, which readers can open now. sync: write its name to the disk, too. */
msim_status ms_output_file_commit(ms_output_file *file, int sync, msim_error *err);

/* Unlock, and remove a new file that was not renamed. */
void ms_output_file_release(ms_output_file *file);

#endif
