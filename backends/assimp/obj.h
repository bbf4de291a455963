/* obj - the vertices of an OBJ file that belong to no element (Wavefront, Advanced Visualizer,
 * appendix B1, Object Files) */
#ifndef MSIM_ASSIMP_OBJ_H
#define MSIM_ASSIMP_OBJ_H

#include "msim/importer.h"

/* libassimp returns the vertices that faces, lines and points use only: the others, which the host
 * counts as left out, are found here. *x: 3 n coordinates, to be freed; NULL: there are none, or
 * the file is no OBJ file. */
msim_status assimp_obj_find_unused(const msim_host *host, const char *path, int64_t *n, double **x);

#endif
