#include "scene/objects.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/sized.h"
#include "scene/angles.h"
#include "scene/mesh.h"

/*------------------------------------- types ----------------------------------------------------*/

static const ms_grid_spring rope_springs[] = {{{1, 0, 0}, 0}};

/* to the right, down, down-right, down-left, two right, two down: structural, shear, bend */
static const ms_grid_spring cloth_springs[] = {{{0, 1, 0}, 0},  {{1, 0, 0}, 0}, {{1, 1, 0}, 1},
                                               {{1, -1, 0}, 1}, {{0, 2, 0}, 2}, {{2, 0, 0}, 2}};

static const ms_grid_spring lattice_springs[] = {
    {{1, 0, 0}, 0},  {{0, 1, 0}, 0},  {{0, 0, 1}, 0},  {{1, 1, 0}, 0},  {{1, -1, 0}, 0},
    {{1, 0, 1}, 0},  {{1, 0, -1}, 0}, {{0, 1, 1}, 0},  {{0, 1, -1}, 0}, {{1, 1, 1}, 0},
    {{1, 1, -1}, 0}, {{1, -1, 1}, 0}, {{1, -1, -1}, 0}};

#define SET_SPRINGS(grid, table) \
  ((grid)->springs = table, (grid)->nsprings = (int32_t)(sizeof(table) / sizeof *(table)))

/* The members that all structs have */
#define MAKE_SHAPE(object)                                                              \
  (ms_shape) {                                                                          \
    .mass = (object)->mass, .damping = (object)->damping, .npinned = (object)->npinned, \
    .pinned = (object)->pinned, .law = (object)->law                                    \
  }

static msim_status make_rope(const msim_allocator *alloc, const void *object, const char *subject,
                             ms_shape *shape, msim_error *err) {
  const msim_rope *rope = object;
  ms_grid *grid = &shape->grid;
  (void)alloc;
  *shape = MAKE_SHAPE(rope);
  shape->bending = rope->bending;
  *grid = (ms_grid){.n = {rope->n, 1, 1}, .k = {rope->k}};
  grid->has_last = rope->n > 1;
  memcpy(grid->last, rope->to, sizeof rope->to);
  memcpy(grid->origin, rope->from, sizeof rope->from);
  for (int c = 0; c < 3; c++) grid->edge[0][c] = rope->to[c] - rope->from[c];
  SET_SPRINGS(grid, rope_springs);
  return ms_grid_count(shape, subject, err);
}

static msim_status make_cloth(const msim_allocator *alloc, const void *object, const char *subject,
                              ms_shape *shape, msim_error *err) {
  const msim_cloth *cloth = object;
  ms_grid *grid = &shape->grid;
  (void)alloc;
  *shape = MAKE_SHAPE(cloth);
  shape->bending = cloth->bending;
  *grid = (ms_grid){.n = {cloth->rows, cloth->columns, 1},
                    .k = {cloth->k_structural, cloth->k_shear, cloth->k_bend}};
  memcpy(grid->origin, cloth->origin, sizeof cloth->origin);
  memcpy(grid->edge[0], cloth->row, sizeof cloth->row);
  memcpy(grid->edge[1], cloth->column, sizeof cloth->column);
  SET_SPRINGS(grid, cloth_springs);
  return ms_grid_count(shape, subject, err);
}

static msim_status make_lattice(const msim_allocator *alloc, const void *object,
                                const char *subject, ms_shape *shape, msim_error *err) {
  const msim_lattice *lattice = object;
  ms_grid *grid = &shape->grid;
  (void)alloc;
  *shape = MAKE_SHAPE(lattice);
  *grid = (ms_grid){.n = {lattice->n[0], lattice->n[1], lattice->n[2]}, .k = {lattice->k}};
  memcpy(grid->origin, lattice->origin, sizeof lattice->origin);
  for (int c = 0; c < 3; c++) grid->edge[c][c] = lattice->extent[c];
  SET_SPRINGS(grid, lattice_springs);
  return ms_grid_count(shape, subject, err);
}

static msim_status make_mesh(const msim_allocator *alloc, const void *object, const char *subject,
                             ms_shape *shape, msim_error *err) {
  const msim_mesh *mesh = object;
  *shape = MAKE_SHAPE(mesh);
  return ms_mesh_make(alloc, mesh, subject, shape, err);
}

