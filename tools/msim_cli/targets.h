/* targets - checks of the files that a run is about to write, before anything is computed */
#ifndef CLI_TARGETS_H
#define CLI_TARGETS_H

#include "arguments.h"

/* Refuse files that the run must not replace. Prints errors. */
int check_targets(const arguments *args);

#endif
