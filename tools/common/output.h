/* output - write a file that gets its name only when it is complete */
#ifndef TOOLS_OUTPUT_H
#define TOOLS_OUTPUT_H

#include <stdio.h>

typedef struct output_file {
  const char *path;
  char *part;   /* its temporary name until then */
  FILE *stream; /* NULL: not open */
} output_file;

/* Open the file, under its temporary name, before the work is done. Prints errors. */
int output_open(output_file *file, const char *path);

/* Close the file, and rename it if all writes to it succeeded: written, else errno has the reason.
 * Prints errors. */
int output_close(output_file *file, int written);

/* Remove a file that was not closed. Accepts one that is not open. */
void output_discard(output_file *file);

#endif
