/* stl - whether each facet of a text file of STL is whole */
#ifndef MSIM_ASSIMP_STL_H
#define MSIM_ASSIMP_STL_H

#include <stdio.h>

#include "msim/importer.h"

/* libassimp 5.2 takes each three vertices as a facet, wherever they are, and truncated files as
 * whole. Succeeds for binary files, whose size it checks itself. */
msim_status assimp_stl_check(const msim_host *host, const char *path);

/* 1: the file is text; it is then at its first word, behind a byte order mark. */
int assimp_stl_is_text(FILE *file);

#endif
