#include "scene/colliders.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/archive.h"
#include "base/sized.h"
#include "base/vec3.h"
#include "scene/scene.h"

/*------------------------------------- keys -----------------------------------------------------*/

enum {
  SPHERE = 1 << MSIM_COLLIDER_SPHERE,
  CAPSULE = 1 << MSIM_COLLIDER_CAPSULE,
  CYLINDER = 1 << MSIM_COLLIDER_CYLINDER,
  BOX = 1 << MSIM_COLLIDER_BOX,
  HEIGHTFIELD = 1 << MSIM_COLLIDER_HEIGHTFIELD,
  SDF = 1 << MSIM_COLLIDER_SDF,
  ALL = SPHERE | CAPSULE | CYLINDER | BOX | HEIGHTFIELD | SDF
};

#define ROW(key, member, types, range, count, preset, unit, doc, example)                         \
  {                                                                                               \
    {key, MS_NUMBERS, range, count, preset, unit, doc, example}, offsetof(msim_collider, member), \
        types                                                                                     \
  }

const ms_collider_member ms_collider_members[MS_COLLIDER_MEMBERS] = {
    ROW("center", center, SPHERE | BOX, MS_ANY, 3, NULL, "m", "position of the center",
        "[0, 0, 1]"),
    ROW("from", from, CAPSULE | CYLINDER, MS_ANY, 3, NULL, "m", "one end of the axis", "[0, 0, 1]"),
    ROW("to", to, CAPSULE | CYLINDER, MS_ANY, 3, NULL, "m", "the other end of the axis",
        "[1, 0, 1]"),
    ROW("radius", radius, SPHERE | CAPSULE | CYLINDER, MS_POSITIVE, 1, NULL, "m",
        "distance of the surface from the center or from the axis", "0.5"),
    ROW("size", extent, BOX, MS_POSITIVE, 3, NULL, "m",
        "edge lengths, along x, y and z before the "
        "rotation",
        "[1, 1, 0.5]"),
    ROW("rotation", rotation, BOX, MS_ANY, 3, "[0, 0, 0]", "rad",
        "rotation vector: the axis of the rotation about the center, its length the angle, "
        "counterclockwise seen from the tip",
        "[0, 0, 0.7854]"),
    ROW("origin", origin, HEIGHTFIELD | SDF, MS_ANY, 3, NULL, "m",
        "position of the first sample; of a height field at height 0", "[0, 0, 0]"),
    ROW("spacing", spacing, HEIGHTFIELD, MS_POSITIVE, 2, NULL, "m",
        "distances between heights along x and y", "[0.1, 0.1]"),
    ROW("spacing", spacing, SDF, MS_POSITIVE, 3, NULL, "m",
        "distances between samples along x, y and z", "[0.1, 0.1, 0.1]"),
    ROW("restitution", restitution, ALL, MS_FRACTION, 1, "1", "",
        "ratio of the normal speeds after and before an impact; 1: elastic", "0.5"),
    ROW("friction", friction, ALL, MS_NOT_NEGATIVE, 1, "0", "", "coefficient of Coulomb friction",
        "0.3")};

const ms_scene_key ms_collider_type_key = {"type", MS_COLLIDER_TYPE,     MS_ANY,      1, NULL,
                                           "",     "shape of the solid", "\"sphere\""};

const ms_scene_key ms_collider_inside_key = {
    "inside",
    MS_FLAG,
    MS_ANY,
    1,
    "false",
    "",
    "whether particles stay inside the solid, as in a bowl; else they stay outside",
    "true"};

const ms_scene_key ms_collider_motion_key = {
    "motion",
    MS_SECTION,
    MS_ANY,
    1,
    "",
    "",
    "a prescribed motion through positions at given times: before the first and after the last one "
    "the collider rests",
    "{\"t\": [0, 1], \"x\": [[0, 0, 1], [1, 0, 1]]}"};

const ms_scene_key *ms_colliders_get_count_key(int32_t type) {
  static const ms_scene_key of_heights = {"n",
                                          MS_NUMBERS,
                                          MS_POSITIVE_INTEGER,
                                          2,
                                          NULL,
                                          "",
                                          "numbers of heights along x and y, 2 at least",
                                          "[2, 3]"},
                            of_grid = {"n",
                                       MS_NUMBERS,
                                       MS_POSITIVE_INTEGER,
                                       3,
                                       NULL,
                                       "",
                                       "numbers of samples along x, y and z, 2 at least",
                                       "[9, 9, 9]"};
  return type == MSIM_COLLIDER_HEIGHTFIELD ? &of_heights
         : type == MSIM_COLLIDER_SDF       ? &of_grid
                                           : NULL;
}

