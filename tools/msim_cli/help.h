/* help - the texts of the command `help`, of --help and of --version */
#ifndef CLI_HELP_H
#define CLI_HELP_H

#include "arguments.h"

/* Where descriptions begin */
enum { HELP_COLUMN = 27 };

/* A name, what follows it on the command line, and what it does. */
typedef struct help_entry {
  const char *name, *operands, *doc;
} help_entry;

/* The i-th command or variable of the environment, NULL past the end. */
const help_entry *help_command_info(int i);
const help_entry *help_environment_info(int i);

extern const char help_example[];

void help_program(void);
void help_command(command_id which);
void help_version(void);

/* The command `help [TOPIC]`, with argv[0] = "help". Returns the exit status. */
int help_topic(int argc, char **argv);

/* Refuse an unknown command. Returns the exit status. */
int help_refuse_command(const char *name);

#endif
