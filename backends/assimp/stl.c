#define _POSIX_C_SOURCE 200809L /* strcasecmp */
#include "stl.h"
#include "mark.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct text {
  FILE *file;
  int64_t nfacets;
  int ncorners; /* of the facet that is read; -1: none */
  int is_open;  /* endsolid is to follow */
  const char *fault;
} text;

/* Binary files may begin like text; they have 50 bytes a facet, whose number stands in byte 80. */
static int is_binary(FILE *file) {
  char head[84] = "";
  uint32_t nfacets;
  const size_t n = fread(head, 1, sizeof head, file);
  memcpy(&nfacets, head + 80, sizeof nfacets);
  return n == sizeof head && fseek(file, 0, SEEK_END) == 0 &&
         ftell(file) == 84 + 50 * (long)nfacets;
}

int assimp_stl_is_text(FILE *file) {
  char word[6] = "";
  const int binary = is_binary(file);
  assimp_skip_mark(file);
  const int is_solid = fscanf(file, " %5s", word) == 1 && strcasecmp(word, "solid") == 0;
  return is_solid && !binary && fseek(file, -5, SEEK_CUR) == 0;
}

static void skip_line(FILE *file) {
  for (int c = 0; c != EOF && c != '\n';) c = getc(file);
}

static int is_number(const char *word) {
  char *end;
  strtod(word, &end);
  return end > word && !*end;
}

/* libassimp refuses what is no number, too, but does not free its memory then. */
static void read_vertex(text *t) {
  char word[3][64];
  const int n = fscanf(t->file, "%63s %63s %63s", word[0], word[1], word[2]);
  if (t->ncorners < 0) t->fault = "is followed by a vertex outside of facets";
  else if (n < 3 || !is_number(word[0]) || !is_number(word[1]) || !is_number(word[2]))
    t->fault = "has a vertex of fewer than three numbers";
  t->ncorners++;
}

static void read_word(text *t, const char *word) {
  if (strcasecmp(word, "vertex") == 0) read_vertex(t);
  else if (strcasecmp(word, "endfacet") == 0) {
    if (t->ncorners != 3) t->fault = "does not have three vertices";
    t->ncorners = -1;
  } else if (strcasecmp(word, "facet") == 0) {
    if (t->ncorners >= 0) t->fault = "does not end with endfacet";
    else t->nfacets++;
    t->ncorners = 0;
  } else if (strcasecmp(word, "solid") == 0 || strcasecmp(word, "endsolid") == 0) {
    if (t->ncorners >= 0) t->fault = "does not end with endfacet";
    t->is_open = strcasecmp(word, "solid") == 0;
    skip_line(t->file); /* a name */
  }
}

static msim_status check_text(const msim_host *host, text *t) {
  char word[64];
  while (!t->fault && fscanf(t->file, "%63s", word) == 1) read_word(t, word);
  if (!t->fault && !t->is_open) return MSIM_OK;
  if (t->fault)
    host->fail(host, "facet %lld %s: the file is damaged or truncated", (long long)t->nfacets,
               t->fault);
  else host->fail(host, "it does not end with endsolid: the file is truncated");
  return MSIM_ERR_ARG;
}

msim_status assimp_stl_check(const msim_host *host, const char *path) {
  text t = {.file = fopen(path, "rb"), .ncorners = -1, .is_open = 1};
  if (!t.file) return MSIM_OK;
  const msim_status status = assimp_stl_is_text(t.file) ? check_text(host, &t) : MSIM_OK;
  fclose(t.file);
  return status;
}