const ms_scene_key *ms_colliders_get_values_key(int32_t type) {
  static const ms_scene_key heights = {
      "heights",
      MS_NUMBER_LIST,
      MS_ANY,
      1,
      NULL,
      "m",
      "heights above the origin: those along y of the first x, then of the second x, ...",
      "[0, 0, 0, 0.1, 0.2, 0.1]"};
  static const ms_scene_key values = {"values",
                                      MS_NUMBER_LIST,
                                      MS_ANY,
                                      1,
                                      NULL,
                                      "m",
                                      "signed distances, negative in the solid and > 0 at the "
                                      "border of the grid: z varies fastest, "
                                      "then y",
                                      "[0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]"};
  return type == MSIM_COLLIDER_HEIGHTFIELD ? &heights : type == MSIM_COLLIDER_SDF ? &values : NULL;
}

size_t ms_colliders_count_values(const msim_collider *c) {
  const ms_scene_key *key = ms_colliders_get_count_key(c->type);
  size_t n = key != NULL;
  for (int32_t i = 0; key && i < key->count; i++) n *= (size_t)c->n[i];
  return n;
}

uint64_t ms_colliders_hash(const msim_collider *c, uint64_t hash) {
  const int32_t shape[] = {c->type, c->inside};
  hash = ms_archive_hash(hash, shape, sizeof shape);
  for (int k = 0; k < MS_COLLIDER_MEMBERS; k++)
    hash = ms_archive_hash(hash, ms_colliders_get_member(c, &ms_collider_members[k]),
                           (size_t)ms_collider_members[k].key.count * sizeof(double));
  if (!c->values) return hash;
  hash = ms_archive_hash(hash, c->n, sizeof c->n);
  return ms_archive_hash(hash, c->values, ms_colliders_count_values(c) * sizeof *c->values);
}

const ms_collider_type *ms_colliders_get_type(int32_t type) {
  static const ms_collider_type types[] = {
      [MSIM_COLLIDER_SPHERE] = {"sphere", "the points at most `radius` from `center`"},
      [MSIM_COLLIDER_CAPSULE] = {"capsule",
                                 "the points at most `radius` from the line from `from` to `to`"},
      [MSIM_COLLIDER_CYLINDER] = {"cylinder", "a straight cylinder with flat ends"},
      [MSIM_COLLIDER_BOX] = {"box", "a cuboid in any position"},
      [MSIM_COLLIDER_HEIGHTFIELD] = {"heightfield",
                                     "the space below triangles through heights on a grid"},
      [MSIM_COLLIDER_SDF] = {"sdf", "a solid given by samples of the signed distance on a grid"}};
  const int exists = type >= MSIM_COLLIDER_SPHERE && type < (int32_t)(sizeof types / sizeof *types);
  return exists ? &types[type] : NULL;
}

/*------------------------------------- samples --------------------------------------------------*/

static msim_status check_counts(const msim_collider *c, msim_error *err) {
  const int32_t count = ms_colliders_get_count_key(c->type)->count;
  int64_t all = 1;
  for (int32_t i = 0; i < count; i++) {
    if (c->n[i] < 2)
      return ms_error_set(err, MSIM_ERR_ARG, "n[%d] is %d; it must be at least 2", i, c->n[i]);
    all *= c->n[i];
    if (all > INT32_MAX)
      return ms_error_set(err, MSIM_ERR_ARG, "n is too large; there may be %d samples", INT32_MAX);
  }
  return MSIM_OK;
}

/* 1: a sample at the border of the grid */
static int is_at_border(const msim_collider *c, int64_t at) {
  const int64_t k = at % c->n[2], j = at / c->n[2] % c->n[1], i = at / c->n[2] / c->n[1];
  return i == 0 || j == 0 || k == 0 || i == c->n[0] - 1 || j == c->n[1] - 1 || k == c->n[2] - 1;
}

static msim_status check_values(const msim_collider *c, msim_error *err) {
  const char *name = ms_colliders_get_values_key(c->type)->key;
  if (!c->values) return ms_error_set(err, MSIM_ERR_ARG, "values is NULL");
  const int64_t all = (int64_t)ms_colliders_count_values(c);
  for (int64_t i = 0; i < all; i++) {
    if (!isfinite(c->values[i]))
      return ms_error_set(err, MSIM_ERR_ARG, "%s[%lld] is %g; it must be finite", name,
                          (long long)i, c->values[i]);
    if (c->type == MSIM_COLLIDER_SDF && !(c->values[i] > 0) && is_at_border(c, i))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "values[%lld] is %g at the border of the grid; it must be > 0 there, so "
                          "that the solid lies inside the grid",
                          (long long)i, c->values[i]);
  }
  return MSIM_OK;
}

