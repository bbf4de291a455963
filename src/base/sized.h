/* sized - read and write structs of the caller that begin with their size: a program built with an
 * older or a newer msim has fewer or more members at their end */
#ifndef MS_SIZED_H
#define MS_SIZED_H

#include "base/error.h"

/* Refuse a struct of the caller with MSIM_ERR_SIZE if its size is below `least`, or if bytes beyond
 * the `known` ones are not 0: members that this msim does not have. type: its name without "msim_";
 * what: its name in messages */
msim_status ms_sized_check(const void *from, size_t known, size_t least, const char *type,
                           const char *what, msim_error *err);

/* Copy the members that the caller's struct has; all others become 0. */
void ms_sized_read(void *to, size_t known, const void *from);

/* Write the members that the caller's struct has, except `size`. MSIM_ERR_SIZE: it has none. */
msim_status ms_sized_write(void *to, const void *full, size_t known);

/* The size of a struct whose last member is `member`. */
#define MS_SIZE_THROUGH(type, member) (offsetof(type, member) + sizeof(((type *)0)->member))

#endif
