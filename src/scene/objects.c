#include "scene/objects.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/sized.h"
#include "scene/angles.h"

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

static void make_rope(const void *object, ms_grid *grid) {
  const msim_rope *rope = object;
  *grid = (ms_grid){.n = {rope->n, 1, 1},
                    .mass = rope->mass,
                    .k = {rope->k},
                    .damping = rope->damping,
                    .npinned = rope->npinned,
                    .pinned = rope->pinned,
                    .law = rope->law,
                    .bending = rope->bending};
  grid->has_last = rope->n > 1;
  memcpy(grid->last, rope->to, sizeof rope->to);
  memcpy(grid->origin, rope->from, sizeof rope->from);
  for (int c = 0; c < 3; c++) grid->edge[0][c] = rope->to[c] - rope->from[c];
  SET_SPRINGS(grid, rope_springs);
}

static void make_cloth(const void *object, ms_grid *grid) {
  const msim_cloth *cloth = object;
  *grid = (ms_grid){.n = {cloth->rows, cloth->columns, 1},
                    .mass = cloth->mass,
                    .k = {cloth->k_structural, cloth->k_shear, cloth->k_bend},
                    .damping = cloth->damping,
                    .npinned = cloth->npinned,
                    .pinned = cloth->pinned,
                    .law = cloth->law,
                    .bending = cloth->bending};
  memcpy(grid->origin, cloth->origin, sizeof cloth->origin);
  memcpy(grid->edge[0], cloth->row, sizeof cloth->row);
  memcpy(grid->edge[1], cloth->column, sizeof cloth->column);
  SET_SPRINGS(grid, cloth_springs);
}

static void make_lattice(const void *object, ms_grid *grid) {
  const msim_lattice *lattice = object;
  *grid = (ms_grid){.n = {lattice->n[0], lattice->n[1], lattice->n[2]},
                    .mass = lattice->mass,
                    .k = {lattice->k},
                    .damping = lattice->damping,
                    .npinned = lattice->npinned,
                    .pinned = lattice->pinned,
                    .law = lattice->law};
  memcpy(grid->origin, lattice->origin, sizeof lattice->origin);
  for (int c = 0; c < 3; c++) grid->edge[c][c] = lattice->extent[c];
  SET_SPRINGS(grid, lattice_springs);
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
         "a box of particles; springs along the axes and all diagonals of its cells")};
enum { ROPE, CLOTH, LATTICE, NTYPES };

const ms_object_type *ms_objects_get_type(int32_t i) {
  return i >= 0 && i < NTYPES ? &types[i] : NULL;
}

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status check_object_member(const ms_object_member *m, const void *object,
                                       const char *subject, msim_error *err) {
  const void *at = (const char *)object + m->offset;
  for (int32_t i = 0; i < m->key.count; i++) {
    double value =
        m->key.range >= MS_POSITIVE_INTEGER ? ((const int32_t *)at)[i] : ((const double *)at)[i];
    if (ms_range_contains(m->key.range, value)) continue;
    char index[16] = "";
    if (m->key.count > 1 && !m->names[1]) snprintf(index, sizeof index, "[%d]", i);
    return ms_error_set(err, MSIM_ERR_ARG, "%s.%s%s is %g; it must be %s", subject,
                        m->names[*index ? 0 : i], index, value, ms_range_text(m->key.range));
  }
  return MSIM_OK;
}

int32_t ms_objects_grid_size(const ms_grid *grid) { return grid->n[0] * grid->n[1] * grid->n[2]; }

static int64_t count_springs(const ms_grid *grid) {
  int64_t count = 0;
  for (int32_t t = 0; t < grid->nsprings; t++) {
    const ms_grid_spring *tie = &grid->springs[t];
    int64_t cells = grid->k[tie->stiffness] > 0;
    for (int d = 0; d < 3; d++) {
      int32_t room = grid->n[d] - (tie->offset[d] < 0 ? -tie->offset[d] : tie->offset[d]);
      cells *= room > 0 ? room : 0;
    }
    count += cells;
  }
  return count;
}

