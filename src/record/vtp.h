/* vtp - a frame as a file of VTK's XML format for polygonal data, *.vtp
 *
 * Particles are points, springs lines, faces polygons. Binary arrays follow the XML text ("appended
 * raw"), each behind its number of bytes. Positions and velocities have the bits of the frame. */
#ifndef MS_VTP_H
#define MS_VTP_H

#include <stdio.h>

#include "msim/recorder.h"

/* The beginning of every file, by which it is recognized. */
extern const char ms_vtp_beginning[];

enum { MS_VTP_ARRAYS = 17 };

/* All frames of a recording have the same text and sizes. */
typedef struct ms_vtp {
  char text[4096];                 /* the XML text before the arrays */
  uint64_t bytes[MS_VTP_ARRAYS];   /* size of each array */
  const void *data[MS_VTP_ARRAYS]; /* NULL: an array of the frame */
  void *constants;                 /* memory of the others */
  int has_pins;                    /* 0: the array of reactions is left out */
} ms_vtp;

/* Copies what frames have in common. Returns 0 if memory is exhausted. */
int ms_vtp_init(ms_vtp *vtp, const msim_host *host, const msim_recording *what);
void ms_vtp_free(ms_vtp *vtp, const msim_host *host);

/* Returns 0 if writing fails. */
int ms_vtp_write(const ms_vtp *vtp, const msim_frame *frame, FILE *stream);

#endif
