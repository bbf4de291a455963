/* scene_help - the keys of scene files, taken from the schema of the library */
#ifndef CLI_SCENE_HELP_H
#define CLI_SCENE_HELP_H

#include <stddef.h>

/* A key of scene files. */
typedef struct scene_key {
  const char *path; /* "objects[rope].n" */
  const char *name; /* "n" */
  const char *doc, *unit, *values;
  const char *preset, *example; /* JSON; "": none */
  int required;
} scene_key;

/* Show all keys, in their order, to a function; a nonzero result ends that and is returned. Prints
 * errors, and returns EXIT_ERROR then. */
typedef int scene_key_visitor(const scene_key *key, void *user);
int scene_help_visit(scene_key_visitor *visit, void *user);

/* A key in one sentence: "masses (kg; a number > 0; required)". `text` has room for size. */
void scene_help_describe(const scene_key *key, char *text, size_t size);

/* A visitor that prints a key. */
int scene_help_print_key(const scene_key *key, void *user);

/* These print, and return the exit status. */
int scene_help_print(void);
int scene_help_print_schema(void);

#endif
