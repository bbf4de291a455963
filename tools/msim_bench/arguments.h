/* arguments - the command line as one struct */
#ifndef BENCH_ARGUMENTS_H
#define BENCH_ARGUMENTS_H

#include "benches.h"

typedef struct arguments {
  const bench_entry *bench; /* NULL where help or version are asked for */
  bench_wishes wishes;
  const char *json, *csv, *svg; /* NULL: not given */
  int help, version;
} arguments;

typedef struct bench_flag {
  const char *name;
  const char *value; /* what it takes, "FILE"; NULL: nothing */
  const char *doc;
  /* value: NULL where it takes nothing. Complains, and returns EXIT_ERROR, where it is wrong. */
  int (*take)(arguments *args, const char *value);
} bench_flag;

/* The i-th flag, NULL past the end. */
const bench_flag *flag_info(int i);

/* Read argv from argv[1] on; complains and returns EXIT_ERROR where it makes no sense. */
int arguments_parse(int argc, char **argv, arguments *args);

#endif
