/* path_progress - what the parts of particle_path share: how far the particle has come in a step */
#ifndef MS_PATH_PROGRESS_H
#define MS_PATH_PROGRESS_H

#include "contact/particle_path.h"

/* rad: the largest ms_path_progress.turn */
#define MS_PATH_SMALL_ANGLE 0.125

/* The cosine of the angle between the normals at both ends of a part of the path: across an edge it
 * is less than this, elsewhere more */
#define MS_PATH_SHARP_COSINE 0.9

/* The longest part of a path along samples, over the smallest spacing of these */
#define MS_PATH_SHARE_OF_CELL 0.125

/* Progress of the particle in the step. */
typedef struct ms_path_progress {
  ms_particle_path *p;
  double t, start, end; /* s: this part of the path is between times of motions or of the step */
  ms_plane_set contact; /* the planes that it rests on or slides along */
  double frame[3];      /* m/s: that of the contact, while v and w are relative to it; 0 at rest */
  double displacement[3]; /* m: the last one of surfaces in contact */
  double tolerance;       /* rounding tolerance of a velocity */
  double turn;            /* rad: normals of curved surfaces turn by less in a part of the path */
  int stalled;            /* consecutive impacts at most 1e-6 h apart */
  int stalls;             /* how often these were too many */
  int is_partial; /* the last part of the path ended before an impact or the end of the step */
} ms_path_progress;

/* The acceleration b of w at the time t of the path */
static inline void ms_path_progress_acceleration(const ms_particle_path *p, double t, double b[3]) {
  for (int c = 0; c < 3; c++) b[c] = p->b0[c] + (p->b1[c] - p->b0[c]) * (t / p->h);
}

#endif
