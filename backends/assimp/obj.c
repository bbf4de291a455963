#define _POSIX_C_SOURCE 200809L /* getline, strcasecmp, strtok_r */
#include "obj.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/types.h>

#include "mark.h"

typedef struct obj {
  char *is_used; /* of each vertex */
  int64_t n, room;
  int64_t nbefore; /* vertices before the present line, to which negative corners refer */
  int is_face;     /* the present line is a face, or continues one */
  int lacks_memory;
} obj;

static void add_vertex(obj *o) {
  if (o->n == o->room) {
    const int64_t room = o->room ? 2 * o->room : 1024;
    char *is_used = realloc(o->is_used, (size_t)room);
    if (!is_used) o->lacks_memory = 1;
    if (!is_used) return;
    o->is_used = is_used, o->room = room;
  }
  o->is_used[o->n++] = 0;
}

/* Corners are v, v/vt, v//vn or v/vt/vn; v counts from 1, or, if negative, back from the last
 * vertex. */
static void mark_corners(obj *o, char *corners) {
  const char *const separators = " \t\\";
  char *rest;
  for (char *word = strtok_r(corners, separators, &rest); word;
       word = strtok_r(NULL, separators, &rest)) {
    const long long number = strtoll(word, NULL, 10);
    const int64_t v = number < 0 ? o->nbefore + number : number - 1;
    if (v >= 0 && v < o->n) o->is_used[v] = 1;
  }
}

/* Faces may precede their vertices, which are read first. */
typedef enum reading { VERTICES, FACES } reading;

static void read_line(obj *o, char *line, reading what) {
  const int continues = o->is_face; /* the line before ends with a backslash */
  line += strspn(line, " \t");
  const char keyword = *line && strchr(" \t", line[1]) ? *line : '\0';
  const size_t length = strlen(line);
  const int ends = length == 0 || line[length - 1] != '\\';
  if (!continues && keyword == 'v') {
    if (what == VERTICES) add_vertex(o);
    else o->nbefore++;
  }
  o->is_face = continues || keyword == 'f';
  if (o->is_face && what == FACES) mark_corners(o, continues ? line : line + 1);
  if (ends) o->is_face = 0;
}

/* Lines end with \n, \r\n or \r. */
static void read_lines(obj *o, FILE *file, reading what) {
  char *lines = NULL, *rest;
  size_t room = 0;
  assimp_skip_mark(file);
  o->is_face = 0;
  while (!o->lacks_memory && getline(&lines, &room, file) >= 0) {
    char *line = strtok_r(lines, "\r\n", &rest);
    if (!line) o->is_face = 0; /* it is empty */
    for (; line; line = strtok_r(NULL, "\r\n", &rest)) read_line(o, line, what);
  }
  free(lines);
}

msim_status assimp_obj_count_unused(const msim_host *host, const char *path, int64_t *n) {
  const char *extension = strrchr(path, '.');
  obj o = {0};
  *n = 0;
  FILE *file = extension && strcasecmp(extension, ".obj") == 0 ? fopen(path, "rb") : NULL;
  if (!file) return MSIM_OK;
  read_lines(&o, file, VERTICES);
  read_lines(&o, file, FACES);
  fclose(file);
  for (int64_t v = 0; v < o.n; v++) *n += !o.is_used[v];
  free(o.is_used);
  if (!o.lacks_memory) return MSIM_OK;
  host->fail(host, "out of memory");
  return MSIM_ERR_MEMORY;
}
