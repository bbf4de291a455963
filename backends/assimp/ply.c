#include "ply.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mark.h"

typedef struct number_type {
  const char *name, *alias;
  int size; /* bytes */
  enum { SIGNED, UNSIGNED, FLOAT } kind;
} number_type;

static const number_type types[] = {
    {"char", "int8", 1, SIGNED},    {"uchar", "uint8", 1, UNSIGNED},
    {"short", "int16", 2, SIGNED},  {"ushort", "uint16", 2, UNSIGNED},
    {"int", "int32", 4, SIGNED},    {"uint", "uint32", 4, UNSIGNED},
    {"float", "float32", 4, FLOAT}, {"double", "float64", 8, FLOAT},
};

typedef struct property {
  const number_type *count, *type; /* count: of the length of a list; NULL: one number */
  int has_corners;                 /* the list is that of the corners of a face */
} property;

typedef struct element {
  char name[32];
  int64_t n;
  int end; /* its properties are those up to here */
} element;

enum { MOST_ELEMENTS = 16, MOST_PROPERTIES = 256 };

typedef struct ply {
  FILE *file;
  int is_text, is_big_endian;
  int nelements, nproperties;
  element element[MOST_ELEMENTS];
  property property[MOST_PROPERTIES];
} ply;

/*------------------------------------- the header -----------------------------------------------*/

static const number_type *find_type(const char *name) {
  for (size_t i = 0; i < sizeof types / sizeof *types; i++)
    if (strcmp(name, types[i].name) == 0 || strcmp(name, types[i].alias) == 0) return &types[i];
  return NULL;
}

static int add_element(ply *p, const char *line) {
  char number[32], *end;
  if (p->nelements == MOST_ELEMENTS) return 0;
  element *e = &p->element[p->nelements++];
  if (sscanf(line, " element %31s %31s", e->name, number) < 2) return 0;
  e->n = strtoll(number, &end, 10), e->end = p->nproperties;
  return !*end && e->n >= 0;
}

static int add_property(ply *p, const char *line) {
  char count[16], type[16], name[32] = "";
  if (p->nelements == 0 || p->nproperties == MOST_PROPERTIES) return 0;
  property *to = &p->property[p->nproperties];
  const int is_list = sscanf(line, " property list %15s %15s %31s", count, type, name) == 3;
  if (!is_list && sscanf(line, " property %15s", type) < 1) return 0;
  to->count = is_list ? find_type(count) : NULL;
  to->type = find_type(type);
  to->has_corners = strcmp(name, "vertex_indices") == 0 || strcmp(name, "vertex_index") == 0;
  p->element[p->nelements - 1].end = ++p->nproperties;
  return to->type && (!is_list || (to->count && to->count->kind != FLOAT));
}

static int set_format(ply *p, const char *name) {
  p->is_text = strcmp(name, "ascii") == 0;
  p->is_big_endian = strcmp(name, "binary_big_endian") == 0;
  return p->is_text || p->is_big_endian || strcmp(name, "binary_little_endian") == 0;
}

static int read_header(ply *p) {
  char line[512], first[16], second[32];
  int has_format = 0;
  while (fgets(line, sizeof line, p->file)) {
    const int nwords = sscanf(line, "%15s %31s", first, second);
    int is_good = nwords > 0 && strchr(line, '\n');
    if (is_good && strcmp(first, "end_header") == 0) return has_format;
    if (strcmp(first, "element") == 0) is_good = is_good && add_element(p, line);
    else if (strcmp(first, "property") == 0) is_good = is_good && add_property(p, line);
    else if (strcmp(first, "format") == 0)
      is_good = has_format = is_good && nwords > 1 && set_format(p, second);
    else
      is_good = is_good && (strcmp(first, "ply") == 0 || strcmp(first, "comment") == 0 ||
                            strcmp(first, "obj_info") == 0);
    if (!is_good) return 0;
  }
  return 0;
}

/*------------------------------------- numbers --------------------------------------------------*/

/* The next character that is not blank, but at the end of a line, is left. */
static int skip_blanks(FILE *file) {
  int c = getc(file);
  while (c == ' ' || c == '\t' || c == '\r') c = getc(file);
  if (c != EOF) ungetc(c, file);
  return c;
}

