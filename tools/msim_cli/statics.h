/* statics - the commands `rest` and `modes`: equilibrium and natural frequencies */
#ifndef CLI_STATICS_H
#define CLI_STATICS_H

#include "arguments.h"

/* The beginning of every file that `modes` writes, by which it is recognized. */
extern const char modes_beginning[];

/* Return the exit status. */
int rest_command(const arguments *args);
int modes_command(const arguments *args);

#endif
