/* cleaned - text that libassimp refuses or misreads, in memory as it takes it
 *
 * libassimp accepts the keywords of STL in lower case only, at the very start of the file, and
 * takes a byte order mark for a part of the first word: of OBJ files the first vertex is lost. */
#ifndef MSIM_ASSIMP_CLEANED_H
#define MSIM_ASSIMP_CLEANED_H

#include <stddef.h>

#include "msim/importer.h"

/* *text: the *length bytes to read in place of the file, to be freed; NULL: read the file
 * itself. */
msim_status assimp_cleaned_read(const msim_host *host, const char *path, char **text,
                                size_t *length);

#endif
