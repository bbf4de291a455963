#include "scene/scene.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "base/sized.h"
#include "scene/laws.h"
#include "scene/scene_data.h"

/* Planes are elements of the array of msim_scene_view: with another size programs that were built
 * before would read wrong ones. */
static_assert(sizeof(msim_plane) == 48, "msim_plane is fixed (scene.h)");

/*------------------------------------- creation and destruction ---------------------------------*/

msim_status msim_scene_create(const msim_allocator *alloc, msim_scene **scene, msim_error *err) {
  if (!scene) return ms_error_set(err, MSIM_ERR_ARG, "scene is NULL");
  *scene = NULL;
  const msim_status status = ms_memory_check_allocator(alloc, err);
  if (status) return status;
  msim_allocator a = ms_memory_allocator(alloc);
  msim_scene *handle = ms_memory_allocate(&a, 1, sizeof *handle);
  ms_scene *data = handle ? ms_scene_data_create(&a) : NULL;
  if (!data) {
    ms_memory_free(&a, handle);
    return ms_error_set_memory(err, "a scene");
  }
  handle->data = data;
  *scene = handle;
  return ms_error_clear(err);
}

void msim_scene_destroy(msim_scene *scene) {
  if (!scene) return;
  msim_allocator alloc = scene->data->alloc;
  if (scene->part) ms_scene_release(scene->part->rows);
  ms_scene_release(scene->data);
  MS_FREE(&alloc, scene->part, scene);
}

/*------------------------------------- copy on write --------------------------------------------*/

ms_scene *ms_scene_make_writable(msim_scene *scene, msim_error *err) {
  if (atomic_load(&scene->data->references) > 1) {
    ms_scene *own = ms_scene_data_copy(scene->data, err);
    if (!own) return NULL;
    ms_scene_release(scene->data);
    scene->data = own;
  }
  ms_memory_free(&scene->data->alloc, scene->data->source);
  scene->data->source = NULL;
  return scene->data;
}

/*------------------------------------- arrays ---------------------------------------------------*/

static void append_particles(ms_scene *s, int32_t n, const double *x, const double *v,
                             const double *mass) {
  size_t at = (size_t)s->nparticles, count = (size_t)n;
  memcpy(s->x + 3 * at, x, 3 * count * sizeof *x);
  if (v) memcpy(s->v + 3 * at, v, 3 * count * sizeof *v);
  else memset(s->v + 3 * at, 0, 3 * count * sizeof *s->v);
  memcpy(s->mass + at, mass, count * sizeof *mass);
  memset(s->pinned + at, 0, count);
  if (s->force) memset(s->force + 3 * at, 0, 3 * count * sizeof *s->force);
  s->nparticles += n;
}

double ms_scene_distance(const double *a, const double *b) {
  double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* The next n springs, whose arrays are filled; `rest` where has_rest */
static void count_springs(ms_scene *s, int32_t n, int has_rest) {
  const size_t at = (size_t)s->nsprings, count = (size_t)n;
  for (size_t e = at; e < at + count && !has_rest; e++)
    s->rest[e] =
        ms_scene_distance(s->x + 3 * (size_t)s->ij[2 * e], s->x + 3 * (size_t)s->ij[2 * e + 1]);
  if (s->law) memset(s->law + at, 0, count * sizeof *s->law);
  if (s->broken) memset(s->broken + at, MS_INTACT, count);
  s->nsprings += n;
}

static void append_springs(ms_scene *s, int32_t n, const int32_t *ij, const double *k,
                           const double *rest, const double *damping) {
  const size_t at = (size_t)s->nsprings, count = (size_t)n;
  memcpy(s->ij + 2 * at, ij, 2 * count * sizeof *ij);
  memcpy(s->k + at, k, count * sizeof *k);
  if (rest) memcpy(s->rest + at, rest, count * sizeof *rest);
  if (damping) memcpy(s->damping + at, damping, count * sizeof *damping);
  else memset(s->damping + at, 0, count * sizeof *s->damping);
  count_springs(s, n, rest != NULL);
}

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status check_number(const char *what, int64_t i, double value, int positive,
                                msim_error *err) {
  if (isfinite(value) && (positive ? value > 0 : value >= 0)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "%s[%lld] is %g; it must be a finite number %s", what,
                      (long long)i, value, positive ? "> 0" : ">= 0");
}

msim_status ms_scene_check_finite(const char *what, int64_t n, int width, const double *values,
                                  msim_error *err) {
  for (int64_t i = 0; i < n; i++)
    if (!isfinite(values[i]))
      return ms_error_set(err, MSIM_ERR_ARG, "%s[%lld] is %g; it must be finite", what,
                          (long long)(i / width), values[i]);
  return MSIM_OK;
}

msim_status ms_scene_check_count(int64_t n, const char *what, msim_error *err) {
  if (n >= 0) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "the number of %s is %lld; it must be >= 0", what,
                      (long long)n);
}