/* The next number of the line; NAN: there is none */
static double read_text(FILE *file) {
  char word[64], *end;
  const int next = skip_blanks(file);
  if (next == '\n' || fscanf(file, "%63s", word) != 1) return NAN;
  const double number = strtod(word, &end);
  return *end ? NAN : number;
}

static double read_binary(const ply *p, const number_type *type) {
  uint64_t bits = 0;
  for (int i = 0; i < type->size; i++) {
    const int c = getc(p->file);
    if (c == EOF) return NAN;
    bits |= (uint64_t)c << 8 * (p->is_big_endian ? type->size - 1 - i : i);
  }
  if (type->kind == FLOAT) return 0; /* any bits are a number, and libassimp reads it */
  const uint64_t half = (uint64_t)1 << (8 * type->size - 1);
  const double number = (double)bits;
  return type->kind == SIGNED && bits >= half ? number - 2 * (double)half : number;
}

static double read_number(const ply *p, const number_type *type) {
  return p->is_text ? read_text(p->file) : read_binary(p, type);
}

/*------------------------------------- elements -------------------------------------------------*/

static int64_t count_elements(const ply *p, const char *name) {
  for (int e = 0; e < p->nelements; e++)
    if (strcmp(p->element[e].name, name) == 0) return p->element[e].n;
  return 0;
}

/* 1: the number is an index below n. */
static int is_index(double number, double n) {
  return number >= 0 && number < n && number == floor(number);
}

/* 1: the numbers of the property are there, and each corner is a vertex. */
static int read_property(const ply *p, const property *of, int64_t nvertices) {
  const double n = of->count ? read_number(p, of->count) : 1;
  if (!is_index(n, INT32_MAX)) return 0;
  for (int32_t i = 0; i < (int32_t)n; i++) {
    const double number = read_number(p, of->type);
    if (isnan(number) || (of->has_corners && !is_index(number, (double)nvertices))) return 0;
  }
  return 1;
}

static int read_row(const ply *p, int begin, int end, int64_t nvertices) {
  if (p->is_text)
    while (skip_blanks(p->file) == '\n') getc(p->file);
  for (int i = begin; i < end; i++)
    if (!read_property(p, &p->property[i], nvertices)) return 0;
  if (!p->is_text) return 1;
  const int next = skip_blanks(p->file);
  return next == '\n' || next == EOF;
}

static msim_status fail_row(const msim_host *host, const ply *p, const element *e, int64_t row) {
  if (feof(p->file))
    host->fail(host, "it ends before %s %lld, and its header states %lld: the file is truncated",
               e->name, (long long)row, (long long)e->n);
  else
    host->fail(host, "%s %lld does not consist of the numbers that the header states%s", e->name,
               (long long)row,
               strcmp(e->name, "face") == 0 ? ", or has a corner that is no vertex" : "");
  return MSIM_ERR_ARG;
}

static msim_status check_elements(const msim_host *host, const ply *p) {
  const int64_t nvertices = count_elements(p, "vertex");
  for (int e = 0, begin = 0; e < p->nelements; begin = p->element[e++].end)
    for (int64_t row = 0; row < p->element[e].n; row++)
      if (!read_row(p, begin, p->element[e].end, nvertices))
        return fail_row(host, p, &p->element[e], row);
  char word[2];
  if (fscanf(p->file, "%1s", word) != 1) return MSIM_OK;
  host->fail(host, "it has more than its header states: the file is damaged");
  return MSIM_ERR_ARG;
}

static msim_status check_ply(const msim_host *host, ply *p) {
  if (!read_header(p)) host->fail(host, "its header of PLY is damaged, or has no end");
  /* libassimp keeps one triangle of each strip */
  else if (count_elements(p, "tristrips") > 0)
    host->fail(host, "it has triangle strips, which are not supported; convert them to faces");
  else return check_elements(host, p);
  return MSIM_ERR_ARG;
}

msim_status assimp_ply_check(const msim_host *host, const char *path) {
  char start[4] = "";
  ply p = {.file = fopen(path, "rb")};
  if (!p.file) return MSIM_OK;
  assimp_skip_mark(p.file);
  const long begin = ftell(p.file);
  const int is_ply = fread(start, 1, 3, p.file) == 3 && strcmp(start, "ply") == 0;
  const msim_status status =
      is_ply && fseek(p.file, begin, SEEK_SET) == 0 ? check_ply(host, &p) : MSIM_OK;
  fclose(p.file);
  return status;
}
