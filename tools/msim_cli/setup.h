/* setup - from the command line to a scene and the options of its run */
#ifndef CLI_SETUP_H
#define CLI_SETUP_H

#include "arguments.h"

typedef struct setup {
  msim_scene *scene;
  msim_options options;
} setup;

/* Load the scene and find its options, an integrator among them; complains. Call setup_free in any
 * case. */
int setup_make(const arguments *args, setup *made);
void setup_free(setup *made);

/* Complain about what the library said, and return the exit status it asks for. */
int setup_failed(msim_status status, const msim_error *err);

#endif
