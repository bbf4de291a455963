/* message - text for people: one line to stderr when something is wrong, columns to stdout */
#ifndef TOOLS_MESSAGE_H
#define TOOLS_MESSAGE_H

#include <stddef.h>

#if defined(__GNUC__)
#  define TOOLS_PRINTF(string, first) __attribute__((format(printf, string, first)))
#else
#  define TOOLS_PRINTF(string, first)
#endif

/* "msim_cli": what every message begins with. Each program defines its own. */
extern const char program_name[];

enum { EXIT_OK = 0, EXIT_ERROR = 1, EXIT_EVENT = 2 };

/* "PROGRAM: ..." in one line, whatever the text holds. Returns EXIT_ERROR. */
int complain(const char *format, ...) TOOLS_PRINTF(1, 2);

/* The same for a command line that makes no sense: points to the help of `command`, "" for that of
 * the program. */
int complain_usage(const char *command, const char *format, ...) TOOLS_PRINTF(2, 3);

/* Blanks for control characters, so that no file's text can move the cursor or break the line. */
void clean_text(char *text);

/* Print text at `column`, which the cursor has reached, and break it at blanks before column 80. */
void print_wrapped(size_t column, const char *text);

/* Print `text` after two blanks and fill up to `column`, on the next line where it is too long. */
void print_column(size_t column, const char *text);

#endif
