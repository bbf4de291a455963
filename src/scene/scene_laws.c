#include <math.h>

#include "base/sized.h"
#include "base/vector.h"
#include "scene/laws.h"

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status check_numbers(const char *what, int32_t n, const double *values,
                                 msim_error *err) {
  if (!values) return ms_error_set(err, MSIM_ERR_ARG, "%s is NULL", what);
  for (int32_t i = 0; i < n; i++)
    if (!(fabs(values[i]) <= MS_LARGEST_VALID))
      return ms_error_set(err, MSIM_ERR_ARG, "%s[%d] is %g; it must lie between -%g and %g", what,
                          i, values[i], MS_LARGEST_VALID, MS_LARGEST_VALID);
  return MSIM_OK;
}

static msim_status check_count(const msim_law *law, int32_t least, msim_error *err) {
  if (law->n >= least) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "n is %d; it must be >= %d for kind %s", law->n, least,
                      ms_laws_kind_name(law->kind));
}

static msim_status check_positive(const char *what, double value, msim_error *err) {
  if (value > 0 && value <= MS_LARGEST_VALID) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "%s is %g; it must be a number > 0, and at most %g", what,
                      value, MS_LARGEST_VALID);
}

static msim_status check_table(const msim_law *law, msim_error *err) {
  msim_status status = check_count(law, 2, err);
  if (!status) status = check_numbers("stretch", law->n, law->stretch, err);
  if (!status) status = check_numbers("force", law->n, law->force, err);
  for (int32_t i = 1; i < law->n && !status; i++)
    if (!(law->stretch[i] > law->stretch[i - 1]))
      status =
          ms_error_set(err, MSIM_ERR_ARG, "stretch[%d] is %g, after %g; the stretches must ascend",
                       i, law->stretch[i], law->stretch[i - 1]);
  return status;
}

static msim_status check_polynomial(const msim_law *law, msim_error *err) {
  msim_status status = check_count(law, 1, err);
  if (!status) status = check_numbers("coefficients", law->n, law->coefficients, err);
  return status ? status : check_positive("limit", law->limit, err);
}

static msim_status check_callback(const msim_law *law, msim_error *err) {
  if (!law->function) return ms_error_set(err, MSIM_ERR_ARG, "function is NULL");
  if (!(law->energy_depth >= 0))
    return ms_error_set(err, MSIM_ERR_ARG, "energy_depth is %g; it must be >= 0",
                        law->energy_depth);
  return check_positive("largest_slope", law->largest_slope, err);
}

static msim_status refuse_member(const char *what, const msim_law *law, msim_error *err) {
  return ms_error_set(err, MSIM_ERR_ARG, "%s is set, but a law of kind %s does not have it", what,
                      ms_laws_kind_name(law->kind));
}

static msim_status check_absent(const msim_law *law, msim_error *err) {
  const int kind = law->kind;
  if (law->n != 0 && kind != MSIM_LAW_POLYNOMIAL && kind != MSIM_LAW_TABLE)
    return refuse_member("n", law, err);
  if (law->half_width != 0 && kind != MSIM_LAW_DEAD_BAND)
    return refuse_member("half_width", law, err);
  if (law->limit != 0 && kind != MSIM_LAW_POLYNOMIAL) return refuse_member("limit", law, err);
  if (law->coefficients && kind != MSIM_LAW_POLYNOMIAL)
    return refuse_member("coefficients", law, err);
  if (law->stretch && kind != MSIM_LAW_TABLE) return refuse_member("stretch", law, err);
  if (law->force && kind != MSIM_LAW_TABLE) return refuse_member("force", law, err);
  if (law->function && kind != MSIM_LAW_CALLBACK) return refuse_member("function", law, err);
  if (law->largest_slope != 0 && kind != MSIM_LAW_CALLBACK)
    return refuse_member("largest_slope", law, err);
  if (law->energy_depth != 0 && kind != MSIM_LAW_CALLBACK)
    return refuse_member("energy_depth", law, err);
  return MSIM_OK;
}

static msim_status check_threshold(const char *what, double value, msim_error *err) {
  if (isfinite(value) && value >= 0) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "%s is %g; it must be a finite number > 0, or 0: never",
                      what, value);
}

static msim_status check_thresholds(const msim_law *law, msim_error *err) {
  const msim_status status = check_threshold("break_strain", law->break_strain, err);
  if (status) return status;
  if (law->kind == MSIM_LAW_LINEAR && law->break_strain == 0 && law->break_force == 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "kind is linear: that is law 0 of every scene; set break_strain or "
                        "break_force, or use law 0");
  return check_threshold("break_force", law->break_force, err);
}

