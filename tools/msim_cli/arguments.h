/* arguments - the command line as one struct */
#ifndef CLI_ARGUMENTS_H
#define CLI_ARGUMENTS_H

#include "msim/msim.h"

typedef enum command_id { COMMAND_RUN, COMMAND_EXPLAIN, COMMAND_LIST, NCOMMANDS } command_id;

const char *command_name(command_id which);

typedef struct setting {
  const char *name, *value; /* as msim_options_set takes them */
} setting;

typedef struct arguments {
  command_id which;
  const char *scene;              /* NULL for list */
  const char *out, *final, *init; /* NULL: not given */
  int resume, force, stats, quiet, help;
  int nsettings;
  setting *settings;    /* nsettings, in the order given */
  msim_options options; /* the defaults, and the settings on top */
} arguments;

/* What only the command line knows; the other flags are the library's options. */
typedef struct cli_flag {
  const char *name;
  const char *value; /* what it takes, "FILE"; NULL: nothing */
  const char *doc;
  unsigned commands; /* 1 << command of those that have it */
  size_t member;     /* offset in arguments: const char * where it takes something, else int */
} cli_flag;

/* The i-th flag, NULL past the end. */
const cli_flag *flag_info(int i);

/* Whether a command has an option of the library as a flag. */
int command_has_option(command_id which, const msim_option_entry *option);

/* Read argv from argv[1] on; complains and returns EXIT_ERROR where it makes no sense. Strings are
 * borrowed from argv. Call arguments_free in any case. */
int arguments_parse(command_id which, int argc, char **argv, arguments *args);
void arguments_free(arguments *args);

/* Defaults, then the scene's `run`, then the command line; complains. Strings are borrowed. */
int arguments_options(const arguments *args, const msim_scene *scene, msim_options *options);

#endif