static msim_status check_particle_limit(const ms_scene *s, int32_t n, msim_error *err) {
  int64_t total = (int64_t)s->nparticles + n;
  /* indices of 3n arrays are int32_t */
  if (total <= INT32_MAX / 3) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "%lld particles exceed the limit of %d", (long long)total,
                      INT32_MAX / 3);
}

static msim_status check_spring(const ms_scene *s, int64_t e, const int32_t *ij, msim_error *err) {
  for (int end = 0; end < 2; end++)
    if (ij[end] < 0 || ij[end] >= ms_scene_count_ends(s))
      return ms_error_set(
          err, MSIM_ERR_ARG,
          "springs.ij[%lld] refers to particle %d; there are %d particles, counted from 0",
          (long long)e, ij[end], ms_scene_count_ends(s));
  if (ij[0] == ij[1])
    return ms_error_set(err, MSIM_ERR_ARG,
                        "springs.ij[%lld] connects particle %d to itself; remove this spring",
                        (long long)e, ij[0]);
  return MSIM_OK;
}

msim_status ms_scene_refuse_length(int64_t e, msim_error *err) {
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the length of springs.ij[%lld] is beyond the range of double; specify "
                      "springs.rest or use smaller coordinates",
                      (long long)e);
}

static msim_status check_length(const ms_scene *s, int64_t e, const int32_t *ij, msim_error *err) {
  const double *from = s->x + 3 * (size_t)ij[0], *to = s->x + 3 * (size_t)ij[1];
  return isfinite(ms_scene_distance(from, to)) ? MSIM_OK : ms_scene_refuse_length(e, err);
}

/*------------------------------------- setters --------------------------------------------------*/

msim_status msim_scene_set_name(msim_scene *scene, const char *name, msim_error *err) {
  if (!scene || !name) return ms_error_set(err, MSIM_ERR_ARG, "scene or name is NULL");
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  char *copy = ms_memory_copy_string(&s->alloc, name);
  if (!copy) return ms_error_set_memory(err, "a name");
  ms_memory_free(&s->alloc, s->name);
  s->name = copy;
  return ms_error_clear(err);
}

msim_status msim_scene_set_gravity(msim_scene *scene, const double gravity[3], msim_error *err) {
  if (!scene || !gravity) return ms_error_set(err, MSIM_ERR_ARG, "scene or gravity is NULL");
  if (ms_scene_check_finite("gravity", 3, 1, gravity, err)) return MSIM_ERR_ARG;
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  memcpy(s->external.gravity, gravity, sizeof s->external.gravity);
  return ms_error_clear(err);
}

msim_status msim_scene_set_drag(msim_scene *scene, double drag, msim_error *err) {
  if (!scene) return ms_error_set(err, MSIM_ERR_ARG, "scene is NULL");
  if (!isfinite(drag) || drag < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "drag is %g; it must be a finite number >= 0", drag);
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  s->external.drag = drag;
  return ms_error_clear(err);
}

msim_status msim_scene_set_self_contact(msim_scene *scene, double thickness, double friction,
                                        msim_error *err) {
  if (!scene) return ms_error_set(err, MSIM_ERR_ARG, "scene is NULL");
  if (!isfinite(thickness) || thickness < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "thickness is %g; it must be a finite number >= 0",
                        thickness);
  if (!isfinite(friction) || friction < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "friction is %g; it must be a finite number >= 0",
                        friction);
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  s->self_contact = (ms_scene_self_contact){thickness, thickness > 0 ? friction : 0};
  return ms_error_clear(err);
}

msim_status msim_scene_set_planes_constrain(msim_scene *scene, int32_t constrain, msim_error *err) {
  if (!scene) return ms_error_set(err, MSIM_ERR_ARG, "scene is NULL");
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  s->planes_constrain = constrain != 0;
  return ms_error_clear(err);
}

static msim_status set_drag(msim_scene *scene, const double *drag, msim_error *err) {
  return msim_scene_set_drag(scene, *drag, err);
}

const ms_scene_parameter ms_scene_parameters[MS_SCENE_PARAMETERS] = {
    {{"gravity", MS_NUMBERS, MS_ANY, 3, "[0, 0, 0]", "m/s^2", "acceleration of all particles",
      "[0, 0, -9.81]"},
     offsetof(ms_external, gravity),
     msim_scene_set_gravity},
    {{"drag", MS_NUMBERS, MS_NOT_NEGATIVE, 1, "0", "N s/m", "b in the force -b v on each particle",
      "0.01"},
     offsetof(ms_external, drag),
     set_drag}};

