#include "scene/mesh.h"

#include <math.h>
#include <string.h>

#include "scene/mesh_file.h"
#include "scene/mesh_fill.h"

struct ms_mesh {
  ms_surface surface;
  ms_fill fill;
  double k, bend; /* of the springs; 0: there are none */
};

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status check_arrays(const msim_mesh *m, const char *subject, msim_error *err) {
  const int32_t counts[] = {m->nvertices, m->nfaces};
  static const char *const names[] = {"nvertices", "nfaces"};
  for (int i = 0; i < 2; i++)
    if (counts[i] < 1 || counts[i] > INT32_MAX / 3)
      return ms_error_set(err, MSIM_ERR_ARG, "%s.%s is %d; it must be from 1 to %d", subject,
                          names[i], counts[i], INT32_MAX / 3);
  if (!m->vertices || !m->faces)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.vertices or %s.faces is NULL, and so is %s.file",
                        subject, subject, subject);
  for (int64_t i = 0; i < 3 * (int64_t)m->nfaces; i++)
    if (m->faces[i] < 0 || m->faces[i] >= m->nvertices)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s.faces[%lld] refers to vertex %d; there are %d vertices, counted from "
                          "0",
                          subject, (long long)(i / 3), m->faces[i], m->nvertices);
  for (int64_t i = 0; i < 3 * (int64_t)m->nvertices; i++)
    if (!isfinite(m->vertices[i]))
      return ms_error_set(err, MSIM_ERR_ARG, "%s.vertices[%lld] is %g; it must be finite", subject,
                          (long long)(i / 3), m->vertices[i]);
  return MSIM_OK;
}

/* Scale and move the vertices; their differences must be finite, too. */
static msim_status place_vertices(const msim_mesh *m, const char *subject, double *x,
                                  msim_error *err) {
  const double scale = m->scale > 0 ? m->scale : 1;
  double largest = 0;
  for (size_t i = 0; i < 3 * (size_t)m->nvertices; i++) {
    x[i] = scale * m->vertices[i] + m->translate[i % 3];
    largest = fmax(largest, fabs(x[i]));
  }
  if (isfinite(4 * largest)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "%s extends beyond the range of double; use smaller coordinates", subject);
}

/*------------------------------------- parts of the shape ---------------------------------------*/

static void place_particles(const ms_shape *shape, double *x) {
  const ms_mesh *m = shape->mesh;
  const size_t n = 3 * (size_t)m->surface.nvertices;
  memcpy(x, m->surface.x, n * sizeof *x);
  if (m->fill.n) memcpy(x + n, m->fill.x, 3 * (size_t)m->fill.n * sizeof *x);
}

static void list_faces(const ms_shape *shape, int32_t *corners) {
  const ms_surface *s = &shape->mesh->surface;
  memcpy(corners, s->corners, 3 * (size_t)s->nfaces * sizeof *corners);
}

/* Springs with k: of the edges, then inside */
static int64_t count_springs(const ms_mesh *m) {
  return m->k > 0 ? (int64_t)m->surface.nedges + m->fill.nsprings : 0;
}

static int has_bend(const ms_surface *s, int32_t edge) {
  return s->first[edge + 1] - s->first[edge] == 2;
}

static int64_t count_bends(const ms_mesh *m) {
  int64_t count = 0;
  for (int32_t e = 0; e < m->surface.nedges && m->bend > 0; e++) count += has_bend(&m->surface, e);
  return count;
}

static void list_springs(const ms_shape *shape, int32_t *ij, double *k) {
  const ms_mesh *m = shape->mesh;
  const ms_surface *s = &m->surface;
  const int64_t nstiff = count_springs(m);
  for (int64_t e = 0; e < shape->nsprings; e++) k[e] = e < nstiff ? m->k : m->bend;
  if (nstiff) {
    memcpy(ij, s->ij, 2 * (size_t)s->nedges * sizeof *ij);
    ij += 2 * (size_t)s->nedges;
    if (m->fill.nsprings) memcpy(ij, m->fill.ij, 2 * (size_t)m->fill.nsprings * sizeof *ij);
    ij += 2 * (size_t)m->fill.nsprings;
  }
  for (int32_t e = 0; e < s->nedges && m->bend > 0; e++)
    if (has_bend(s, e)) {
      *ij++ = ms_surface_opposite(s, s->half[s->first[e]]);
      *ij++ = ms_surface_opposite(s, s->half[s->first[e] + 1]);
    }
}

/*------------------------------------- the whole ------------------------------------------------*/