/* Check the limits of the scene before memory is allocated. */
static msim_status check_size(const ms_grid *grid, const char *subject, msim_error *err) {
  double size = (double)grid->n[0] * grid->n[1] * grid->n[2];
  if (size > INT32_MAX / 3)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.n gives %.0f particles; the limit is %d", subject,
                        size, INT32_MAX / 3);
  if (count_springs(grid) > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.n gives %lld springs; the limit is %d", subject,
                        (long long)count_springs(grid), INT32_MAX);
  if (!(grid->mass / size > 0))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%s.mass is %g, which is 0 for each of %.0f particles; it must be larger",
                        subject, grid->mass, size);
  for (int c = 0; c < 3; c++) {
    double reach = fabs(grid->origin[c]);
    for (int e = 0; e < 3; e++) reach += fabs(grid->edge[e][c]);
    if (!isfinite(reach))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s extends beyond the range of double; use smaller coordinates",
                          subject);
  }
  return MSIM_OK;
}

static msim_status check_pinned(const ms_grid *grid, const char *subject, msim_error *err) {
  if (grid->npinned < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.npinned is %d; it must be >= 0", subject,
                        grid->npinned);
  if (grid->npinned && !grid->pinned)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.pinned is NULL, but npinned is %d", subject,
                        grid->npinned);
  for (int32_t i = 0; i < grid->npinned; i++)
    if (grid->pinned[i] < 0 || grid->pinned[i] >= ms_objects_grid_size(grid))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s.pinned[%d] is %d; it must be a whole number from 0 to %d", subject, i,
                          grid->pinned[i], ms_objects_grid_size(grid) - 1);
  return MSIM_OK;
}

msim_status ms_objects_make_grid(const ms_object_type *type, const void *object,
                                 const char *subject, ms_grid *grid, msim_error *err) {
  ms_object full;
  msim_status status =
      ms_sized_check(object, type->size, type->least_size, type->name, subject, err);
  if (status) return status;
  ms_sized_read(&full, type->size, object);
  for (int32_t i = 0; i < type->nmembers && !status; i++)
    status = check_object_member(&type->members[i], &full, subject, err);
  if (status) return status;
  type->make(&full, grid);
  status = check_size(grid, subject, err);
  return status ? status : check_pinned(grid, subject, err);
}

/*------------------------------------- particles ------------------------------------------------*/

/* a/(n-1); 0 if n = 1. */
static double grid_fraction(int32_t a, int32_t n) { return n > 1 ? (double)a / (n - 1) : 0.0; }

static void place_particles(const ms_grid *grid, double *x) {
  double *last = x + 3 * (size_t)(ms_objects_grid_size(grid) - 1);
  for (int32_t a = 0; a < grid->n[0]; a++)
    for (int32_t b = 0; b < grid->n[1]; b++)
      for (int32_t c = 0; c < grid->n[2]; c++, x += 3)
        for (int i = 0; i < 3; i++)
          x[i] = grid->origin[i] + grid_fraction(a, grid->n[0]) * grid->edge[0][i] +
                 grid_fraction(b, grid->n[1]) * grid->edge[1][i] +
                 grid_fraction(c, grid->n[2]) * grid->edge[2][i];
  if (grid->has_last) memcpy(last, grid->last, sizeof grid->last);
}

/* Pin particles of the grid, by their indices in the scene. */
static msim_status pin_particles(msim_scene *scene, const ms_grid *grid, msim_error *err) {
  const msim_allocator *alloc = &scene->data->alloc;
  int32_t *pinned = ms_memory_allocate(alloc, (size_t)grid->npinned, sizeof *pinned);
  if (!pinned) return ms_error_set_memory(err, "an object");
  for (int32_t i = 0; i < grid->npinned; i++) pinned[i] = grid->first + grid->pinned[i];
  msim_status status = msim_scene_pin(scene, grid->npinned, pinned, err);
  ms_memory_free(alloc, pinned);
  return status;
}

