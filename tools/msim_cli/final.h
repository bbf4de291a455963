/* final - write the state of --final, and read that of --init */
#ifndef CLI_FINAL_H
#define CLI_FINAL_H

#include "../common/output.h"
#include "msim/msim.h"

/* The beginning of every file that final_write writes, by which it is recognized. */
extern const char final_beginning[];

/* Write the present state of a run of the scene that ended with `status`, with the reactions of
 * pinned particles, and close the file. Prints errors. */
int final_write(output_file *file, const msim_scene *scene, msim_sim *sim, msim_status status);

/* Set the sim to the state in a file that final_write wrote. Prints errors. */
int final_read(const char *path, msim_sim *sim);

#endif
