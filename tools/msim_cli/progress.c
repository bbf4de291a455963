#define _POSIX_C_SOURCE 200809L /* isatty */
#include "progress.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "../common/clock.h"

/* Columns; TEXT_COLUMNS are kept for the text beside the bar. */
enum { WIDEST = 250, TEXT_COLUMNS = 64, WIDEST_BAR = 40, NARROWEST_BAR = 8 };

/* The number of usable columns. The last one stays free: some terminals wrap when it is written. */
static int terminal_columns(void) {
  struct winsize size = {0};
  int columns = 0;
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0) columns = size.ws_col;
  const char *text = getenv("COLUMNS");
  if (columns <= 0 && text) columns = (int)strtol(text, NULL, 10);
  if (columns <= 0) columns = 80;
  return columns > WIDEST ? WIDEST - 1 : columns - 1;
}

/* Append a part if all of it fits in the line; the most important parts come first. */
static void append_part(char *line, int columns, const char *part) {
  size_t used = strlen(line), length = strlen(part);
  if (used + length <= (size_t)columns) memcpy(line + used, part, length + 1);
}

static void append_left(char *line, int columns, double left) {
  char part[64];
  long s = left < 1e9 ? (long)(left + 0.5) : 999999999L;
  if (s < 3600) snprintf(part, sizeof part, "  %ld:%02ld left", s / 60, s % 60);
  else snprintf(part, sizeof part, "  %ld:%02ld:%02ld left", s / 3600, s / 60 % 60, s % 60);
  append_part(line, columns, part);
}

static void append_speed(char *line, int columns, double speed) {
  char part[64];
  if (speed < 10) snprintf(part, sizeof part, "  %.2f steps/s", speed);
  else if (speed < 1e4) snprintf(part, sizeof part, "  %.0f steps/s", speed);
  else if (speed < 1e7) snprintf(part, sizeof part, "  %.0fk steps/s", speed / 1e3);
  else snprintf(part, sizeof part, "  %.0fM steps/s", speed / 1e6);
  append_part(line, columns, part);
}

/* "[####----] 50%" */
static void append_bar(char *line, int columns, double done) {
  int width = columns - TEXT_COLUMNS;
  if (width > WIDEST_BAR) width = WIDEST_BAR;
  char part[WIDEST_BAR + 24], *to = part;
  if (width >= NARROWEST_BAR) {
    *to++ = '[';
    for (int i = 0; i < width; i++) *to++ = i < (int)(done * width) ? '#' : '-';
    *to++ = ']';
  }
  snprintf(to, 16, "%4d%%", (int)(100 * done));
  append_part(line, columns, part);
}

static void compose_line(const progress *bar, char *line, int columns, double now, int64_t step,
                         double t, double t_end) {
  char part[80];
  int64_t made = step - bar->first, all = bar->end - bar->first;
  double elapsed = now - bar->started, speed = (double)made / elapsed;
  double done = all > 0 ? (double)made / (double)all : (t - bar->t_first) / (t_end - bar->t_first);
  append_bar(line, columns, done);
  if (done > 0) append_left(line, columns, elapsed * (1 - done) / done);
  int digits = snprintf(part, sizeof part, "%" PRId64, bar->end);
  if (all > 0) snprintf(part, sizeof part, "  step %*" PRId64 "/%" PRId64, digits, step, bar->end);
  else snprintf(part, sizeof part, "  step %" PRId64, step);
  append_part(line, columns, part);
  snprintf(part, sizeof part, "  t %#.4g/%.4g s", t, t_end);
  append_part(line, columns, part);
  append_speed(line, columns, speed);
}

/* A single call, so that the terminal never shows half a line */
static void print_line(progress *bar, const char *line, const char *ending) {
  int length = (int)strlen(line);
  int erase = bar->shown > length ? bar->shown - length : 0;
  fprintf(stderr, "\r%s%*s%s", line, erase, "", ending);
  bar->shown = length;
}

void progress_start(progress *bar, int quiet, int64_t first, int64_t end, double t_first) {
  double now = clock_seconds();
  *bar = (progress){.wanted = !quiet && end != first && isatty(STDERR_FILENO),
                    .first = first,
                    .end = end,
                    .t_first = t_first,
                    .started = now,
                    .drawn = now};
}

void progress_update(progress *bar, double now, int64_t step, double t, double t_end) {
  char line[WIDEST] = "";
  if (!bar->wanted || now - bar->started < 0.5 || now - bar->drawn < 0.1) return;
  bar->drawn = now;
  compose_line(bar, line, terminal_columns(), now, step, t, t_end);
  print_line(bar, line, "");
}

void progress_hide(progress *bar) {
  if (bar->shown) print_line(bar, "", "\r");
}