/* A row of numbers in one member of the struct, for which all types use the same words */
#define ROW(type, key, member, range, count, preset, unit, doc, example)            \
  {                                                                                 \
    {key, MS_NUMBERS, range, count, preset, unit, doc, example}, {#member}, {NULL}, \
        offsetof(type, member)                                                      \
  }
#define MASS(type)                                    \
  ROW(type, "mass", mass, MS_POSITIVE, 1, NULL, "kg", \
      "total mass, of which each particle has an equal share", "0.5")
#define STIFFNESS(type)                                                                        \
  ROW(type, "k", k, MS_NOT_NEGATIVE, 1, NULL, "N/m", "constant of each spring; 0: no springs", \
      "1000")
#define DAMPING(type)                                             \
  ROW(type, "damping", damping, MS_NOT_NEGATIVE, 1, "0", "N s/m", \
      "damping constant of each spring", "0.1")
#define LAW(type)                             \
  ROW(type, "law", law, MS_INDEX, 1, "0", "", \
      "number of the law of its springs (`laws`); 0: linear", "1")

#define BENDING(type, where)                                          \
  ROW(type, "bending", bending, MS_NOT_NEGATIVE, 1, "0", "N m/rad^2", \
      "stiffness of angular springs, straight at rest, " where "; 0: none", "0.01")

static const ms_object_member rope_members[] = {
    ROW(msim_rope, "n", n, MS_POSITIVE_INTEGER, 1, NULL, "", "number of particles", "20"),
    ROW(msim_rope, "from", from, MS_ANY, 3, NULL, "m", "position of the first particle",
        "[0, 0, 1]"),
    ROW(msim_rope, "to", to, MS_ANY, 3, NULL, "m", "position of the last particle", "[1, 0, 1]"),
    MASS(msim_rope),
    STIFFNESS(msim_rope),
    DAMPING(msim_rope),
    LAW(msim_rope),
    BENDING(msim_rope, "at the inner particles")};

static const ms_object_member cloth_members[] = {
    {{"n", MS_NUMBERS, MS_POSITIVE_INTEGER, 2, NULL, "", "numbers of rows and columns of particles",
      "[16, 16]"},
     {"rows", "columns"},
     {NULL},
     offsetof(msim_cloth, rows)},
    ROW(msim_cloth, "origin", origin, MS_ANY, 3, NULL, "m", "position of the first particle",
        "[0, 0, 1]"),
    ROW(msim_cloth, "row", row, MS_ANY, 3, NULL, "m", "vector from the first row to the last one",
        "[0, 1, 0]"),
    ROW(msim_cloth, "column", column, MS_ANY, 3, NULL, "m",
        "vector from the first column to the last one", "[1, 0, 0]"),
    MASS(msim_cloth),
    {{"k", MS_NUMBER_OR_PARTS, MS_NOT_NEGATIVE, 3, NULL, "N/m",
      "spring constants: along rows and columns (structural), across the diagonals (shear), and "
      "between every other particle (bend); 0: no such springs",
      "{\"structural\": 500, \"shear\": 250, \"bend\": 50}"},
     {"k_structural", "k_shear", "k_bend"},
     {"structural", "shear", "bend"},
     offsetof(msim_cloth, k_structural)},
    DAMPING(msim_cloth),
    LAW(msim_cloth),
    BENDING(msim_cloth, "along rows and columns")};

static const ms_object_member lattice_members[] = {
    ROW(msim_lattice, "n", n, MS_POSITIVE_INTEGER, 3, NULL, "",
        "numbers of particles along x, y and z", "[4, 4, 4]"),
    ROW(msim_lattice, "origin", origin, MS_ANY, 3, NULL, "m", "position of the first particle",
        "[0, 0, 1]"),
    ROW(msim_lattice, "size", extent, MS_NOT_NEGATIVE, 3, NULL, "m", "lengths along x, y and z",
        "[0.3, 0.3, 0.3]"),
    MASS(msim_lattice),
    STIFFNESS(msim_lattice),
    DAMPING(msim_lattice),
    LAW(msim_lattice)};

static const ms_object_member mesh_members[] = {
    {{"file", MS_TEXT, MS_ANY, 0, NULL, "",
      "mesh of triangles or polygons, relative to the folder of the scene file: .obj, .stl, .ply, "
      ".gltf, .glb (plugin assimp), or the extension of an importer of your own",
      "\"cow.obj\""},
     {"file"},
     {NULL},
     offsetof(msim_mesh, file)},
    ROW(msim_mesh, "scale", scale, MS_POSITIVE, 1, "1", "m", "length of one unit of the file",
        "0.001"),
    ROW(msim_mesh, "translate", translate, MS_ANY, 3, "[0, 0, 0]", "m",
        "added to the scaled vertices", "[0, 0, 1]"),
    MASS(msim_mesh),
    ROW(msim_mesh, "k", k, MS_NOT_NEGATIVE, 1, NULL, "N/m",
        "constant of the springs along edges and inside; 0: none", "1000"),
    ROW(msim_mesh, "bend", bend, MS_NOT_NEGATIVE, 1, "0", "N/m",
        "constant of a spring between the two vertices opposite each edge; 0: none", "100"),
    {{"fill", MS_FLAG_OR_NUMBER, MS_POSITIVE, 1, "false", "m",
      "spacing of a lattice inside the closed surface, tied to it, which makes a soft body; true: "
      "a sixth of the shortest edge of its bounding box",
      "true"},
     {"fill"},
     {NULL},
     offsetof(msim_mesh, fill)},
    DAMPING(msim_mesh),
    LAW(msim_mesh)};

#define TYPE(word, pinned_key, description)                                          \
  {                                                                                  \
    .name = #word, .size = sizeof(msim_##word),                                      \
    .least_size = MS_SIZE_THROUGH(msim_##word, pinned), .members = word##_members,   \
    .nmembers = sizeof word##_members / sizeof *word##_members, .make = make_##word, \
    .pinned = &pinned_key, .doc = description                                        \
  }

static const ms_object_type types[] = {
    TYPE(rope, ms_pinned_key, "n particles on a line and n - 1 springs"),
    TYPE(cloth, ms_cloth_pinned_key,
         "rows of particles; springs to the next and to the second particle of the row and of the "
         "column, and across the diagonals"),
    TYPE(lattice, ms_pinned_key,
         "a box of particles; springs along the axes and all diagonals of its cells"),
    TYPE(mesh, ms_pinned_key,
         "a particle at each vertex of a surface and a spring along each edge; a soft body, if "
         "filled")};
enum { ROPE, CLOTH, LATTICE, MESH, NTYPES };

const ms_object_type *ms_objects_get_type(int32_t i) {
  return i >= 0 && i < NTYPES ? &types[i] : NULL;
}

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status check_object_member(const ms_object_member *m, const void *object,
                                       const char *subject, msim_error *err) {
  const void *at = (const char *)object + m->offset;
  if (m->key.form == MS_TEXT) return MSIM_OK;
  for (int32_t i = 0; i < m->key.count; i++) {
    double value =
        m->key.range >= MS_POSITIVE_INTEGER ? ((const int32_t *)at)[i] : ((const double *)at)[i];
    if (ms_range_contains(m->key.range, value)) continue;
    if (m->key.preset && value == 0) continue; /* not set */
    if (m->key.form == MS_FLAG_OR_NUMBER && value == MSIM_FILL_AUTO) continue;
    char index[16] = "";
    if (m->key.count > 1 && !m->names[1]) snprintf(index, sizeof index, "[%d]", i);
    return ms_error_set(err, MSIM_ERR_ARG, "%s.%s%s is %g; it must be %s", subject,
                        m->names[*index ? 0 : i], index, value, ms_range_text(m->key.range));
  }
  return MSIM_OK;
}

/* Each particle has an equal share of the mass. */
static msim_status check_share(const ms_shape *shape, const char *subject, msim_error *err) {
  if (shape->mass / shape->nparticles > 0) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "%s.mass is %g, which is 0 for each of %d particles; it must be larger",
                      subject, shape->mass, shape->nparticles);
}

static msim_status check_pinned(const ms_shape *shape, const char *subject, msim_error *err) {
  if (shape->npinned < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.npinned is %d; it must be >= 0", subject,
                        shape->npinned);
  if (shape->npinned && !shape->pinned)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.pinned is NULL, but npinned is %d", subject,
                        shape->npinned);
  for (int32_t i = 0; i < shape->npinned; i++)
    if (shape->pinned[i] < 0 || shape->pinned[i] >= shape->nparticles)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s.pinned[%d] is %d; it must be a whole number from 0 to %d", subject, i,
                          shape->pinned[i], shape->nparticles - 1);
  return MSIM_OK;
}

