#define _POSIX_C_SOURCE 200809L /* getline, strcasecmp, strtok_r */
#include "obj.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/types.h>

#include "mark.h"

typedef struct vertex {
  double x[3];
  int is_used;
} vertex;

typedef struct obj {
  vertex *vertices;
  int64_t n, room;
  int64_t nbefore; /* vertices before the present line, to which negative corners refer */
  int is_element;  /* the present line is a face, a line or a point, or continues one */
  int lacks_memory;
} obj;

static void add_vertex(obj *o, const char *numbers) {
  if (o->n == o->room) {
    const int64_t room = o->room ? 2 * o->room : 1024;
    vertex *vertices = realloc(o->vertices, (size_t)room * sizeof *vertices);
    if (!vertices) o->lacks_memory = 1;
    if (!vertices) return;
    o->vertices = vertices, o->room = room;
  }
  vertex *v = &o->vertices[o->n++];
  *v = (vertex){{0}, 0};
  sscanf(numbers, "%lf %lf %lf", &v->x[0], &v->x[1], &v->x[2]);
}

/* Corners are v, v/vt, v//vn or v/vt/vn; v counts from 1, or, if negative, back from the last
 * vertex. */
static void mark_corners(obj *o, char *corners) {
  const char *const separators = " \t\r\n\\";
  char *rest;
  for (char *word = strtok_r(corners, separators, &rest); word;
       word = strtok_r(NULL, separators, &rest)) {
    const long long number = strtoll(word, NULL, 10);
    const int64_t v = number < 0 ? o->nbefore + number : number - 1;
    if (v >= 0 && v < o->n) o->vertices[v].is_used = 1;
  }
}

/* Faces may precede their vertices, which are read first. */
typedef enum reading { VERTICES, ELEMENTS } reading;

static void read_line(obj *o, char *line, reading what) {
  const int continues = o->is_element; /* the line before ends with a backslash */
  line += strspn(line, " \t");
  const char keyword = *line && strchr(" \t", line[1]) ? *line : '\0';
  const size_t length = strcspn(line, "\r\n");
  const int ends = length == 0 || line[length - 1] != '\\';
  if (!continues && keyword == 'v') {
    if (what == VERTICES) add_vertex(o, line + 1);
    else o->nbefore++;
  }
  o->is_element = continues || keyword == 'f' || keyword == 'l' || keyword == 'p';
  if (o->is_element && what == ELEMENTS) mark_corners(o, continues ? line : line + 1);
  if (ends) o->is_element = 0;
}

static void read_lines(obj *o, FILE *file, reading what) {
  char *line = NULL;
  size_t room = 0;
  assimp_skip_mark(file);
  o->is_element = 0;
  while (!o->lacks_memory && getline(&line, &room, file) >= 0) read_line(o, line, what);
  free(line);
}

/* The coordinates of unused vertices, in place */
static double *collect_unused(obj *o, int64_t *n) {
  double *x = (double *)o->vertices;
  for (int64_t v = 0; v < o->n; v++)
    if (!o->vertices[v].is_used) memmove(x + 3 * (*n)++, o->vertices[v].x, 3 * sizeof *x);
  if (*n) return x;
  free(x);
  return NULL;
}

msim_status assimp_obj_find_unused(const msim_host *host, const char *path, int64_t *n,
                                   double **x) {
  const char *extension = strrchr(path, '.');
  obj o = {0};
  *n = 0, *x = NULL;
  FILE *file = extension && strcasecmp(extension, ".obj") == 0 ? fopen(path, "rb") : NULL;
  if (!file) return MSIM_OK;
  read_lines(&o, file, VERTICES);
  read_lines(&o, file, ELEMENTS);
  fclose(file);
  *x = collect_unused(&o, n);
  if (!o.lacks_memory) return MSIM_OK;
  free(*x);
  host->fail(host, "out of memory");
  return MSIM_ERR_MEMORY;
}
