#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "scene/import.h"
#include "scene/laws.h"

/* "path: cannot be read: Permission denied" */
static msim_status fail_io(msim_error *err, const char *path, const char *what, int number) {
  return ms_error_set(err, ms_error_io_status(number), "%s: cannot be %s: %s", path, what,
                      strerror(number));
}

/*------------------------------------- load -----------------------------------------------------*/

/* Read a file, which may be a pipe, to its end. The caller deletes *text, also after an error. */
static msim_status read_whole_file(const msim_allocator *alloc, FILE *file, const char *path,
                                   char **text, size_t *length, msim_error *err) {
  size_t room = 0, got = 1;
  for (*length = 0; got > 0; *length += got) {
    if (*length == room) {
      room = 2 * room + (1 << 16);
      char *larger = ms_memory_allocate(alloc, room, 1);
      if (!larger) return ms_error_set_memory(err, path);
      if (*text) memcpy(larger, *text, *length);
      ms_memory_free(alloc, *text);
      *text = larger;
    }
    errno = 0;
    got = fread(*text + *length, 1, room - *length, file);
  }
  return ferror(file) ? fail_io(err, path, "read", errno) : MSIM_OK;
}

static int begins_as_json(const char *text, size_t length) {
  size_t i = 0;
  while (i < length && strchr(" \t\r\n", text[i])) i++;
  return i == length || text[i] == '{';
}

/* no_importer: why no importer takes the file; "" if none was looked for. */
static msim_status load_json(const msim_allocator *alloc, FILE *file, const char *path,
                             const char *no_importer, msim_scene **scene, msim_error *err) {
  const msim_allocator a = ms_memory_allocator(alloc);
  char *text = NULL;
  size_t length;
  msim_status status = read_whole_file(&a, file, path, &text, &length, err);
  if (!status && *no_importer && !begins_as_json(text, length))
    status = ms_error_set(err, MSIM_ERR_ARG, "%s is not a JSON scene; %s", path, no_importer);
  if (!status) status = msim_scene_parse(alloc, path, text, length, scene, err);
  ms_memory_free(&a, text);
  return status;
}

static msim_status load_file(const msim_allocator *alloc, const char *path, int32_t rank,
                             int32_t nranks, msim_scene **scene, msim_error *err) {
  if (scene) *scene = NULL;
  if (!scene || !path) return ms_error_set(err, MSIM_ERR_ARG, "scene or path is NULL");
  msim_status status = ms_memory_check_allocator(alloc, err);
  if (status) return status;
  FILE *file = fopen(path, "rb");
  if (!file) return fail_io(err, path, "read", errno);
  const msim_allocator a = ms_memory_allocator(alloc);
  const msim_importer *importer;
  msim_error why;
  status = ms_importers_find(path, &a, &importer, &why);
  if (status) ms_error_set(err, status, "%s: %s", path, why.text);
  else if (importer && nranks > 1)
    status = ms_import_scene_part(alloc, importer, path, rank, nranks, scene, err);
  else if (importer) status = ms_import_scene(alloc, importer, path, scene, err);
  else status = load_json(alloc, file, path, why.text, scene, err);
  fclose(file);
  return status;
}

msim_status msim_scene_load(const msim_allocator *alloc, const char *path, msim_scene **scene,
                            msim_error *err) {
  return load_file(alloc, path, 0, 1, scene, err);
}

msim_status msim_scene_load_part(const msim_allocator *alloc, const char *path, int32_t rank,
                                 int32_t nranks, msim_scene **scene, msim_error *err) {
  if (scene) *scene = NULL;
  if (rank < 0 || rank >= nranks)
    return ms_error_set(err, MSIM_ERR_ARG, "rank %d of %d ranks is not in [0, %d)", rank, nranks,
                        nranks);
  return load_file(alloc, path, rank, nranks, scene, err);
}

/*------------------------------------- save -----------------------------------------------------*/

/* Returns errno, or 0. */
static int write_text_file(const char *path, const ms_text *text) {
  FILE *file = fopen(path, "wb");
  if (!file) return errno;
  errno = 0;
  int fault = fwrite(text->data, 1, text->length, file) == text->length ? 0 : errno;
  /* a full disk may be reported only here */
  if (fclose(file) && !fault) fault = errno;
  if (fault) remove(path);
  return fault;
}

static msim_status write_json(const ms_scene *scene, const char *part, const char *path,
                              msim_error *err) {
  ms_text text = {.alloc = &scene->alloc};
  msim_status status = ms_scene_write_json(scene, &text, err);
  const int fault = status ? 0 : write_text_file(part, &text);
  ms_text_free(&text);
  return fault ? fail_io(err, path, "written", fault) : status;
}

/* Write to the file `part`, then rename it: a file named `path` is always complete. */
static msim_status save_to_part(const ms_scene *scene, const char *part, const char *path,
                                msim_error *err) {
  const msim_importer *importer;
  msim_error why;
  msim_status status = ms_importers_find(path, &scene->alloc, &importer, &why);
  if (status) return ms_error_set(err, status, "%s: %s", path, why.text);
  status = importer ? ms_export_scene(scene, importer, part, path, err)
                    : write_json(scene, part, path, err);
  if (!status && rename(part, path)) status = fail_io(err, path, "written", errno);
  if (status) remove(part);
  return status;
}

msim_status msim_scene_save(const msim_scene *scene, const char *path, msim_error *err) {
  if (!scene || !path) return ms_error_set(err, MSIM_ERR_ARG, "scene or path is NULL");
  for (int32_t i = 0; i < scene->data->nlaws; i++)
    if (scene->data->laws[i].given.kind == MSIM_LAW_CALLBACK)
      return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                          "law %d is a callback, which scene files cannot represent; use a table",
                          i + 1);
  if (ms_scene_has_function(scene->data))
    return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                        "force function '%s' is part of the program, and scene files cannot "
                        "represent it; remove it before the scene is saved",
                        scene->data->force_function.name);
  const msim_allocator alloc = scene->data->alloc;
  ms_text part = {.alloc = &alloc};
  ms_text_append(&part, "%s.part", path);
  msim_status status = part.failed ? ms_error_set_memory(err, "a file name")
                                   : save_to_part(scene->data, part.data, path, err);
  ms_text_free(&part);
  return status ? status : ms_error_clear(err);
}