msim_status ms_objects_make_shape(const msim_allocator *alloc, const ms_object_type *type,
                                  const void *object, const char *subject, ms_shape *shape,
                                  msim_error *err) {
  ms_object full;
  *shape = (ms_shape){0};
  msim_status status =
      ms_sized_check(object, type->size, type->least_size, type->name, subject, err);
  if (status) return status;
  ms_sized_read(&full, type->size, object);
  for (int32_t i = 0; i < type->nmembers && !status; i++)
    status = check_object_member(&type->members[i], &full, subject, err);
  if (!status) status = type->make(alloc, &full, subject, shape, err);
  if (!status) status = check_share(shape, subject, err);
  return status ? status : check_pinned(shape, subject, err);
}

void ms_objects_free_shape(const msim_allocator *alloc, ms_shape *shape) {
  ms_mesh_destroy(alloc, shape->mesh);
}

/*------------------------------------- parts ----------------------------------------------------*/

/* Indices within the object become those of the scene. */
static void shift_indices(const ms_shape *shape, int64_t n, int32_t *index) {
  for (int64_t i = 0; i < n; i++) index[i] += shape->first;
}

/* Pin particles of the object, by their indices in the scene. */
static msim_status pin_particles(msim_scene *scene, const ms_shape *shape, msim_error *err) {
  const msim_allocator *alloc = &scene->data->alloc;
  int32_t *pinned = ms_memory_allocate(alloc, (size_t)shape->npinned, sizeof *pinned);
  if (!pinned) return ms_error_set_memory(err, "an object");
  memcpy(pinned, shape->pinned, (size_t)shape->npinned * sizeof *pinned);
  shift_indices(shape, shape->npinned, pinned);
  msim_status status = msim_scene_pin(scene, shape->npinned, pinned, err);
  ms_memory_free(alloc, pinned);
  return status;
}