msim_status ms_objects_add_particles(msim_scene *scene, ms_grid *grid, const char *subject,
                                     msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int32_t n = ms_objects_grid_size(grid), nlaws = scene->data->nlaws;
  if (grid->law > nlaws)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.law is %d; the scene has laws 0 (linear) to %d",
                        subject, grid->law, nlaws);
  if ((int64_t)scene->data->nparticles + n > INT32_MAX / 3)
    return ms_error_set(err, MSIM_ERR_ARG, "%s.n adds %d particles to %d; the limit is %d", subject,
                        n, scene->data->nparticles, INT32_MAX / 3);
  double *x = ms_memory_allocate(&alloc, (size_t)n, 4 * sizeof *x);
  if (!x) return ms_error_set_memory(err, "an object");
  double *mass = x + 3 * (size_t)n;
  place_particles(grid, x);
  for (int32_t i = 0; i < n; i++) mass[i] = grid->mass / n;
  grid->first = scene->data->nparticles;
  msim_status status = msim_scene_add_particles(scene, n, x, NULL, mass, err);
  ms_memory_free(&alloc, x);
  return status || !grid->npinned ? status : pin_particles(scene, grid, err);
}

/*------------------------------------- faces ----------------------------------------------------*/

/* A layer of cells, which the axes u and v span, at one index of the third axis, w. */
typedef struct grid_side {
  int u, v, w;
  int32_t at;
  int is_flipped; /* 1: its normal is against u x v */
} grid_side;

/* The sides of the grid whose faces are its surface: at both ends of each axis, or one if the grid
 * has one layer. Returns their number. */
static int list_sides(const ms_grid *grid, grid_side sides[6]) {
  int count = 0;
  for (int w = 0; w < 3; w++) {
    const int u = (w + 1) % 3, v = (w + 2) % 3;
    if (grid->n[u] < 2 || grid->n[v] < 2) continue;
    if (grid->n[w] > 1) sides[count++] = (grid_side){u, v, w, 0, 1};
    sides[count++] = (grid_side){u, v, w, grid->n[w] - 1, 0};
  }
  return count;
}

static int64_t count_side_faces(const ms_grid *grid, const grid_side *s) {
  return 2 * ((int64_t)grid->n[s->u] - 1) * (grid->n[s->v] - 1);
}

/* Two triangles for each cell. Returns the end of their corners. */
static int32_t *list_side_faces(const ms_grid *grid, const grid_side *s, int32_t *corner) {
  const int32_t stride[3] = {grid->n[1] * grid->n[2], grid->n[2], 1};
  const int32_t along = stride[s->is_flipped ? s->v : s->u],
                across = stride[s->is_flipped ? s->u : s->v];
  for (int32_t i = 0; i < grid->n[s->u] - 1; i++)
    for (int32_t j = 0; j < grid->n[s->v] - 1; j++) {
      const int32_t p = grid->first + s->at * stride[s->w] + i * stride[s->u] + j * stride[s->v];
      const int32_t cell[] = {p, p + along, p + along + across, p, p + along + across, p + across};
      memcpy(corner, cell, sizeof cell);
      corner += 6;
    }
  return corner;
}

msim_status ms_objects_add_faces(msim_scene *scene, const ms_grid *grid, msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  grid_side sides[6];
  const int nsides = list_sides(grid, sides);
  int64_t count = 0;
  for (int i = 0; i < nsides; i++) count += count_side_faces(grid, &sides[i]);
  if (scene->data->nfaces + count > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%lld faces exceed the limit of %d",
                        (long long)(scene->data->nfaces + count), INT32_MAX);
  int32_t *corners = ms_memory_allocate(&alloc, (size_t)count, 3 * sizeof *corners), *end = corners;
  if (!corners) return ms_error_set_memory(err, "an object");
  for (int i = 0; i < nsides; i++) end = list_side_faces(grid, &sides[i], end);
  const msim_status status = msim_scene_add_faces(scene, (int32_t)count, corners, err);
  ms_memory_free(&alloc, corners);
  return status;
}

/*------------------------------------- angular springs ------------------------------------------*/

static int64_t count_angles(const ms_grid *grid) {
  int64_t count = 0;
  for (int d = 0; d < 2 && grid->bending > 0; d++)
    if (grid->n[d] > 2) count += ms_objects_grid_size(grid) / grid->n[d] * (grid->n[d] - 2);
  return count;
}

/* Particle by particle, those of its rows first */
static void list_angles(const ms_grid *grid, int32_t *ijk) {
  const int32_t step[2] = {grid->n[1] * grid->n[2], grid->n[2]};
  for (int32_t p = 0; p < ms_objects_grid_size(grid); p++)
    for (int d = 0; d < 2; d++) {
      const int32_t at = p / step[d] % grid->n[d];
      if (at == 0 || at == grid->n[d] - 1 || grid->n[d] == 1) continue;
      for (int32_t corner = -1; corner <= 1; corner++) *ijk++ = grid->first + p + corner * step[d];
    }
}

