#include "scene/objects.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/*------------------------------------- ranges ---------------------------------------------------*/

int ms_in_range(ms_range range, double value) {
  if (!isfinite(value)) return 0;
  switch (range) {
    case MS_NOT_NEGATIVE:
      return value >= 0;
    case MS_POSITIVE:
      return value > 0;
    case MS_FRACTION:
      return value >= 0 && value <= 1;
    case MS_COUNT:
      return value >= 1 && value <= INT32_MAX && value == floor(value);
    case MS_ANY:
    default:
      return 1;
  }
}

const char *ms_range_text(ms_range range) {
  static const char *const texts[] = {[MS_ANY] = "a finite number",
                                      [MS_NOT_NEGATIVE] = "a finite number >= 0",
                                      [MS_POSITIVE] = "a finite number > 0",
                                      [MS_FRACTION] = "a number in [0, 1]",
                                      [MS_COUNT] = "a whole number from 1 to 2147483647"};
  return texts[range];
}

/*------------------------------------- types ----------------------------------------------------*/

static const ms_tie rope_ties[] = {{{1, 0, 0}, 0}};

/* to the right, down, down-right, down-left, two right, two down: structural, shear, bend */
static const ms_tie cloth_ties[] = {{{0, 1, 0}, 0},  {{1, 0, 0}, 0}, {{1, 1, 0}, 1},
                                    {{1, -1, 0}, 1}, {{0, 2, 0}, 2}, {{2, 0, 0}, 2}};

static const ms_tie lattice_ties[] = {
    {{1, 0, 0}, 0},  {{0, 1, 0}, 0},  {{0, 0, 1}, 0},  {{1, 1, 0}, 0},  {{1, -1, 0}, 0},
    {{1, 0, 1}, 0},  {{1, 0, -1}, 0}, {{0, 1, 1}, 0},  {{0, 1, -1}, 0}, {{1, 1, 1}, 0},
    {{1, 1, -1}, 0}, {{1, -1, 1}, 0}, {{1, -1, -1}, 0}};

#define TIES(grid, table) \
  ((grid)->ties = table, (grid)->nties = (int32_t)(sizeof(table) / sizeof *(table)))

static void make_rope(const void *object, ms_grid *grid) {
  const msim_rope *rope = object;
  *grid = (ms_grid){.n = {rope->n, 1, 1},
                    .mass = rope->mass,
                    .k = {rope->k},
                    .damping = rope->damping,
                    .npinned = rope->npinned,
                    .pinned = rope->pinned};
  if (rope->n > 1) grid->last = rope->to;
  memcpy(grid->origin, rope->from, sizeof rope->from);
  for (int c = 0; c < 3; c++) grid->edge[0][c] = rope->to[c] - rope->from[c];
  TIES(grid, rope_ties);
}

static void make_cloth(const void *object, ms_grid *grid) {
  const msim_cloth *cloth = object;
  *grid = (ms_grid){.n = {cloth->rows, cloth->columns, 1},
                    .mass = cloth->mass,
                    .k = {cloth->k_structural, cloth->k_shear, cloth->k_bend},
                    .damping = cloth->damping,
                    .npinned = cloth->npinned,
                    .pinned = cloth->pinned};
  memcpy(grid->origin, cloth->origin, sizeof cloth->origin);
  memcpy(grid->edge[0], cloth->row, sizeof cloth->row);
  memcpy(grid->edge[1], cloth->column, sizeof cloth->column);
  TIES(grid, cloth_ties);
}

static void make_lattice(const void *object, ms_grid *grid) {
  const msim_lattice *lattice = object;
  *grid = (ms_grid){.n = {lattice->n[0], lattice->n[1], lattice->n[2]},
                    .mass = lattice->mass,
                    .k = {lattice->k},
                    .damping = lattice->damping,
                    .npinned = lattice->npinned,
                    .pinned = lattice->pinned};
  memcpy(grid->origin, lattice->origin, sizeof lattice->origin);
  for (int c = 0; c < 3; c++) grid->edge[c][c] = lattice->extent[c];
  TIES(grid, lattice_ties);
}

