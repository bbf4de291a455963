#include "mesh_note.h"

#include <stdio.h>
#include <string.h>

static void add_count(mesh_note *note, int32_t count, const char *one, const char *many) {
  const size_t length = strlen(note->text);
  if (count)
    snprintf(note->text + length, sizeof note->text - length, "%s%d %s",
             length ? "; " : "meshes: ", count, count == 1 ? one : many);
}

mesh_note mesh_note_make(const msim_scene *scene) {
  mesh_note note = {""};
  msim_mesh_repairs r = {.size = sizeof r};
  msim_scene_mesh_repairs(scene, &r);
  add_count(&note, r.near_vertices, "vertex merged with one very near",
            "vertices merged with others very near");
  add_count(&note, r.unused_vertices, "vertex of no face left out", "vertices of no face left out");
  add_count(&note, r.degenerate_faces, "degenerate face left out", "degenerate faces left out");
  add_count(&note, r.duplicate_faces, "duplicate face left out", "duplicate faces left out");
  add_count(&note, r.turned_faces, "face turned", "faces turned");
  add_count(&note, r.flat_faces, "face is flat", "faces are flat");
  add_count(&note, r.open_edges, "edge is open", "edges are open");
  add_count(&note, r.nonmanifold_edges, "edge has more than two faces",
            "edges have more than two faces");
  return note;
}