static msim_status add_angles(msim_scene *scene, const ms_grid *grid, msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int64_t count = count_angles(grid);
  if (count > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%lld angles exceed the limit of %d", (long long)count,
                        INT32_MAX);
  double *k = ms_memory_allocate(&alloc, (size_t)count, 2 * sizeof *k + 3 * sizeof(int32_t));
  if (!k) return ms_error_set_memory(err, "an object");
  double *rest = k + count;
  int32_t *ijk = (int32_t *)(rest + count);
  for (int64_t e = 0; e < count; e++) k[e] = grid->bending, rest[e] = MS_PI;
  if (count) list_angles(grid, ijk);
  const msim_status status = msim_scene_add_angles(scene, (int32_t)count, ijk, k, rest, NULL, err);
  ms_memory_free(&alloc, k);
  return status;
}

/*------------------------------------- springs --------------------------------------------------*/

/* The particle at the other end of a spring from particle (a, b, c) = at; -1: outside the grid. */
static int32_t find_neighbour(const ms_grid *grid, const ms_grid_spring *tie, const int32_t at[3]) {
  int32_t p = 0;
  for (int d = 0; d < 3; d++) {
    int32_t i = at[d] + tie->offset[d];
    if (i < 0 || i >= grid->n[d]) return -1;
    p = p * grid->n[d] + i;
  }
  return p;
}

static void list_springs(const ms_grid *grid, int32_t *ij, double *k) {
  int32_t p = grid->first, at[3];
  for (at[0] = 0; at[0] < grid->n[0]; at[0]++)
    for (at[1] = 0; at[1] < grid->n[1]; at[1]++)
      for (at[2] = 0; at[2] < grid->n[2]; at[2]++, p++)
        for (int32_t t = 0; t < grid->nsprings; t++) {
          int32_t q = find_neighbour(grid, &grid->springs[t], at);
          if (q < 0 || grid->k[grid->springs[t].stiffness] == 0) continue;
          *ij++ = p;
          *ij++ = grid->first + q;
          *k++ = grid->k[grid->springs[t].stiffness];
        }
}

msim_status ms_objects_add_springs(msim_scene *scene, const ms_grid *grid, msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int64_t count = count_springs(grid), first = scene->data->nsprings;
  double *k = ms_memory_allocate(&alloc, (size_t)count, 2 * sizeof *k + 2 * sizeof(int32_t));
  if (!k) return ms_error_set_memory(err, "an object");
  double *damping = k + count;
  int32_t *ij = (int32_t *)(damping + count);
  list_springs(grid, ij, k);
  for (int64_t e = 0; e < count; e++) damping[e] = grid->damping;
  msim_status status = msim_scene_add_springs(scene, (int32_t)count, ij, k, NULL, damping, err);
  for (int32_t e = 0; e < count && !status && grid->law; e++) ij[e] = (int32_t)first + e;
  if (!status && grid->law) status = msim_scene_set_law(scene, (int32_t)count, ij, grid->law, err);
  ms_memory_free(&alloc, k);
  return status ? status : add_angles(scene, grid, err);
}

/*------------------------------------- public ---------------------------------------------------*/

static msim_status add_object(msim_scene *scene, const ms_object_type *type, const void *object,
                              msim_error *err) {
  if (!scene || !object) return ms_error_set(err, MSIM_ERR_ARG, "scene or %s is NULL", type->name);
  ms_grid grid;
  msim_status status = ms_objects_make_grid(type, object, type->name, &grid, err);
  if (status) return status;
  const int32_t nparticles = scene->data->nparticles, nfaces = scene->data->nfaces;
  const int32_t nsprings = scene->data->nsprings;
  status = ms_objects_add_particles(scene, &grid, type->name, err);
  if (!status) status = ms_objects_add_faces(scene, &grid, err);
  if (!status) status = ms_objects_add_springs(scene, &grid, err);
  /* data that are shared have the old numbers already, and must not be written to */
  if (status && scene->data->nparticles > nparticles)
    scene->data->nparticles = nparticles, scene->data->nfaces = nfaces,
    scene->data->nsprings = nsprings;
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
