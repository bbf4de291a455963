/* arguments - parse the command line into one struct */
#ifndef CLI_ARGUMENTS_H
#define CLI_ARGUMENTS_H

#include "msim/msim.h"
#include "tables.h"

typedef enum command_id {
  COMMAND_RUN,
  COMMAND_REST,
  COMMAND_MODES,
  COMMAND_EXPLAIN,
  COMMAND_LIST,
  NCOMMANDS
} command_id;

const char *command_name(command_id which);

typedef struct setting {
  const char *name, *value; /* as msim_options_set takes them */
} setting;

typedef struct arguments {
  command_id which;
  const char *scene;               /* NULL for list */
  const char *out, *final, *init;  /* NULL: not given */
  const char *ftol, *count, *json; /* of rest and modes; NULL: not given */
  const char *tables[NTABLES]; /* files of --energies, --reactions, --springs; NULL: not given */
  int resume, force, stats, quiet, help;
  int nsettings;
  setting *settings;    /* nsettings, in the order given */
  msim_options options; /* the defaults, and the settings on top */
} arguments;

/* A flag of the command line alone; all other flags are options of the library. */
typedef struct cli_flag {
  const char *name;
  const char *value; /* name of its value, "FILE"; NULL: it takes none */
  const char *doc;
  unsigned commands; /* bits 1 << command: the commands that have it */
  size_t member;     /* offset in arguments: const char * if it takes a value, else int */
} cli_flag;

/* The i-th flag, NULL past the end. */
const cli_flag *flag_info(int i);

/* 1: the command has this option of the library as a flag. */
int command_has_option(command_id which, const msim_option_entry *option);

/* Parse argv from argv[1] on. Prints errors. Strings are borrowed from argv. Call arguments_free
 * always. */
int arguments_parse(command_id which, int argc, char **argv, arguments *args);
void arguments_free(arguments *args);

/* Set the options: defaults, then the scene's `run`, then the command line. Strings are borrowed.
 * Prints errors. */
int arguments_options(const arguments *args, const msim_scene *scene, msim_options *options);

#endif
