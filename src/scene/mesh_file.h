/* mesh_file - reads the vertices and faces of a mesh by the importer of its file */
#ifndef MS_MESH_FILE_H
#define MS_MESH_FILE_H

#include "base/memory.h"

/* The arrays of a mesh */
typedef struct ms_mesh_arrays {
  int32_t nvertices, nfaces;
  double *vertices; /* 3 nvertices */
  int32_t *faces;   /* 3 nfaces; an index that is no int32_t has become -1 */
} ms_mesh_arrays;

/* Read a file by the importer of its extension. The caller deletes the arrays, also after an
 * error. */
msim_status ms_mesh_file_read(const msim_allocator *alloc, const char *path, ms_mesh_arrays *mesh,
                              msim_error *err);
void ms_mesh_file_free(const msim_allocator *alloc, ms_mesh_arrays *mesh);

#endif
