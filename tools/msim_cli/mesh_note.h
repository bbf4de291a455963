/* mesh_note - what was repaired in the meshes of a scene, in one line */
#ifndef CLI_MESH_NOTE_H
#define CLI_MESH_NOTE_H

#include "msim/msim.h"

typedef struct mesh_note {
  char text[512]; /* "": nothing to report */
} mesh_note;

/* Vertices that are equal are no defect: each face of an STL file has its own. */
mesh_note mesh_note_make(const msim_scene *scene);

#endif
