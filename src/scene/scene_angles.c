/* scene_angles - appends angular springs to a scene */
#include <math.h>

#include "base/vec3.h"
#include "scene/angles.h"

static msim_status check_corners(const ms_scene *s, int64_t e, const int32_t ijk[3],
                                 msim_error *err) {
  for (int c = 0; c < 3; c++)
    if (ijk[c] < 0 || ijk[c] >= s->nparticles)
      return ms_error_set(
          err, MSIM_ERR_ARG,
          "angles.ijk[%lld] refers to particle %d; there are %d particles, counted from 0",
          (long long)e, ijk[c], s->nparticles);
  for (int c = 0; c < 3; c++)
    if (ijk[c] == ijk[(c + 1) % 3])
      return ms_error_set(err, MSIM_ERR_ARG,
                          "angles.ijk[%lld] has particle %d twice; it must have three different "
                          "ones, the vertex in the middle",
                          (long long)e, ijk[c]);
  return MSIM_OK;
}

static msim_status check_value(const char *what, int64_t e, double value, msim_error *err) {
  if (isfinite(value) && value >= 0) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "angles.%s[%lld] is %g; it must be a finite number >= 0",
                      what, (long long)e, value);
}

static msim_status check_rest(int64_t e, double rest, msim_error *err) {
  if (rest >= 0 && rest <= MS_PI) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "angles.rest[%lld] is %g; it must lie in [0, pi], pi = 3.141592653589793 for "
                      "straight edges",
                      (long long)e, rest);
}

/* The present angle is the rest angle. */
static msim_status check_angle(const ms_scene *s, int64_t e, const int32_t ijk[3],
                               msim_error *err) {
  double p[3], q[3];
  ms_scene_angles_get_edges(s, ijk, p, q);
  const double a = ms_vec3_norm(p), b = ms_vec3_norm(q);
  if (a > 0 && b > 0 && isfinite(a * b)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the angle of angles.ijk[%lld] is not defined, as an edge has the length %g "
                      "m; specify angles.rest or move its particles",
                      (long long)e, a > 0 && isfinite(a) ? b : a);
}

msim_status msim_scene_add_angles(msim_scene *scene, int32_t n, const int32_t *ijk, const double *k,
                                  const double *rest, const double *damping, msim_error *err) {
  if (!scene || (n > 0 && (!ijk || !k)))
    return ms_error_set(err, MSIM_ERR_ARG, "scene, ijk or k is NULL");
  msim_status status = ms_scene_check_count(n, "angles", err);
  for (int32_t e = 0; e < n && !status; e++) {
    const int32_t *corner = ijk + 3 * (size_t)e;
    status = check_corners(scene->data, e, corner, err);
    if (!status) status = check_value("k", e, k[e], err);
    if (!status && damping) status = check_value("damping", e, damping[e], err);
    if (!status)
      status = rest ? check_rest(e, rest[e], err) : check_angle(scene->data, e, corner, err);
  }
  if (status || n == 0) return status ? status : ms_error_clear(err);
  const int64_t total = (int64_t)scene->data->angles.n + n;
  if (total > INT32_MAX / 6) /* ends and pairs of angles have 32-bit indices */
    return ms_error_set(err, MSIM_ERR_ARG, "%lld angles exceed the limit of %d", (long long)total,
                        INT32_MAX / 6);
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  status = ms_scene_angles_append(s, n, ijk, k, rest, damping, err);
  return status ? status : ms_error_clear(err);
}
