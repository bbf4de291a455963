/* frame_file - a text file that grows by whole frames
 *
 * What is printed reaches the file at the end of a frame at the latest. After the first failure
 * nothing more is written, and the file is truncated to its complete frames. */
#ifndef MS_FRAME_FILE_H
#define MS_FRAME_FILE_H

#include "base/error.h"
#include "msim/recorder.h"

enum { MS_FRAME_FILE_BUFFER = 1 << 18 };

typedef struct ms_frame_file {
  const msim_host *host;
  const char *name; /* for messages; borrowed */
  int fd;
  int sync;         /* 1: complete frames survive a power failure */
  int error;        /* errno of the first failure */
  int torn;         /* 1: the file ends inside an incomplete frame */
  int64_t length;   /* of the file, bytes */
  int64_t complete; /* bytes up to the end of the last complete frame */
  size_t used;      /* of the buffer */
  char buffer[MS_FRAME_FILE_BUFFER];
} ms_frame_file;

/* Create the file of a recording. A failure is reported by the next function that returns a
 * status. */
void ms_frame_file_open(ms_frame_file *file, const msim_host *host, const msim_recording *what,
                        const char *name);

/* At most 511 bytes */
void ms_frame_file_print(ms_frame_file *file, const char *format, ...) MS_PRINTF(2, 3);
void ms_frame_file_write(ms_frame_file *file, const void *bytes, size_t count);

msim_status ms_frame_file_end_frame(ms_frame_file *file);
msim_status ms_frame_file_close(ms_frame_file *file);

#endif
