/* mesh.h - surfaces of triangles, and soft bodies inside them, as objects of scenes; conventions:
 * msim.h */
#ifndef MSIM_MESH_H
#define MSIM_MESH_H

#include "msim/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MSIM_FILL_AUTO (-1.0)

/* A particle at each vertex, a spring along each edge, and the faces for viewers.
 *
 * Vertices that no face uses are left out; each other one within 1e-6 of the diagonal of the
 * bounding box of an earlier one is merged with it. Faces with two equal corners, and those with
 * the corners of an earlier one, are left out. Particles are the vertices that remain, in their
 * order: of a mesh without defects, vertex i is particle i. Faces are turned such that neighbours
 * have the same orientation, as most faces of their connected part have it.
 *
 * With fill, the particles of a cubic lattice follow, ix slowest and iz fastest, which is centred
 * in the bounding box: those points inside the surface that are at least half a spacing from it.
 * Inside is where the winding number is not 0. The springs of the lattice are those of
 * msim_lattice. Each vertex is tied to the points within 1.5 spacings and to at least the 4 nearest
 * ones, more if these hold it in fewer than three directions: points of its own part of the
 * surface, if there are any.
 *
 * Planes then constrain implicit steps (msim_scene_set_planes_constrain). */
typedef struct msim_mesh {
  size_t size;
  /* A file of vertices and faces, read by the importer of its extension: .obj, .stl, .ply, .gltf
   * and .glb (plugin assimp), or others, see importer.h. NULL: the arrays. */
  const char *file;
  int32_t nvertices, nfaces;
  const double *vertices; /* 3 nvertices */
  const int32_t *faces;   /* 3 nfaces: triangles, seen from outside counterclockwise */
  double scale;           /* m: the unit of the vertices; 0: 1 m */
  double translate[3];    /* m: added to the scaled vertices */
  double mass;            /* total mass, kg, > 0, of which each particle has an equal share */
  double k, damping;      /* N/m, N s/m; k = 0: no springs but those of `bend` */
  double bend; /* N/m: of a spring between the two vertices opposite each edge of two faces */
  double fill; /* m: the spacing of an inner lattice; 0: none; MSIM_FILL_AUTO: a sixth
                             of the shortest edge of the bounding box */
  int32_t npinned;
  const int32_t *pinned; /* npinned, indices of its particles */
  int32_t law;           /* of its springs (msim_scene_add_law); 0: linear */
} msim_mesh;

/* What was found in meshes */
typedef struct msim_mesh_repairs {
  size_t size;
  int32_t equal_vertices;    /* merged: at the place of an earlier one, as in STL files */
  int32_t near_vertices;     /* merged: within 1e-6 of the diagonal */
  int32_t unused_vertices;   /* left out: of no face, or of faces that are left out */
  int32_t degenerate_faces;  /* left out: two corners are equal */
  int32_t duplicate_faces;   /* left out */
  int32_t turned_faces;      /* their orientation was that of few */
  int32_t flat_faces;        /* these stay: three corners on a line */
  int32_t open_edges;        /* these stay: of one face */
  int32_t nonmanifold_edges; /* these stay: of three faces or more */
} msim_mesh_repairs;

/* MSIM_ERR_ARG: a member is out of range, the file is no mesh, or with `fill` the surface is not
 * closed, or no point of the lattice is inside; MSIM_ERR_IO: the file cannot be read; plugin
 * statuses; MSIM_ERR_SIZE. */
MSIM_API msim_status msim_scene_add_mesh(msim_scene *scene, const msim_mesh *mesh, msim_error *err);

/* Get what was found in all meshes of the scene together; set repairs->size first. */
MSIM_API msim_status msim_scene_mesh_repairs(const msim_scene *scene, msim_mesh_repairs *repairs);

#ifdef __cplusplus
}
#endif
#endif
