#include "message.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { MESSAGE_SIZE = 4096, LINE_WIDTH = 80 };

void clean_text(char *text) {
  for (; *text; text++) {
    unsigned char c = (unsigned char)*text;
    if (c < ' ' || c == 127) *text = ' ';
  }
}

static char *kept; /* NULL: messages are printed */
static size_t kept_size;

void message_keep(char *text, size_t size) { kept = text, kept_size = size; }

/* A single call of fprintf, so that lines of several programs do not mix */
static void report_error_va(const char *ending, const char *command, const char *format,
                            va_list args) {
  char text[MESSAGE_SIZE];
  vsnprintf(text, sizeof text, format, args);
  clean_text(text);
  if (kept) snprintf(kept, kept_size, "%s", text);
  else if (*ending)
    fprintf(stderr, "%s: %s; see '%s %s%s'\n", program_name, text, program_name, command, ending);
  else fprintf(stderr, "%s: %s\n", program_name, text);
}

int report_error(const char *format, ...) {
  va_list args;
  va_start(args, format);
  report_error_va("", "", format, args);
  va_end(args);
  return EXIT_ERROR;
}

int report_usage_error(const char *command, const char *format, ...) {
  va_list args;
  va_start(args, format);
  report_error_va(*command ? " --help" : "--help", command, format, args);
  va_end(args);
  return EXIT_ERROR;
}

static void print_blanks(size_t from, size_t to) { printf("%*s", (int)(to - from), ""); }

void print_wrapped(size_t column, const char *text) {
  size_t at = column;
  while (*text) {
    size_t word = strcspn(text, " ");
    if (at > column && at + 1 + word > LINE_WIDTH) {
      putchar('\n');
      print_blanks(0, column);
      at = column;
    } else if (at > column) {
      putchar(' ');
      at++;
    }
    printf("%.*s", (int)word, text);
    at += word;
    text += word + strspn(text + word, " ");
  }
  putchar('\n');
}

void print_column(size_t column, const char *text) {
  size_t at = strlen(text) + 2;
  printf("  %s", text);
  if (at >= column) {
    putchar('\n');
    at = 0;
  }
  print_blanks(at, column);
}
