#include "scene/mesh_file.h"

#include <string.h>

#include "scene/import_nodes.h"

/* The column of a node of the root with rows of 3 numbers; NULL: there is none. */
static const ms_column *find_rows(const ms_import_nodes *in, const char *key, int32_t kind) {
  const json_t *index = json_object_get(in->root, key);
  const ms_column *c = json_is_integer(index) ? &in->columns[json_integer_value(index)] : NULL;
  return c && c->kind == kind && c->rank == 2 && c->dims[1] == 3 && c->dims[0] <= INT32_MAX / 3
             ? c
             : NULL;
}

static msim_status read_mesh(ms_import_nodes *in, const msim_importer *table, const char *path,
                             ms_mesh_arrays *mesh) {
  const msim_status status = ms_import_nodes_load(in, table, path);
  if (status) return status;
  const ms_column *vertices = find_rows(in, "vertices", MSIM_NODE_REAL),
                  *faces = find_rows(in, "faces", MSIM_NODE_WHOLE);
  if (!vertices || !faces)
    return ms_json_fail(&in->reader, MSIM_ERR_ARG,
                        "it contains no mesh: no `vertices` with 3 numbers each and `faces` with 3 "
                        "indices each, at most %d",
                        INT32_MAX / 3);
  mesh->nvertices = (int32_t)vertices->dims[0], mesh->nfaces = (int32_t)faces->dims[0];
  if (!MS_NEW(&in->reader.alloc, mesh->vertices, 3 * (size_t)mesh->nvertices) ||
      !MS_NEW(&in->reader.alloc, mesh->faces, 3 * (size_t)mesh->nfaces))
    return ms_import_nodes_fail_memory(in);
  memcpy(mesh->vertices, vertices->data, 3 * (size_t)mesh->nvertices * sizeof *mesh->vertices);
  for (size_t i = 0; i < 3 * (size_t)mesh->nfaces; i++) {
    const int64_t v = ((const int64_t *)faces->data)[i];
    mesh->faces[i] = v >= 0 && v < mesh->nvertices ? (int32_t)v : -1;
  }
  return MSIM_OK;
}

msim_status ms_mesh_file_read(const msim_allocator *alloc, const char *path, ms_mesh_arrays *mesh,
                              msim_error *err) {
  ms_import_nodes in = {.reader = {.label = path, .alloc = ms_memory_allocator(alloc), .err = err}};
  const msim_importer *importer;
  msim_error why;
  *mesh = (ms_mesh_arrays){0};
  msim_status status = ms_importers_find(path, alloc, &importer, &why);
  if (status) return ms_error_set(err, status, "%s: %s", path, why.text);
  if (!importer)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%s: no importer reads such files; meshes are .obj, .stl, .ply, .gltf or "
                        ".glb files%s%s",
                        path, *why.text ? ": " : "", why.text);
  status = read_mesh(&in, importer, path, mesh);
  ms_import_nodes_free(&in);
  return status;
}

void ms_mesh_file_free(const msim_allocator *alloc, ms_mesh_arrays *mesh) {
  MS_FREE(alloc, mesh->vertices, mesh->faces);
}