const double *ms_scene_get_parameter(const ms_scene *scene, const ms_scene_parameter *parameter) {
  return (const double *)(const void *)((const char *)&scene->external + parameter->offset);
}

msim_status msim_scene_add_particles(msim_scene *scene, int32_t n, const double *x, const double *v,
                                     const double *mass, msim_error *err) {
  if (!scene || (n > 0 && (!x || !mass)))
    return ms_error_set(err, MSIM_ERR_ARG, "scene, x or mass is NULL");
  msim_status status = ms_scene_check_count(n, "particles", err);
  if (!status) status = check_particle_limit(scene->data, n, err);
  if (!status) status = ms_scene_check_finite("particles.x", 3 * (int64_t)n, 3, x, err);
  if (!status && v) status = ms_scene_check_finite("particles.v", 3 * (int64_t)n, 3, v, err);
  for (int32_t i = 0; i < n && !status; i++)
    status = check_number("particles.mass", i, mass[i], 1, err);
  if (status || n == 0) return status ? status : ms_error_clear(err);
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s || !ms_scene_reserve_particles(s, (int64_t)s->nparticles + n, err)) return MSIM_ERR_MEMORY;
  append_particles(s, n, x, v, mass);
  return ms_error_clear(err);
}

static msim_status check_springs(const ms_scene *s, int32_t n, const int32_t *ij, const double *k,
                                 const double *rest, const double *damping, msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t e = 0; e < n && !status; e++) {
    status = check_spring(s, e, ij + 2 * (size_t)e, err);
    if (!status) status = check_number("springs.k", e, k[e], 0, err);
    if (!status && rest) status = check_number("springs.rest", e, rest[e], 0, err);
    if (!status && !rest) status = check_length(s, e, ij + 2 * (size_t)e, err);
    if (!status && damping) status = check_number("springs.damping", e, damping[e], 0, err);
  }
  return status;
}

msim_status ms_scene_begin_springs(msim_scene *scene, int32_t n, msim_error *err) {
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  const int64_t total = (int64_t)s->nsprings + n;
  if (total > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%lld springs exceed the limit of %d", (long long)total,
                        INT32_MAX);
  const int64_t room = total > 0 ? total : 1; /* so that arrays have addresses */
  return ms_scene_reserve_springs(s, room, err) ? MSIM_OK : MSIM_ERR_MEMORY;
}

msim_status ms_scene_end_springs(ms_scene *s, int32_t n, int has_rest, msim_error *err) {
  const size_t at = (size_t)s->nsprings;
  const msim_status status = check_springs(s, n, s->ij + 2 * at, s->k + at,
                                           has_rest ? s->rest + at : NULL, s->damping + at, err);
  if (!status) count_springs(s, n, has_rest);
  return status;
}

msim_status msim_scene_add_springs(msim_scene *scene, int32_t n, const int32_t *ij, const double *k,
                                   const double *rest, const double *damping, msim_error *err) {
  if (!scene || (n > 0 && (!ij || !k)))
    return ms_error_set(err, MSIM_ERR_ARG, "scene, ij or k is NULL");
  msim_status status = ms_scene_check_count(n, "springs", err);
  if (!status) status = check_springs(scene->data, n, ij, k, rest, damping, err);
  if (status || n == 0) return status ? status : ms_error_clear(err);
  status = ms_scene_begin_springs(scene, n, err);
  if (status) return status;
  append_springs(scene->data, n, ij, k, rest, damping);
  return ms_error_clear(err);
}

/* A normal whose length is 1 up to rounding stays bitwise the same. */
static void normalize_plane(msim_plane *p) {
  double largest = fmax(fmax(fabs(p->normal[0]), fabs(p->normal[1])), fabs(p->normal[2]));
  double n[3] = {p->normal[0] / largest, p->normal[1] / largest, p->normal[2] / largest};
  double length = largest * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  if (fabs(length - 1.0) <= 4 * 2.220446049250313e-16) return;
  for (int c = 0; c < 3; c++) p->normal[c] /= length;
  p->offset /= length;
}

