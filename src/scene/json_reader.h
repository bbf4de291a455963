/* json_reader - reading and checking the values of a scene file; error messages name the file, the
 * path of the key, the value found and the values allowed */
#ifndef MS_JSON_READER_H
#define MS_JSON_READER_H

#include "scene/objects.h"
#include "scene/value.h"

typedef struct ms_json_reader {
  const char *label; /* name of the file in messages */
  msim_allocator alloc;
  msim_scene *scene; /* scene under construction */
  msim_error *err;
  ms_shape *shapes; /* of `objects`; their springs are added after all particles */
  int32_t nshapes;
  int has_files; /* 1: an object refers to another file */
  int32_t first_particle,
      nends; /* of a part of the scene: its first particle, and ms_scene.nends */
} ms_json_reader;

/* A key path and, if they are >= 0, one or two indices: "springs.ij[3][1]". */
typedef struct ms_json_location {
  const char *key;
  int64_t i, j;
} ms_json_location;

/* Path of a member, "objects[0].k"; the root has the path "". */
typedef struct ms_key_path {
  char text[96];
} ms_key_path;
ms_key_path ms_json_member_path(const char *path, const char *key);
ms_key_path ms_json_item_path(const char *path, size_t i); /* "planes[1]" */

static inline ms_json_location ms_json_at(const char *key) {
  return (ms_json_location){key, -1, -1};
}
static inline ms_json_location ms_json_at_item(const char *key, size_t i) {
  return (ms_json_location){key, (int64_t)i, -1};
}

/* These set r->err and return its status. */
msim_status ms_json_fail(const ms_json_reader *r, msim_status status, const char *format, ...)
    MS_PRINTF(3, 4);
msim_status ms_json_refuse(const ms_json_reader *r, ms_json_location at, ms_value value,
                           const char *must);
msim_status ms_json_fail_memory(const ms_json_reader *r);
/* Pass on the status and message, in r->err, of another part of the library; MSIM_ERR_ARG with
 * `path` in front. */
msim_status ms_json_forward_error(const ms_json_reader *r, const char *path, msim_status status);

/* Check that `value` is an object with these keys only; `keys` ends with NULL. */
msim_status ms_json_check_keys(const ms_json_reader *r, const char *path, ms_value value,
                               const char *const *keys);
/* The same for the keys of a table. */
msim_status ms_json_check_table(const ms_json_reader *r, const char *path, ms_value value,
                                const ms_scene_key *keys, int32_t n);

/* As ms_json_refuse() where a number belongs: names the remedy for one in quotes. */
msim_status ms_json_refuse_number(const ms_json_reader *r, ms_json_location at, ms_value value,
                                  const char *must);

/* Get a member, which must be there. `must`: what it must be. */
msim_status ms_json_require(const ms_json_reader *r, const char *path, ms_value object,
                            const char *key, const char *must, ms_value *value);
/* The same, with a text made from the key. */
msim_status ms_json_require_key(const ms_json_reader *r, const char *path, ms_value object,
                                const ms_scene_key *key, ms_value *value);
msim_status ms_json_read_array_size(const ms_json_reader *r, const char *key, ms_value value,
                                    int32_t *n);

msim_status ms_json_read_number(const ms_json_reader *r, ms_json_location at, ms_value value,
                                ms_range range, double *number);
/* true or false; files of importers, which have no booleans, have 1 or 0. */
msim_status ms_json_read_flag(const ms_json_reader *r, ms_json_location at, ms_value value,
                              int32_t *flag);
/* An array of exactly n numbers. */
msim_status ms_json_read_row(const ms_json_reader *r, ms_json_location at, ms_value value,
                             ms_range range, int32_t n, double *numbers);
/* The numbers of a key of the form MS_NUMBERS; they stay if it is missing and may be. */
msim_status ms_json_read_numbers(const ms_json_reader *r, const char *path, ms_value object,
                                 const ms_scene_key *key, double *numbers);
/* An array of n rows of three numbers. */
msim_status ms_json_read_rows(const ms_json_reader *r, const char *key, ms_value value, int32_t n,
                              double *numbers /* 3n */);
/* One number for all, or an array of n numbers. */
msim_status ms_json_read_each(const ms_json_reader *r, const char *key, ms_value value,
                              ms_range range, int32_t n, double *numbers);
/* An integer from 0 to n - 1. */
msim_status ms_json_read_index(const ms_json_reader *r, ms_json_location at, ms_value value,
                               int32_t n, int32_t *index);

/* An array of n rows of `width` indices of particles of the scene. */
msim_status ms_json_read_index_rows(const ms_json_reader *r, const char *key, ms_value rows,
                                    int32_t width, int32_t n, int32_t *to);

#endif