static msim_status check_law(const msim_law *law, msim_error *err) {
  if (!ms_laws_kind_name(law->kind))
    return ms_error_set(err, MSIM_ERR_ARG, "kind is %d; it must be one of MSIM_LAW_...", law->kind);
  msim_status status = check_thresholds(law, err);
  if (!status) status = check_absent(law, err);
  if (status) return status;
  if (law->kind == MSIM_LAW_TABLE) return check_table(law, err);
  if (law->kind == MSIM_LAW_POLYNOMIAL) return check_polynomial(law, err);
  if (law->kind == MSIM_LAW_CALLBACK) return check_callback(law, err);
  if (law->kind == MSIM_LAW_DEAD_BAND && !(isfinite(law->half_width) && law->half_width >= 0))
    return ms_error_set(err, MSIM_ERR_ARG, "half_width is %g; it must be a finite number >= 0",
                        law->half_width);
  return MSIM_OK;
}

/*------------------------------------- public ---------------------------------------------------*/

msim_status msim_scene_add_law(msim_scene *scene, const msim_law *law, int32_t *index,
                               msim_error *err) {
  if (!scene || !law) return ms_error_set(err, MSIM_ERR_ARG, "scene or law is NULL");
  msim_law given;
  msim_status status =
      ms_sized_check(law, sizeof given, MS_SIZE_THROUGH(msim_law, energy_depth), "law", "law", err);
  if (status) return status;
  ms_sized_read(&given, sizeof given, law);
  given.size = sizeof given;
  status = check_law(&given, err);
  if (status) return status;
  ms_law fresh;
  const msim_allocator alloc = scene->data->alloc;
  if (!ms_laws_prepare(&alloc, &given, &fresh)) return ms_error_set_memory(err, "a law of springs");
  if (!isfinite(fresh.slope) || isnan(fresh.depth)) {
    ms_laws_free_one(&alloc, &fresh);
    return ms_error_set(
        err, MSIM_ERR_ARG, "%s a slope beyond the range of double; use smaller numbers",
        given.kind == MSIM_LAW_TABLE ? "stretch and force give" : "coefficients and limit give");
  }
  ms_scene *s = ms_scene_make_writable(scene, err);
  status = s ? ms_memory_reserve(&s->alloc, MS_ARRAY(s->laws), s->nlaws, &s->law_capacity,
                                 (int64_t)s->nlaws + 1, err)
             : MSIM_ERR_MEMORY;
  if (status) {
    ms_laws_free_one(&alloc, &fresh);
    return status;
  }
  s->laws[s->nlaws++] = fresh;
  if (index) *index = s->nlaws;
  return ms_error_clear(err);
}

msim_status msim_scene_set_law(msim_scene *scene, int32_t n, const int32_t *springs, int32_t law,
                               msim_error *err) {
  if (!scene || (n > 0 && !springs))
    return ms_error_set(err, MSIM_ERR_ARG, "scene or springs is NULL");
  const ms_scene *now = scene->data;
  const msim_status status = ms_scene_check_count(n, "springs", err);
  if (status) return status;
  if (law < 0 || law > now->nlaws)
    return ms_error_set(err, MSIM_ERR_ARG, "law is %d; the scene has laws 0 to %d", law,
                        now->nlaws);
  for (int32_t i = 0; i < n; i++)
    if (springs[i] < 0 || springs[i] >= now->nsprings)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "springs[%d] is %d; there are %d springs, counted from 0", i, springs[i],
                          now->nsprings);
  if (n == 0 || (law == 0 && !now->law)) return ms_error_clear(err);
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  if (!s->law && !MS_NEW(&s->alloc, s->law, s->spring_capacity))
    return ms_error_set_memory(err, "the laws of springs");
  for (int32_t i = 0; i < n; i++) s->law[springs[i]] = law;
  return ms_error_clear(err);
}

msim_status msim_scene_get_law(const msim_scene *scene, int32_t index, msim_law *law) {
  if (!scene || !law || index < 0 || index > scene->data->nlaws) return MSIM_ERR_ARG;
  const msim_law linear = {.size = sizeof linear, .kind = MSIM_LAW_LINEAR};
  return ms_sized_write(law, index ? &scene->data->laws[index - 1].given : &linear, sizeof linear);
}
