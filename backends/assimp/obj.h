/* obj - how many vertices of an OBJ file belong to no face (Wavefront, Advanced Visualizer,
 * appendix B1, Object Files) */
#ifndef MSIM_ASSIMP_OBJ_H
#define MSIM_ASSIMP_OBJ_H

#include "msim/importer.h"

/* Vertices that no face uses do not come with the faces; the host counts them as left out. *n:
 * their number; 0 also if the file is no OBJ file. */
msim_status assimp_obj_count_unused(const msim_host *host, const char *path, int64_t *n);

#endif
