/* output - a file that appears under its name when it is complete, and not before */
#ifndef TOOLS_OUTPUT_H
#define TOOLS_OUTPUT_H

#include <stdio.h>

typedef struct output_file {
  const char *path;
  char *part;   /* the name it has until then */
  FILE *stream; /* NULL: not open */
} output_file;

/* Make sure, before the work is done, that the file can be written; complains. */
int output_open(output_file *file, const char *path);

/* Close the file. written: whether all writes to it went well, else errno tells why they did not;
 * only then it gets its name. Complains. */
int output_close(output_file *file, int written);

/* Leave no trace of a file that was not written. Accepts one that is not open. */
void output_discard(output_file *file);

#endif