#define MEMBER(type, key, name, range, count) \
  { key, {#name}, {NULL}, range, count, offsetof(type, name), 0 }
#define DAMPING(type) \
  { "damping", {"damping"}, {NULL}, MS_NOT_NEGATIVE, 1, offsetof(type, damping), 1 }

static const ms_member rope_members[] = {
    MEMBER(msim_rope, "n", n, MS_COUNT, 1),        MEMBER(msim_rope, "from", from, MS_ANY, 3),
    MEMBER(msim_rope, "to", to, MS_ANY, 3),        MEMBER(msim_rope, "mass", mass, MS_POSITIVE, 1),
    MEMBER(msim_rope, "k", k, MS_NOT_NEGATIVE, 1), DAMPING(msim_rope)};

static const ms_member cloth_members[] = {
    {"n", {"rows", "columns"}, {NULL}, MS_COUNT, 2, offsetof(msim_cloth, rows), 0},
    MEMBER(msim_cloth, "origin", origin, MS_ANY, 3),
    MEMBER(msim_cloth, "row", row, MS_ANY, 3),
    MEMBER(msim_cloth, "column", column, MS_ANY, 3),
    MEMBER(msim_cloth, "mass", mass, MS_POSITIVE, 1),
    {"k",
     {"k_structural", "k_shear", "k_bend"},
     {"structural", "shear", "bend"},
     MS_NOT_NEGATIVE,
     3,
     offsetof(msim_cloth, k_structural),
     0},
    DAMPING(msim_cloth)};

static const ms_member lattice_members[] = {
    MEMBER(msim_lattice, "n", n, MS_COUNT, 3),
    MEMBER(msim_lattice, "origin", origin, MS_ANY, 3),
    MEMBER(msim_lattice, "size", extent, MS_NOT_NEGATIVE, 3),
    MEMBER(msim_lattice, "mass", mass, MS_POSITIVE, 1),
    MEMBER(msim_lattice, "k", k, MS_NOT_NEGATIVE, 1),
    DAMPING(msim_lattice)};

#define TYPE(word)                                                                  \
  {                                                                                 \
    .name = #word, .size = sizeof(msim_##word), .members = word##_members,          \
    .nmembers = sizeof word##_members / sizeof *word##_members, .make = make_##word \
  }

static const ms_object_type types[] = {TYPE(rope), TYPE(cloth), TYPE(lattice)};
enum { ROPE, CLOTH, LATTICE, NTYPES };

const ms_object_type *ms_object_type_info(int32_t i) {
  return i >= 0 && i < NTYPES ? &types[i] : NULL;
}

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status check_member(const ms_member *m, const void *object, const char *subject,
                                msim_error *err) {
  const void *at = (const char *)object + m->offset;
  for (int32_t i = 0; i < m->count; i++) {
    double value = m->range == MS_COUNT ? ((const int32_t *)at)[i] : ((const double *)at)[i];
    if (ms_in_range(m->range, value)) continue;
    char index[16] = "";
    if (m->count > 1 && !m->names[1]) snprintf(index, sizeof index, "[%d]", i);
    return ms_fail(err, MSIM_ERR_ARG, "%s.%s%s is %g; it must be %s", subject,
                   m->names[*index ? 0 : i], index, value, ms_range_text(m->range));
  }
  return MSIM_OK;
}

int32_t ms_grid_size(const ms_grid *grid) { return grid->n[0] * grid->n[1] * grid->n[2]; }

static int64_t count_springs(const ms_grid *grid) {
  int64_t count = 0;
  for (int32_t t = 0; t < grid->nties; t++) {
    const ms_tie *tie = &grid->ties[t];
    int64_t cells = grid->k[tie->law] > 0;
    for (int d = 0; d < 3; d++) {
      int32_t room = grid->n[d] - (tie->step[d] < 0 ? -tie->step[d] : tie->step[d]);
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
    return ms_fail(err, MSIM_ERR_ARG, "%s.n makes %.0f particles; the limit is %d", subject, size,
                   INT32_MAX / 3);
  if (count_springs(grid) > INT32_MAX)
    return ms_fail(err, MSIM_ERR_ARG, "%s.n makes %lld springs; the limit is %d", subject,
                   (long long)count_springs(grid), INT32_MAX);
  if (!(grid->mass / size > 0))
    return ms_fail(err, MSIM_ERR_ARG, "%s.mass is %g; each of %.0f particles must get more than 0",
                   subject, grid->mass, size);
  for (int c = 0; c < 3; c++) {
    double reach = fabs(grid->origin[c]);
    for (int e = 0; e < 3; e++) reach += fabs(grid->edge[e][c]);
    if (!isfinite(reach))
      return ms_fail(err, MSIM_ERR_ARG, "%s reaches farther than a double can say", subject);
  }
  return MSIM_OK;
}

static msim_status check_pinned(const ms_grid *grid, const char *subject, msim_error *err) {
  if (grid->npinned < 0)
    return ms_fail(err, MSIM_ERR_ARG, "%s.npinned is %d; it must be >= 0", subject, grid->npinned);
  if (grid->npinned && !grid->pinned)
    return ms_fail(err, MSIM_ERR_ARG, "%s.pinned is NULL, but npinned is %d", subject,
                   grid->npinned);
  for (int32_t i = 0; i < grid->npinned; i++)
    if (grid->pinned[i] < 0 || grid->pinned[i] >= ms_grid_size(grid))
      return ms_fail(err, MSIM_ERR_ARG,
                     "%s.pinned[%d] is %d; it must be a whole number from 0 to %d", subject, i,
                     grid->pinned[i], ms_grid_size(grid) - 1);
  return MSIM_OK;
}

msim_status ms_grid_make(const ms_object_type *type, const void *object, const char *subject,
                         ms_grid *grid, msim_error *err) {
  size_t size = *(const size_t *)object;
  if (size != type->size)
    return ms_fail(err, MSIM_ERR_ARG, "%s.size is %zu; it must be sizeof(msim_%s), which is %zu",
                   subject, size, type->name, type->size);
  for (int32_t i = 0; i < type->nmembers; i++) {
    msim_status status = check_member(&type->members[i], object, subject, err);
    if (status) return status;
  }
  type->make(object, grid);
  msim_status status = check_size(grid, subject, err);
  return status ? status : check_pinned(grid, subject, err);
}

/*------------------------------------- particles ------------------------------------------------*/

/* a/(n-1); 0 if n = 1. */
static double share(int32_t a, int32_t n) { return n > 1 ? (double)a / (n - 1) : 0.0; }

static void place_particles(const ms_grid *grid, double *x) {
  double *last = x + 3 * (size_t)(ms_grid_size(grid) - 1);
  for (int32_t a = 0; a < grid->n[0]; a++)
    for (int32_t b = 0; b < grid->n[1]; b++)
      for (int32_t c = 0; c < grid->n[2]; c++, x += 3)
        for (int i = 0; i < 3; i++)
          x[i] = grid->origin[i] + share(a, grid->n[0]) * grid->edge[0][i] +
                 share(b, grid->n[1]) * grid->edge[1][i] + share(c, grid->n[2]) * grid->edge[2][i];
  if (grid->last) memcpy(last, grid->last, 3 * sizeof *last);
}

/* Pin particles of the grid, by their indices in the scene. */
static msim_status pin_particles(msim_scene *scene, const ms_grid *grid, msim_error *err) {
  const msim_allocator *alloc = &scene->data->alloc;
  int32_t *pinned = ms_new(alloc, (size_t)grid->npinned, sizeof *pinned);
  if (!pinned) return ms_fail_memory(err, "an object");
  for (int32_t i = 0; i < grid->npinned; i++) pinned[i] = grid->first + grid->pinned[i];
  msim_status status = msim_scene_pin(scene, grid->npinned, pinned, err);
  ms_delete(alloc, pinned);
  return status;
}

msim_status ms_grid_add_particles(msim_scene *scene, ms_grid *grid, const char *subject,
                                  msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int32_t n = ms_grid_size(grid);
  if ((int64_t)scene->data->nparticles + n > INT32_MAX / 3)
    return ms_fail(err, MSIM_ERR_ARG, "%s.n makes %d particles more than %d; the limit is %d",
                   subject, n, scene->data->nparticles, INT32_MAX / 3);
  double *x = ms_new(&alloc, (size_t)n, 4 * sizeof *x);
  if (!x) return ms_fail_memory(err, "an object");
  double *mass = x + 3 * (size_t)n;
  place_particles(grid, x);
  for (int32_t i = 0; i < n; i++) mass[i] = grid->mass / n;
  grid->first = scene->data->nparticles;
  msim_status status = msim_scene_add_particles(scene, n, x, NULL, mass, err);
  ms_delete(&alloc, x);
  return status || !grid->npinned ? status : pin_particles(scene, grid, err);
}

/*------------------------------------- springs --------------------------------------------------*/

/* The particle at the other end of a spring from particle (a, b, c) = at; -1: outside the grid. */
static int32_t neighbour(const ms_grid *grid, const ms_tie *tie, const int32_t at[3]) {
  int32_t p = 0;
  for (int d = 0; d < 3; d++) {
    int32_t i = at[d] + tie->step[d];
    if (i < 0 || i >= grid->n[d]) return -1;
    p = p * grid->n[d] + i;
  }
  return p;
}

static void tie_particles(const ms_grid *grid, int32_t *ij, double *k) {
  int32_t p = grid->first, at[3];
  for (at[0] = 0; at[0] < grid->n[0]; at[0]++)
    for (at[1] = 0; at[1] < grid->n[1]; at[1]++)
      for (at[2] = 0; at[2] < grid->n[2]; at[2]++, p++)
        for (int32_t t = 0; t < grid->nties; t++) {
          int32_t q = neighbour(grid, &grid->ties[t], at);
          if (q < 0 || grid->k[grid->ties[t].law] == 0) continue;
          *ij++ = p;
          *ij++ = grid->first + q;
          *k++ = grid->k[grid->ties[t].law];
        }
}

msim_status ms_grid_add_springs(msim_scene *scene, const ms_grid *grid, msim_error *err) {
  const msim_allocator alloc = scene->data->alloc;
  const int64_t count = count_springs(grid);
  double *k = ms_new(&alloc, (size_t)count, 2 * sizeof *k + 2 * sizeof(int32_t));
  if (!k) return ms_fail_memory(err, "an object");
  double *damping = k + count;
  int32_t *ij = (int32_t *)(damping + count);
  tie_particles(grid, ij, k);
  for (int64_t e = 0; e < count; e++) damping[e] = grid->damping;
  msim_status status = msim_scene_add_springs(scene, (int32_t)count, ij, k, NULL, damping, err);
  ms_delete(&alloc, k);
  return status;
}

/*------------------------------------- public ---------------------------------------------------*/

static msim_status add(msim_scene *scene, const ms_object_type *type, const void *object,
                       msim_error *err) {
  if (!scene || !object) return ms_fail(err, MSIM_ERR_ARG, "scene or %s is NULL", type->name);
  ms_grid grid;
  msim_status status = ms_grid_make(type, object, type->name, &grid, err);
  if (status) return status;
  const int32_t before = scene->data->nparticles;
  status = ms_grid_add_particles(scene, &grid, type->name, err);
  if (!status) status = ms_grid_add_springs(scene, &grid, err);
  /* data that are shared have the old number already, and must not be written to */
  if (status && scene->data->nparticles > before) scene->data->nparticles = before;
  return status;
}

msim_status msim_scene_add_rope(msim_scene *scene, const msim_rope *rope, msim_error *err) {
  return add(scene, &types[ROPE], rope, err);
}

msim_status msim_scene_add_cloth(msim_scene *scene, const msim_cloth *cloth, msim_error *err) {
  return add(scene, &types[CLOTH], cloth, err);
}

msim_status msim_scene_add_lattice(msim_scene *scene, const msim_lattice *lattice,
                                   msim_error *err) {
  return add(scene, &types[LATTICE], lattice, err);
}
