/* place - the file that a recorder takes: may it, and is it alone there?
 *
 * Who writes a file holds a lock on a byte far beyond its end, which dies with the process. It is
 * none that readers know of: libhdf5's are on whole files, and of another kind. */
#ifndef MS_PLACE_H
#define MS_PLACE_H

#include "base/text.h"

typedef struct ms_place {
  const char *path; /* borrowed, until the file bears it */
  ms_text part;     /* the name of a new file until then */
  int fd;           /* holds the lock; -1: on none */
  int before;       /* of the file that is there still; -1: none is */
} ms_place;

/* Lock what is there and stay alone: a file takes another file's place, but not that of a device, a
 * pipe or a folder. *taken: something is written there. */
msim_status ms_place_claim(ms_place *place, const msim_allocator *alloc, const char *path,
                           int *taken, msim_error *err);

/* Make the new file, under its other name, and lock that. */
msim_status ms_place_begin(ms_place *place, msim_error *err);

/* The new file is whole enough to bear the name. sync: on the disk, too. */
msim_status ms_place_fill(ms_place *place, int sync, msim_error *err);

/* Unlock, and leave nothing behind of a new file that does not bear the name. */
void ms_place_leave(ms_place *place);

#endif