msim_status ms_objects_add_particles(msim_scene *scene, ms_shape *shape, const char *subject,
                                     msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int32_t n = shape->nparticles, nlaws = scene->data->nlaws;
  if (shape->law > nlaws)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.law is %d; the scene has laws 0 (linear) to %d",
                        subject, shape->law, nlaws);
  if ((int64_t)scene->data->nparticles + n > INT32_MAX / 3)
    return ms_error_set(err, MSIM_ERR_ARG, "%s adds %d particles to %d; the limit is %d", subject,
                        n, scene->data->nparticles, INT32_MAX / 3);
  double *x = ms_memory_allocate(&alloc, (size_t)n, 4 * sizeof *x);
  if (!x) return ms_error_set_memory(err, "an object");
  double *mass = x + 3 * (size_t)n;
  shape->lists->place_particles(shape, x);
  for (int32_t i = 0; i < n; i++) mass[i] = shape->mass / n;
  shape->first = scene->data->nparticles;
  msim_status status = msim_scene_add_particles(scene, n, x, NULL, mass, err);
  ms_memory_free(&alloc, x);
  if (!status && shape->mesh) scene->data->planes_constrain = 1;
  return status || !shape->npinned ? status : pin_particles(scene, shape, err);
}

msim_status ms_objects_add_faces(msim_scene *scene, const ms_shape *shape, msim_error *err) {
  const int64_t count = shape->nfaces;
  if (scene->data->nfaces + count > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%lld faces exceed the limit of %d",
                        (long long)(scene->data->nfaces + count), INT32_MAX);
  const msim_status status = ms_scene_begin_faces(scene, (int32_t)count, err);
  if (status) return status;
  int32_t *corners = scene->data->faces + 3 * (size_t)scene->data->nfaces;
  shape->lists->list_faces(shape, corners);
  shift_indices(shape, 3 * count, corners);
  return ms_scene_end_faces(scene->data, (int32_t)count, err);
}

/* They are straight at rest. */
static msim_status add_angles(msim_scene *scene, const ms_shape *shape, msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int64_t count = shape->nangles;
  if (count == 0) return MSIM_OK;
  double *k = ms_memory_allocate(&alloc, (size_t)count, 2 * sizeof *k + 3 * sizeof(int32_t));
  if (!k) return ms_error_set_memory(err, "an object");
  double *rest = k + count;
  int32_t *ijk = (int32_t *)(rest + count);
  for (int64_t e = 0; e < count; e++) k[e] = shape->bending, rest[e] = MS_PI;
  shape->lists->list_angles(shape, ijk);
  shift_indices(shape, 3 * count, ijk);
  const msim_status status = msim_scene_add_angles(scene, (int32_t)count, ijk, k, rest, NULL, err);
  ms_memory_free(&alloc, k);
  return status;
}