/* The least cosine of the slopes of all triangles: their edges along x and y are those of cells. */
static double find_least_cosine(const ms_samples *m) {
  double steepest = 0;
  for (int32_t i = 0; i < m->n[0]; i++)
    for (int32_t j = 0; j < m->n[1]; j++) {
      const double *at = m->values + (size_t)i * (size_t)m->n[1] + j;
      double along[2] = {0};
      for (int side = 0; side < 2; side++) { /* the slopes along x on both sides of the cell */
        if (i + 1 < m->n[0] && j + side < m->n[1])
          along[0] = fmax(along[0], fabs(at[m->n[1] + side] - at[side]) / m->spacing[0]);
        if (j + 1 < m->n[1] && i + side < m->n[0])
          along[1] =
              fmax(along[1], fabs(at[side * m->n[1] + 1] - at[side * m->n[1]]) / m->spacing[1]);
      }
      steepest = fmax(steepest, hypot(along[0], along[1]));
    }
  return 1 / hypot(1, steepest);
}

static msim_status make_samples(const msim_allocator *alloc, const msim_collider *c,
                                ms_samples **samples, msim_error *err) {
  const size_t all = ms_colliders_count_values(c);
  *samples = NULL;
  if (all == 0) return MSIM_OK;
  ms_samples *m = ms_memory_allocate(alloc, 1, sizeof *m + all * sizeof *m->values);
  if (!m) return ms_error_set_memory(err, "the samples of a collider");
  atomic_init(&m->references, 1);
  for (int i = 0; i < 3; i++) m->n[i] = c->n[i], m->spacing[i] = c->spacing[i];
  if (c->type == MSIM_COLLIDER_HEIGHTFIELD) m->n[2] = 1;
  memcpy(m->values, c->values, all * sizeof *m->values);
  m->highest = m->values[0];
  for (size_t i = 1; i < all; i++) m->highest = fmax(m->highest, m->values[i]);
  if (c->type == MSIM_COLLIDER_HEIGHTFIELD) m->least_cosine = find_least_cosine(m);
  *samples = m;
  return MSIM_OK;
}

/* The largest |q| of a sample or of a height */
static double find_extent(const msim_collider *c) {
  double extent[3] = {0};
  const size_t all = ms_colliders_count_values(c);
  for (int i = 0; i < 3 && all; i++) extent[i] = (c->n[i] - 1) * c->spacing[i];
  if (c->type != MSIM_COLLIDER_HEIGHTFIELD) return ms_vec3_norm(extent);
  extent[2] = 0;
  for (size_t i = 0; i < all; i++) extent[2] = fmax(extent[2], fabs(c->values[i]));
  return ms_vec3_norm(extent);
}

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status check_numbers(const msim_collider *c, const ms_collider_member *m,
                                 msim_error *err) {
  const double *numbers = ms_colliders_get_member(c, m);
  char index[16] = "";
  for (int32_t i = 0; i < m->key.count; i++) {
    if (ms_range_contains(m->key.range, numbers[i])) continue;
    if (m->key.count > 1) snprintf(index, sizeof index, "[%d]", i);
    return ms_error_set(err, MSIM_ERR_ARG, "%s%s is %g; it must be %s", m->key.key, index,
                        numbers[i], ms_range_text(m->key.range));
  }
  return MSIM_OK;
}

/* *c: the members that its type has; all others become 0. */
static msim_status read_collider(const msim_collider *from, msim_collider *c, msim_error *err) {
  msim_collider all;
  msim_status status = ms_sized_check(from, sizeof all, MS_SIZE_THROUGH(msim_collider, friction),
                                      "collider", "collider", err);
  if (status) return status;
  ms_sized_read(&all, sizeof all, from);
  if (!ms_colliders_get_type(all.type))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "type is %d; it must be MSIM_COLLIDER_SPHERE, _CAPSULE, _CYLINDER, _BOX, "
                        "_HEIGHTFIELD or _SDF",
                        all.type);
  if (all.inside != 0 && all.inside != 1)
    return ms_error_set(err, MSIM_ERR_ARG, "inside is %d; it must be 0 or 1", all.inside);
  *c = (msim_collider){.size = sizeof *c, .type = all.type, .inside = all.inside};
  for (int i = 0; i < MS_COLLIDER_MEMBERS; i++) {
    const ms_collider_member *m = &ms_collider_members[i];
    if (!ms_colliders_type_has(c->type, m)) continue;
    status = check_numbers(&all, m, err);
    if (status) return status;
    memcpy((char *)c + m->offset, ms_colliders_get_member(&all, m),
           (size_t)m->key.count * sizeof(double));
  }
  if (!ms_colliders_get_count_key(c->type)) return MSIM_OK;
  memcpy(c->n, all.n, (size_t)ms_colliders_get_count_key(c->type)->count * sizeof *c->n);
  c->values = all.values;
  status = check_counts(c, err);
  return status ? status : check_values(c, err);
}

