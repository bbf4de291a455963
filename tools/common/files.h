/* files - compare and classify files by their names */
#ifndef TOOLS_FILES_H
#define TOOLS_FILES_H

/* 1: two names refer to the same file, also if it does not exist yet. Nullable: both. */
int same_file(const char *a, const char *b);

/* "a folder" or "a device or a pipe" if the name is that of one, else NULL. Nullable: path. */
const char *special_file_kind(const char *path);

/* 1: a file, a folder or anything else has this name. */
int file_exists(const char *path);

/* 1: a file has this name that is not empty, and that does not begin with `text`, as those of the
 * program do, or cannot be read. */
int file_is_foreign(const char *path, const char *text);

/* 1: the name ends in this extension, such as ".csv". */
int has_extension(const char *path, const char *extension);

#endif