msim_status msim_scene_add_plane(msim_scene *scene, const msim_plane *plane, msim_error *err) {
  if (!scene || !plane) return ms_error_set(err, MSIM_ERR_ARG, "scene or plane is NULL");
  msim_plane p = *plane;
  msim_status status = ms_scene_check_finite("normal", 3, 1, p.normal, err);
  if (status) return status;
  if (!isfinite(p.offset))
    return ms_error_set(err, MSIM_ERR_ARG, "offset is %g; it must be finite", p.offset);
  if (p.normal[0] == 0 && p.normal[1] == 0 && p.normal[2] == 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "normal is 0; it must be a nonzero vector, of any length");
  if (!(p.restitution >= 0 && p.restitution <= 1))
    return ms_error_set(err, MSIM_ERR_ARG, "restitution is %g; it must lie in [0, 1]",
                        p.restitution);
  if (!(p.friction >= 0) || !isfinite(p.friction))
    return ms_error_set(err, MSIM_ERR_ARG, "friction is %g; it must be a finite number >= 0",
                        p.friction);
  normalize_plane(&p);
  if (!isfinite(p.offset))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "offset / |normal| is not finite; use a longer normal or a smaller offset");
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  status = ms_memory_reserve(&s->alloc, MS_ARRAY(s->planes), s->nplanes, &s->plane_capacity,
                             (int64_t)s->nplanes + 1, err);
  if (status) return status;
  s->planes[s->nplanes++] = p;
  return ms_error_clear(err);
}

msim_status msim_scene_pin(msim_scene *scene, int32_t n, const int32_t *particles,
                           msim_error *err) {
  if (!scene || (n > 0 && !particles))
    return ms_error_set(err, MSIM_ERR_ARG, "scene or particles is NULL");
  msim_status status = ms_scene_check_count(n, "pinned particles", err);
  const ms_scene *now = scene->data;
  for (int32_t i = 0; i < n && !status; i++) {
    const int32_t p = particles[i];
    const int there = p >= 0 && p < now->nparticles;
    const double *v = there ? now->v + 3 * (size_t)p : NULL;
    if (!there)
      status = ms_error_set(err, MSIM_ERR_ARG,
                            "pinned[%d] is %d; there are %d particles, counted from 0", i, p,
                            now->nparticles);
    else if (v[0] != 0 || v[1] != 0 || v[2] != 0)
      status = ms_error_set(err, MSIM_ERR_ARG,
                            "pinned[%d] is particle %d, whose velocity is not 0; set it to 0 or do "
                            "not pin the particle",
                            i, p);
  }
  if (status || n == 0) return status ? status : ms_error_clear(err);
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  for (int32_t i = 0; i < n; i++) s->pinned[particles[i]] = 1;
  return ms_error_clear(err);
}

msim_status ms_scene_add_run_option(msim_scene *scene, const char *name, const char *value,
                                    msim_error *err) {
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  msim_status status = ms_memory_reserve(&s->alloc, MS_ARRAY(s->run), s->nrun, &s->run_capacity,
                                         (int64_t)s->nrun + 1, err);
  if (status) return status;
  ms_run_option entry = {ms_memory_copy_string(&s->alloc, name),
                         ms_memory_copy_string(&s->alloc, value)};
  if (!entry.name || !entry.value) {
    MS_FREE(&s->alloc, entry.name, entry.value);
    return ms_error_set_memory(err, "the options of the scene");
  }
  s->run[s->nrun++] = entry;
  return MSIM_OK;
}

/*------------------------------------- getter ---------------------------------------------------*/

msim_status msim_scene_get(const msim_scene *scene, msim_scene_view *view) {
  if (!scene || !view) return MSIM_ERR_ARG;
  const ms_scene *s = scene->data;
  msim_scene_view full = {
      .name = s->name,
      .nparticles = s->nparticles,
      .nsprings = s->nsprings,
      .nplanes = s->nplanes,
      .x = s->x,
      .v = s->v,
      .mass = s->mass,
      .pinned = s->pinned,
      .ij = s->ij,
      .k = s->k,
      .rest = s->rest,
      .damping = s->damping,
      .planes = s->planes,
      .nfaces = s->nfaces,
      .faces = s->faces,
      .nlaws = s->nlaws,
      .law = s->law,
      .force = s->force,
      .ncolliders = s->ncolliders,
      .colliders = s->colliders,
      .nmotions = s->nmotions,
      .force_function = ms_scene_has_function(s) ? &s->force_function : NULL,
      .nangles = s->angles.n,
      .ijk = s->angles.ijk,
      .angle_k = s->angles.k,
      .angle_rest = s->angles.rest,
      .angle_damping = s->angles.damping,
      .gravity = {s->external.gravity[0], s->external.gravity[1], s->external.gravity[2]},
      .drag = s->external.drag,
      .self_thickness = s->self_contact.thickness,
      .self_friction = s->self_contact.friction,
      .planes_constrain = s->planes_constrain};
  return ms_sized_write(view, &full, sizeof full);
}