static msim_status make_surface(const msim_allocator *alloc, const msim_mesh *m,
                                const char *subject, ms_surface *s, msim_error *err) {
  double *x;
  msim_status status = check_arrays(m, subject, err);
  if (status) return status;
  if (!MS_NEW(alloc, x, 3 * (size_t)m->nvertices)) return ms_error_set_memory(err, "a mesh");
  status = place_vertices(m, subject, x, err);
  if (!status && !ms_surface_create(alloc, m->nvertices, x, m->nfaces, m->faces, s))
    status = ms_error_set_memory(err, "a mesh");
  ms_memory_free(alloc, x);
  if (!status && s->nfaces == 0)
    status = ms_error_set(err, MSIM_ERR_ARG,
                          "%s has no face but degenerate ones, which have a corner twice", subject);
  return status;
}

static msim_status count_parts(ms_shape *shape, const char *subject, msim_error *err) {
  static const ms_shape_lists lists = {place_particles, list_faces, list_springs, NULL};
  const ms_mesh *m = shape->mesh;
  shape->lists = &lists;
  shape->nparticles = m->surface.nvertices + m->fill.n;
  shape->nfaces = m->surface.nfaces;
  shape->nsprings = count_springs(m) + count_bends(m);
  if (shape->nsprings <= INT32_MAX) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "%s gives %lld springs; the limit is %d", subject,
                      (long long)shape->nsprings, INT32_MAX);
}

static msim_status make_surface_of_file(const msim_allocator *alloc, const msim_mesh *mesh,
                                        const char *subject, ms_surface *s, msim_error *err) {
  msim_mesh arrays = *mesh;
  ms_mesh_arrays read;
  msim_error why;
  msim_status status = ms_mesh_file_read(alloc, mesh->file, &read, &why);
  if (status) ms_error_set(err, status, "%s.file: %s", subject, why.text);
  else {
    arrays.nvertices = read.nvertices, arrays.vertices = read.vertices;
    arrays.nfaces = read.nfaces, arrays.faces = read.faces;
    status = make_surface(alloc, &arrays, subject, s, &why);
    if (status) ms_error_set(err, status, "%s.file: %s: %s", subject, mesh->file, why.text);
  }
  ms_mesh_file_free(alloc, &read);
  return status;
}

static msim_status make_parts(const msim_allocator *alloc, const msim_mesh *mesh,
                              const char *subject, ms_mesh *m, msim_error *err) {
  const msim_status status = mesh->file
                                 ? make_surface_of_file(alloc, mesh, subject, &m->surface, err)
                                 : make_surface(alloc, mesh, subject, &m->surface, err);
  if (status || mesh->fill == 0) return status;
  return ms_fill_create(alloc, &m->surface, mesh->fill, subject, &m->fill, err);
}

msim_status ms_mesh_make(const msim_allocator *alloc, const msim_mesh *mesh, const char *subject,
                         ms_shape *shape, msim_error *err) {
  if (!MS_NEW(alloc, shape->mesh, 1)) return ms_error_set_memory(err, "a mesh");
  shape->mesh->k = mesh->k, shape->mesh->bend = mesh->bend;
  const msim_status status = make_parts(alloc, mesh, subject, shape->mesh, err);
  return status ? status : count_parts(shape, subject, err);
}

void ms_mesh_destroy(const msim_allocator *alloc, ms_mesh *mesh) {
  if (!mesh) return;
  ms_surface_destroy(alloc, &mesh->surface);
  ms_fill_destroy(alloc, &mesh->fill);
  ms_memory_free(alloc, mesh);
}

static void add_count(int32_t count, int32_t *sum) {
  const int64_t total = (int64_t)*sum + count;
  *sum = total < INT32_MAX ? (int32_t)total : INT32_MAX;
}

void ms_mesh_add_repairs(const ms_mesh *mesh, msim_mesh_repairs *sum) {
  const msim_mesh_repairs *r = &mesh->surface.repairs;
  add_count(r->equal_vertices, &sum->equal_vertices);
  add_count(r->near_vertices, &sum->near_vertices);
  add_count(r->unused_vertices, &sum->unused_vertices);
  add_count(r->degenerate_faces, &sum->degenerate_faces);
  add_count(r->duplicate_faces, &sum->duplicate_faces);
  add_count(r->turned_faces, &sum->turned_faces);
  add_count(r->flat_faces, &sum->flat_faces);
  add_count(r->open_edges, &sum->open_edges);
  add_count(r->nonmanifold_edges, &sum->nonmanifold_edges);
}
