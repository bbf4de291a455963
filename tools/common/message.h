/* message - error messages on stderr, one line each, and text in columns on stdout */
#ifndef TOOLS_MESSAGE_H
#define TOOLS_MESSAGE_H

#include <stddef.h>

#if defined(__GNUC__)
#  define TOOLS_PRINTF(string, first) __attribute__((format(printf, string, first)))
#else
#  define TOOLS_PRINTF(string, first)
#endif

/* The start of every message, as "msim_cli"; each program defines its own. */
extern const char program_name[];

enum { EXIT_OK = 0, EXIT_ERROR = 1, EXIT_EVENT = 2 };

/* Print "PROGRAM: ..." to stderr, control characters as blanks. Returns EXIT_ERROR. */
int report_error(const char *format, ...) TOOLS_PRINTF(1, 2);

/* The same for a faulty command line; refers to the help of `command`, "": of the program. */
int report_usage_error(const char *command, const char *format, ...) TOOLS_PRINTF(2, 3);

/* Keep the last of the following messages in `text` in place of printing them, cut to its size.
 * text NULL: print again. */
void message_keep(char *text, size_t size);

/* Replace control characters by blanks: text from files cannot move the cursor. */
void clean_text(char *text);

/* Print text at `column`, where the cursor is, and break it at blanks before column 80. */
void print_wrapped(size_t column, const char *text);

/* Print two blanks and `text`, and fill up to `column`, on the next line if `text` is too long. */
void print_column(size_t column, const char *text);

#endif