/* Of the last springs of the scene */
static msim_status set_law(msim_scene *scene, const ms_shape *shape, msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int32_t count = (int32_t)shape->nsprings, first = scene->data->nsprings - count;
  int32_t *springs = ms_memory_allocate(&alloc, (size_t)count, sizeof *springs);
  if (!springs) return ms_error_set_memory(err, "an object");
  for (int32_t e = 0; e < count; e++) springs[e] = first + e;
  const msim_status status = msim_scene_set_law(scene, count, springs, shape->law, err);
  ms_memory_free(&alloc, springs);
  return status;
}

msim_status ms_objects_add_springs(msim_scene *scene, const ms_shape *shape, msim_error *err) {
  const int32_t count = (int32_t)shape->nsprings;
  msim_status status = ms_scene_begin_springs(scene, count, err);
  if (status) return status;
  ms_scene *s = scene->data;
  const size_t at = (size_t)s->nsprings;
  shape->lists->list_springs(shape, s->ij + 2 * at, s->k + at);
  shift_indices(shape, 2 * (int64_t)count, s->ij + 2 * at);
  for (size_t e = at; e < at + (size_t)count; e++) s->damping[e] = shape->damping;
  status = ms_scene_end_springs(s, count, 0, err);
  if (!status && shape->law) status = set_law(scene, shape, err);
  if (!status) status = add_angles(scene, shape, err);
  if (!status && shape->mesh) ms_mesh_add_repairs(shape->mesh, &scene->data->repairs);
  return status;
}

/*------------------------------------- public ---------------------------------------------------*/

static msim_status add_shape(msim_scene *scene, ms_shape *shape, const char *subject,
                             msim_error *err) {
  const int32_t nparticles = scene->data->nparticles, nfaces = scene->data->nfaces;
  const int32_t nsprings = scene->data->nsprings;
  const int32_t planes_constrain = scene->data->planes_constrain;
  msim_status status = ms_objects_add_particles(scene, shape, subject, err);
  if (!status) status = ms_objects_add_faces(scene, shape, err);
  if (!status) status = ms_objects_add_springs(scene, shape, err);
  /* data that are shared have the old numbers already, and must not be written to */
  if (status && scene->data->nparticles > nparticles)
    scene->data->nparticles = nparticles, scene->data->nfaces = nfaces,
    scene->data->nsprings = nsprings, scene->data->planes_constrain = planes_constrain;
  return status;
}

static msim_status add_object(msim_scene *scene, const ms_object_type *type, const void *object,
                              msim_error *err) {
  if (!scene || !object) return ms_error_set(err, MSIM_ERR_ARG, "scene or %s is NULL", type->name);
  ms_shape shape;
  const msim_allocator alloc = scene->data->alloc;
  msim_status status = ms_objects_make_shape(&alloc, type, object, type->name, &shape, err);
  if (!status) status = add_shape(scene, &shape, type->name, err);
  ms_objects_free_shape(&alloc, &shape);
  return status;
}

msim_status msim_scene_add_rope(msim_scene *scene, const msim_rope *rope, msim_error *err) {
  return add_object(scene, &types[ROPE], rope, err);
}

msim_status msim_scene_add_cloth(msim_scene *scene, const msim_cloth *cloth, msim_error *err) {
  return add_object(scene, &types[CLOTH], cloth, err);
}

msim_status msim_scene_add_lattice(msim_scene *scene, const msim_lattice *lattice,
                                   msim_error *err) {
  return add_object(scene, &types[LATTICE], lattice, err);
}

msim_status msim_scene_add_mesh(msim_scene *scene, const msim_mesh *mesh, msim_error *err) {
  return add_object(scene, &types[MESH], mesh, err);
}

msim_status msim_scene_mesh_repairs(const msim_scene *scene, msim_mesh_repairs *repairs) {
  if (!scene || !repairs) return MSIM_ERR_ARG;
  return ms_sized_write(repairs, &scene->data->repairs, sizeof scene->data->repairs);
}
