/* run - the command `run`: simulate a scene and write its files */
#ifndef CLI_RUN_H
#define CLI_RUN_H

#include "arguments.h"

/* Returns the exit status. */
int run_command(const arguments *args);

#endif
