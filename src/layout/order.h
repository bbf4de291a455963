/* order - which particle lies in which row
 *
 * Rows follow the scene's numbers where that makes neighbours of consecutive rows consecutive, as
 * in the objects of the library. Else
 *   - rows are numbered breadth first from a far end of each piece, neighbours of fewest springs
 *     first (Cuthill and McKee 1969), if that at least halves the distance from row to neighbour.
 *     Regular meshes that were shuffled get most of their runs back;
 *   - where there are few runs even so, rows are sorted by their number of springs within windows
 *     of 64, which leaves fewer lanes empty (Kreutzer et al. 2014).
 * The order depends on the springs and pins of the scene alone. What it makes of shuffled scenes,
 * times faster in force / A x on one AVX2 core: random points joined to the nearest, in a square
 * 1.5 / 2.0 (1e4), 2.0 / 2.2 (1e5), 5 / 5 (5e5), in a cube 1.5 / 2.0, 2.0 / 2.3, 4 / 4; cloth of
 * 100 x 100 1.7 / 2.7, of 500 x 500 3.9 / 2.9. Of that, sorting by degree is 1.1 to 1.2. */
#ifndef MS_ORDER_H
#define MS_ORDER_H

#include "layout/adjacency.h"

/* Gives rows and springs new numbers where that pays; `a` is theirs before and after. */
msim_status ms_order_rows(const ms_scene *scene, ms_rows *rows, ms_springs *springs,
                          ms_adjacency *a, msim_error *err);

#endif
