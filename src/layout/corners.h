/* corners - where the results of the corners at each unknown are found, in sliced ELLPACK
 *
 * Kernels write a vector for each corner of an angular spring (layout/angles.h); each row adds
 * those of its own corners, in fixed order. As in half_edges.h, an entry holds one of 8 rows each;
 * where the order of the mesh allows it, the places of an entry are consecutive. */
#ifndef MS_CORNERS_H
#define MS_CORNERS_H

#include "base/buckets.h"
#include "layout/unknowns.h"

typedef struct ms_corners {
  int32_t nslices;
  int32_t *first; /* nslices + 1: the first entry of each slice */
  int32_t *start; /* nentries: the place of lane l is start + l; -1: see place */
  int32_t *place; /* 8 nentries; of empty lanes: one whose vector is 0 */
} ms_corners;

/* at: the corners of each unknown, ascending places; place: of each corner; empty: the place whose
 * vector is 0. Returns 0 if memory is exhausted. */
int ms_corners_create(const msim_allocator *alloc, const ms_unknowns *rows, const ms_buckets *at,
                      const int32_t *place, int32_t empty, ms_corners *corners);
void ms_corners_destroy(const msim_allocator *alloc, ms_corners *corners);

#endif
