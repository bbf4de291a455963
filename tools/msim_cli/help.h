/* help - print the texts of --help and --version */
#ifndef CLI_HELP_H
#define CLI_HELP_H

#include "arguments.h"

void help_program(void);
void help_command(command_id which);
void help_version(void);

#endif
