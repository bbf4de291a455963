/* final - the state that --final writes and --init reads */
#ifndef CLI_FINAL_H
#define CLI_FINAL_H

#include <stdio.h>

#include "msim/msim.h"

/* The file being written; it appears under its name when it is complete. */
typedef struct final_file {
  const char *path;
  char *part;   /* the name it has until then */
  FILE *stream; /* NULL: not open */
} final_file;

/* Make sure before the run that the file can be written. These complain. */
int final_open(final_file *file, const char *path);

/* Write the present state of a run that ended with `status`, and close the file. */
int final_write(final_file *file, msim_sim *sim, msim_status status);

/* Leave no trace of a file that was not written. Accepts one that is not open. */
void final_discard(final_file *file);

/* Set the sim to the state in a file that final_write wrote; complains. */
int init_read(const char *path, msim_sim *sim);

#endif
