/* completion - the command `completion`: shell functions that complete command lines */
#ifndef CLI_COMPLETION_H
#define CLI_COMPLETION_H

/* Print the function for a shell, bash or zsh; argv[0] = "completion". Returns the exit status. */
int completion_command(int argc, char **argv);

#endif
