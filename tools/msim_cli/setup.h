/* setup - load the scene and find the options of its run */
#ifndef CLI_SETUP_H
#define CLI_SETUP_H

#include "arguments.h"

typedef struct setup {
  msim_scene *scene;
  msim_options options;
} setup;

/* Load the scene and find its options, which may lack an integrator. Prints errors. Call
 * setup_free always. */
int setup_load(const arguments *args, setup *made);

/* The same after precheck_scene, of one of several ranks (msim_scene_load_part) */
int setup_read(const arguments *args, int rank, int nranks, setup *made);
void setup_free(setup *made);

/* Print the library's error, and return the exit status for it. */
int setup_report_error(msim_status status, const msim_error *err);

#endif
