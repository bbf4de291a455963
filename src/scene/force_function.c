/* force_function - sets the force that the program computes */
#include <math.h>
#include <string.h>

#include "base/sized.h"
#include "scene/scene.h"

enum { LONGEST_NAME = 63, ALL_FLAGS = MSIM_FORCE_TIME | MSIM_FORCE_VELOCITY | MSIM_FORCE_JACOBIAN };

static msim_status check_name(const char *name, msim_error *err) {
  const size_t length = name ? strlen(name) : 0;
  if (length > 0 && length <= LONGEST_NAME && !strpbrk(name, "\r\n")) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "name of the force function is %s; it must have 1 to %d bytes and no line "
                      "ends",
                      !name                   ? "NULL"
                      : !*name                ? "empty"
                      : length > LONGEST_NAME ? "longer than that"
                                              : "of several lines",
                      LONGEST_NAME);
}

static msim_status check_bound(const char *what, double value, msim_error *err) {
  if (isfinite(value) && value >= 0) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "%s is %g; it must be a finite number >= 0", what, value);
}

static msim_status check_function(const msim_force_function *f, msim_error *err) {
  if (f->flags & ~(uint32_t)ALL_FLAGS)
    return ms_error_set(err, MSIM_ERR_ARG, "flags is %u; it must be a sum of MSIM_FORCE_... flags",
                        (unsigned)f->flags);
  if (!f->evaluate) return ms_error_set(err, MSIM_ERR_ARG, "evaluate is NULL");
  if (f->potential && f->flags & MSIM_FORCE_TIME)
    return ms_error_set(
        err, MSIM_ERR_ARG,
        "potential is set, but the force depends on time; remove the potential, and "
        "the work of the force is integrated");
  msim_status status = check_name(f->name, err);
  if (!status) status = check_bound("largest_stiffness", f->largest_stiffness, err);
  return status ? status : check_bound("largest_damping", f->largest_damping, err);
}

msim_status msim_scene_set_force_function(msim_scene *scene, const msim_force_function *function,
                                          msim_error *err) {
  if (!scene) return ms_error_set(err, MSIM_ERR_ARG, "scene is NULL");
  msim_force_function given = {0};
  if (function) {
    msim_status status =
        ms_sized_check(function, sizeof given, sizeof given, "force_function", "function", err);
    if (status) return status;
    ms_sized_read(&given, sizeof given, function);
    given.size = sizeof given;
    status = check_function(&given, err);
    if (status) return status;
  }
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  char *name = given.name ? ms_memory_copy_string(&s->alloc, given.name) : NULL;
  if (given.name && !name) return ms_error_set_memory(err, "a name");
  ms_memory_free(&s->alloc, (void *)(uintptr_t)s->force_function.name);
  s->force_function = given;
  s->force_function.name = name;
  return ms_error_clear(err);
}
