/* files - what the names of files stand for */
#ifndef TOOLS_FILES_H
#define TOOLS_FILES_H

/* Whether two names stand for one file, also where neither exists yet. Nullable: both. */
int same_file(const char *a, const char *b);

/* "a folder" or "a device or a pipe" where one has this name, else NULL. Nullable: path. */
const char *not_a_file(const char *path);

/* Whether anything has this name. */
int file_exists(const char *path);

/* Whether a name ends in an extension, ".csv". */
int has_extension(const char *path, const char *extension);

#endif