/*------------------------------------- solids ---------------------------------------------------*/

/* axis[2] along u, which has that length; axis[0] and axis[1] are perpendicular to it. */
static void set_axis(const double u[3], double length, double axis[3][3]) {
  int least = 0;
  double *a = axis[0], *b = axis[1], *n = axis[2];
  for (int c = 0; c < 3; c++) n[c] = u[c] / length;
  for (int c = 1; c < 3; c++)
    if (fabs(n[c]) < fabs(n[least])) least = c;
  const double along = n[least], across = sqrt(1 - along * along);
  for (int c = 0; c < 3; c++) a[c] = ((c == least) - along * n[c]) / across;
  for (int c = 0; c < 3; c++)
    b[c] = n[(c + 1) % 3] * a[(c + 2) % 3] - n[(c + 2) % 3] * a[(c + 1) % 3];
}

/* Without samples */
static msim_status make_solid(const msim_collider *c, ms_solid *s, msim_error *err) {
  static const double identity[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const int has_axis = (1 << c->type & (CAPSULE | CYLINDER)) != 0;
  double axis[3], length = 0;
  *s = (ms_solid){.type = c->type, .inside = c->inside, .radius = c->radius};
  const int is_sampled = ms_colliders_get_count_key(c->type) != NULL;
  memcpy(s->center, is_sampled ? c->origin : c->center, sizeof s->center);
  memcpy(s->axis, identity, sizeof s->axis);
  if (has_axis) {
    for (int i = 0; i < 3; i++) axis[i] = c->to[i] - c->from[i];
    for (int i = 0; i < 3; i++) s->center[i] = c->from[i] + axis[i] / 2;
    length = hypot(hypot(axis[0], axis[1]), axis[2]);
    s->half[2] = length / 2;
    if (length > 0) set_axis(axis, length, s->axis);
  }
  if (c->type == MSIM_COLLIDER_BOX) {
    for (int i = 0; i < 3; i++) s->half[i] = c->extent[i] / 2;
    ms_collider_motion_rotate_axes(c->rotation, s->axis);
  }
  s->reach = ms_vec3_norm(s->center) + ms_vec3_norm(s->half) + s->radius + find_extent(c);
  if (has_axis && !(length > 0))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "from and to are the same point; they must be the two ends of the axis");
  const int is_rotated = isfinite(s->axis[0][0]);
  if (isfinite(s->reach) && is_rotated) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "%s so large that distances are beyond the range of double; use smaller "
                      "numbers",
                      has_axis                               ? "from and to are"
                      : c->type == MSIM_COLLIDER_HEIGHTFIELD ? "origin, spacing, n or heights are"
                      : is_sampled                           ? "origin, spacing or n are"
                      : is_rotated                           ? "center or size is"
                                                             : "rotation is");
}

msim_status msim_scene_add_collider(msim_scene *scene, const msim_collider *collider,
                                    msim_error *err) {
  msim_collider c;
  ms_solid solid;
  if (!scene || !collider) return ms_error_set(err, MSIM_ERR_ARG, "scene or collider is NULL");
  msim_status status = read_collider(collider, &c, err);
  if (!status) status = make_solid(&c, &solid, err);
  if (status) return status;
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s || !ms_scene_reserve_colliders(s, (int64_t)s->ncolliders + 1, err)) return MSIM_ERR_MEMORY;
  status = make_samples(&s->alloc, &c, &solid.samples, err);
  if (status) return status;
  if (solid.samples) c.values = solid.samples->values;
  s->colliders[s->ncolliders] = c;
  s->collider_motions[s->ncolliders] = (ms_collider_motion){0};
  s->solids[s->ncolliders++] = solid;
  return ms_error_clear(err);
}
