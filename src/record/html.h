/* html - the built-in recorder `html`: writes trajectories as one page for browsers
 *
 * The page is the player (src/record/player) and a block of data, which is its last element: a
 * line of JSON with the scene, and a line for each frame. A page that ends early, as after a
 * power failure, shows the frames whose lines are complete.
 *
 * Scene: the counts `particles`, `springs`, `triangles`, and `frames` as planned; `name`,
 * `gravity`, `planes`, `colliders` as in scene files; and as integers (integer_code.h) of 32 bits
 * `ij`, `faces`, `pinned`, and the bits of single-precision numbers `mass`, `k`, `rest`. Each
 * integer is the difference to the one 2 before in `ij`, 3 before in `faces`, 1 before in the
 * others.
 *
 * Frame: `step`, `t`, the energies, the bounding box from `low` to `high`, the greatest speed
 * `fastest`, and integers q: `x` of 16 bits, all x, then all y, then all z, with the coordinate
 * low + (high - low) q / 65535, and `speed` of 8 bits, fastest q / 255. What is written of q is
 * r_i - r_(i-1) with r = q - 2 q' + q'', where q' is of the frame before and q'' of that before it,
 * both of the first frame r = q, of the second r = q - q'. Where colliders move, `poses`: of each
 * the position of its center, or of the middle of its axis, and its rotation vector. */
#ifndef MS_HTML_H
#define MS_HTML_H

#include "msim/recorder.h"

/* The greatest page that is begun, bytes */
#define MS_HTML_LIMIT 100000000

const msim_recorder_type *ms_html_recorder_type(void);

#endif
