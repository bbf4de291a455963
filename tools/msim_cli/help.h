/* help - what --help and --version print */
#ifndef CLI_HELP_H
#define CLI_HELP_H

#include "arguments.h"

void help_program(void);
void help_command(command_id which);
void help_version(void);

#endif
