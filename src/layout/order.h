/* order - renumbers the rows of an island so that the kernels read contiguous memory
 *
 * Rows keep the order of the scene if the neighbours of consecutive rows mostly are consecutive
 * rows, as in ropes, cloths and lattices. Otherwise
 *   - rows are numbered by a breadth-first search from a peripheral row of each connected
 *     component, neighbours with the fewest springs first (Cuthill and McKee 1969), if that at
 *     least halves the mean distance |row - neighbour|. Shuffled regular meshes get most of their
 *     runs of consecutive neighbours back;
 *   - if these are few even then, rows are sorted by number of springs within windows of 64, which
 *     leaves fewer lanes empty (Kreutzer et al. 2014).
 * The order depends on the springs and pins of the scene only. Speedup of shuffled scenes, force /
 * A x, on one AVX2 core: random points joined to their nearest neighbours, in a square 1.5 / 2.0
 * (1e4 points), 2.0 / 2.2 (1e5), 5 / 5 (5e5), in a cube 1.5 / 2.0, 2.0 / 2.3, 4 / 4; cloth of
 * 100 x 100 1.7 / 2.7, of 500 x 500 3.9 / 2.9. Sorting by degree gives 1.1 to 1.2 of that. */
#ifndef MS_ORDER_H
#define MS_ORDER_H

#include "layout/adjacency.h"

/* Renumbers rows, the ends of springs, and `a`, their adjacency, if that is worthwhile. */
msim_status ms_order_unknowns(const ms_scene *scene, ms_unknowns *rows, ms_springs *springs,
                              ms_adjacency *a, msim_error *err);

#endif
