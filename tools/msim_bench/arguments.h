/* arguments - parses the command line of msim_bench */
#ifndef BENCH_ARGUMENTS_H
#define BENCH_ARGUMENTS_H

#include "benches.h"

typedef struct arguments {
  const bench_entry *bench; /* NULL if help or version is requested */
  bench_options options;
  const char *json; /* NULL: not given */
  int help, version;
} arguments;

typedef struct bench_flag {
  const char *name;
  const char *value; /* placeholder of its argument, such as "FILE"; NULL: the flag takes none */
  const char *doc;
} bench_flag;

/* The i-th flag; NULL past the end. */
const bench_flag *flag_info(int i);

/* Parses argv[1] onward. Prints an error and returns EXIT_ERROR if the command line is invalid. */
int arguments_parse(int argc, char **argv, arguments *args);

#endif
