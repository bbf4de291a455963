/* mark - the byte order mark before a text file of UTF-8 */
#ifndef MSIM_ASSIMP_MARK_H
#define MSIM_ASSIMP_MARK_H

#include <stdio.h>
#include <string.h>

/* The file is then at its first byte that is not part of a mark; 1: it has one. */
static inline int assimp_skip_mark(FILE *file) {
  char head[3];
  rewind(file);
  if (fread(head, 1, sizeof head, file) == sizeof head && memcmp(head, "\xEF\xBB\xBF", 3) == 0)
    return 1;
  rewind(file);
  return 0;
}

#endif
