#define _POSIX_C_SOURCE 200809L /* fileno, lseek */
#include "plot.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../common/message.h"

extern char **environ;

enum { MOST_NAMES = 64 };

#define BAR_WIDTH 0.8 /* of all bars at one place, over the distance of places */

/* Names in the order of their first appearance. */
typedef struct names {
  int count;
  const char *all[MOST_NAMES];
} names;

/* Adds the name if it is new; -1: there is no room. */
static int name_index(names *n, const char *name) {
  for (int i = 0; i < n->count; i++)
    if (strcmp(n->all[i], name) == 0) return i;
  if (n->count == MOST_NAMES) return -1;
  n->all[n->count] = name;
  return n->count++;
}

/*------------------------------------- gnuplot --------------------------------------------------*/

/* Runs gnuplot on these files, without a shell or the user's settings. Returns its exit status; -1:
 * it could not be run, see errno. */
static int run_gnuplot(char *argument, int from, int to) {
  char name[] = "gnuplot", settings[] = "-d", *argv[] = {name, settings, argument, NULL};
  posix_spawn_file_actions_t actions;
  pid_t pid;
  int status;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, from, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, to, STDOUT_FILENO);
  errno = posix_spawnp(&pid, name, &actions, NULL, argv, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (errno) return -1;
  while (waitpid(pid, &status, 0) < 0)
    if (errno != EINTR) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

int gnuplot_is_available(void) {
  char version[] = "--version";
  const int null = open("/dev/null", O_RDWR | O_CLOEXEC);
  const int status = null < 0 ? -1 : run_gnuplot(version, null, null);
  if (null >= 0) close(null);
  if (status == 0) return 1;
  report_error(
      "--svg needs gnuplot, which was not found; install gnuplot-nox (Debian, Ubuntu) or use "
      "--json");
  return 0;
}

/*------------------------------------- the script -----------------------------------------------*/

/* A string in gnuplot's syntax, in which '' stands for '. */
static void print_quoted(FILE *out, const char *text) {
  putc('\'', out);
  for (; *text; text++) {
    if (*text == '\'') putc('\'', out);
    putc((unsigned char)*text < ' ' ? ' ' : *text, out);
  }
  putc('\'', out);
}

/*------------------------------------- points ---------------------------------------------------*/

/* A row as a point or a bar: its coordinates, the numbers of its names, and that of its place. */
typedef struct plot_point {
  int series, place;
  const char *name;
  double x, y;
} plot_point;

typedef struct points {
  names series, places;
  int count;
  plot_point *all;
} points;

static int is_plotted(const plot *p, const json_t *row) {
  int found = 0;
  for (int i = 0; i < MOST_MEASURES && p->measures[i]; i++)
    found |= strcmp(row_text(row, "measure"), p->measures[i]) == 0;
  if (p->condition && !json_is_true(json_object_get(row, p->condition))) return 0;
  return found && (!p->main_step ||
                   (row_number(row, "k") == 1000 && fabs(row_number(row, "h") * 60 - 1) < 1e-6));
}

/* An outcome is its index, where a larger one is worse. */
static double coordinate(const json_t *row, const char *key) {
  static const char *const words[] = {"stable", "bounded", "dissipated", "reported",
                                      "silent", "crash",   "hang"};
  for (int i = 0; i < 7; i++)
    if (strcmp(row_text(row, key), words[i]) == 0) return i;
  return row_number(row, key);
}

/* Whether two places belong to one curve, as cloth32 and cloth64 do. */
static int are_family(const char *a, const char *b) {
  const size_t n = strcspn(a, "0123456789");
  return n == strcspn(b, "0123456789") && memcmp(a, b, n) == 0;
}

/* Order by family, then by x. */
static int compare_points(const void *a, const void *b) {
  const plot_point *p = a, *q = b;
  if (are_family(p->name, q->name)) return (p->x > q->x) - (p->x < q->x);
  return strcmp(p->name, q->name);
}

static int collect_points(const plot *p, const report *r, points *s) {
  size_t i;
  json_t *row;
  *s = (points){.all = calloc(json_array_size(r->rows) + 1, sizeof *s->all)};
  json_array_foreach(r->rows, i, row) {
    if (!s->all || !is_plotted(p, row)) continue;
    plot_point here = {.x = p->x ? coordinate(row, p->x) : 0,
                       .y = coordinate(row, p->y) * (p->y_scale > 0 ? p->y_scale : 1)};
    if (!isfinite(here.x) || !isfinite(here.y)) continue;
    here.series = name_index(&s->series, row_text(row, p->series));
    here.name = p->place ? row_text(row, p->place) : "";
    here.place = name_index(&s->places, here.name);
    if (here.series >= 0 && here.place >= 0) s->all[s->count++] = here;
  }
  if (s->all) qsort(s->all, (size_t)s->count, sizeof *s->all, compare_points);
  return s->all != NULL;
}

/*------------------------------------- curves and bars ------------------------------------------*/

/* Shifts each bar from its place. */
static void print_bars(FILE *out, const points *s, int series) {
  const double offset = BAR_WIDTH * ((series + 0.5) / s->series.count - 0.5);
  for (const plot_point *q = s->all; q < s->all + s->count; q++)
    if (q->series == series) fprintf(out, "%.9g %.9g\n", q->place + offset, q->y);
}

/* A data line for each point at a place (-1: all): x, y, place; an empty line between families. */
static void print_curve(FILE *out, const points *s, int series, int place) {
  const char *before = NULL;
  for (const plot_point *q = s->all; q < s->all + s->count; q++) {
    if (q->series != series || (place >= 0 && q->place != place)) continue;
    if (before && !are_family(before, q->name)) putc('\n', out);
    fprintf(out, "%.9g %.9g \"%s\"\n", q->x, q->y, q->name);
    before = q->name;
  }
}

/* gnuplot defines eight colours. */
static const char more_colours[] =
    "set linetype 9 lc '#808080'\nset linetype 10 lc '#a0522d'\nset linetype 11 lc '#ff69b4'\n"
    "set linetype 12 lc '#556b2f'\n";

/* Names at x = first, first + distance, ... */
static void print_tics(FILE *out, const char *set, const names *n, int first, int distance) {
  fprintf(out, "set %s (", set);
  for (int i = 0; i < n->count; i++) {
    fputs(i ? ", " : "", out);
    print_quoted(out, n->all[i]);
    fprintf(out, " %d", first + i * distance);
  }
  fputs(")\n", out);
}

static void print_axes(FILE *out, const plot *p, const points *s) {
  enum { WIDTH = 1000, HEIGHT = 600 };
  const int panels = p->style == PANELS && s->places.count > 1 ? s->places.count : 1;
  fprintf(out, "set terminal svg size %d,%d noenhanced background '#ffffff'\n%s", WIDTH,
          HEIGHT * panels, more_colours);
  fprintf(out, "set ylabel '%s'\nset logscale y\nset grid ytics\nset key outside right top\n",
          p->y_label ? p->y_label : "");
  if (p->style != BARS) {
    fprintf(out, "set xlabel '%s'\nset logscale x\nset format x '%s'\n", p->x_label,
            p->x_format ? p->x_format : "%.0s%c");
    return;
  }
  print_tics(out, "style fill solid\nset xtics rotate by -30", &s->places, 0, 1);
  fprintf(out, "set xrange [-0.6:%d - 0.4]\n", s->places.count);
}

/* Plots the series that have points at a place (-1: all). Places are labelled at the first curve
 * only, as x is the same in all; a panel has one place. */
static void print_plot(FILE *out, const plot *p, const points *s, const char *title, int place) {
  int used[MOST_NAMES] = {0}, count = 0;
  for (const plot_point *q = s->all; q < s->all + s->count; q++)
    if (place < 0 || q->place == place) used[q->series] = 1;
  for (int i = 0; i < s->series.count; i++) {
    if (!used[i]) continue;
    fprintf(out, "$data%d << END\n", i);
    if (p->style == BARS) print_bars(out, s, i);
    else print_curve(out, s, i, place);
    fputs("END\n", out);
  }
  fputs("set title ", out);
  print_quoted(out, title);
  fprintf(out, "\nset boxwidth %g\n%s", BAR_WIDTH / (s->series.count ? s->series.count : 1),
          s->count ? "plot " : "set yrange [1:10]\nplot 1 notitle");
  for (int i = 0; i < s->series.count; i++) {
    if (!used[i]) continue;
    fprintf(out, "%s$data%d using 1:2 with %s linetype %d title ", count++ ? ", " : "", i,
            p->style == BARS ? "boxes" : "linespoints linewidth 2", 1 + i);
    print_quoted(out, s->series.all[i]);
    if (p->style == CURVES && count == 1)
      fprintf(out, ", $data%d using 1:2:3 with labels offset 0,1 notitle", i);
  }
  putc('\n', out);
}

/*------------------------------------- heat maps ------------------------------------------------*/

/* A row for each series, a column for each place and decade of x from the smallest on. */
static void print_heat(FILE *out, const points *s) {
  enum { DECADES = 8 };
  double least = INFINITY;
  for (int i = 0; i < s->count; i++) least = fmin(least, s->all[i].x);
  fputs(
      "unset logscale\nset format x\nunset grid\nset key off\nset ylabel ''\n"
      "set palette maxcolors 7 defined (0 '#1a9850', 1 '#a6d96a', 2 '#d9ef8b', 3 '#fdae61', "
      "4 '#d73027', 5 '#7f0000', 6 '#000000')\nset cbrange [-0.5:6.5]\n"
      "set cbtics ('stable' 0, 'bounded' 1, 'dissipated' 2, 'reported' 3, 'silent' 4, 'crash' 5, "
      "'hang' 6)\n",
      out);
  print_tics(out, "xtics rotate by -40", &s->places, DECADES / 2 - 1, DECADES);
  print_tics(out, "ytics", &s->series, 0, 1);
  fprintf(out, "set xrange [-1:%d]\nset yrange [-0.6:%d - 0.4] reverse\n$cells << END\n",
          s->places.count * DECADES, s->series.count);
  for (const plot_point *q = s->all; q < s->all + s->count; q++)
    fprintf(out, "%g %d %g\n", q->place * DECADES + round(log10(q->x / least)), q->series, q->y);
  fputs(
      "END\nplot $cells using 1:2:(0.5):(0.5):3 with boxxyerror fillcolor palette "
      "fillstyle solid noborder notitle\n",
      out);
}

/*------------------------------------- all of it ------------------------------------------------*/

static int print_script(FILE *out, const plot *p, const report *r) {
  const char *cpu = row_text(r->machine, "cpu");
  const int panels = p->style == PANELS;
  char title[256];
  points s;
  snprintf(title, sizeof title, "%s%s%s", p->title, *cpu ? "; " : "", cpu);
  if (!collect_points(p, r, &s)) return 0;
  print_axes(out, p, &s);
  if (panels && s.count) fprintf(out, "set multiplot layout %d,1\n", s.places.count);
  for (int i = 0; panels && i < s.places.count; i++) print_plot(out, p, &s, s.places.all[i], i);
  if (p->style == HEAT) {
    fputs("set title ", out);
    print_quoted(out, title);
    putc('\n', out);
    print_heat(out, &s);
  } else if (!panels || !s.count) {
    print_plot(out, p, &s, title, -1);
  }
  free(s.all);
  return fflush(out) == 0;
}

int plot_write(const plot *p, const report *r, output_file *file) {
  char standard_input[] = "-";
  FILE *script = tmpfile();
  int status = -1;
  if (script) {
    if (print_script(script, p, r) && lseek(fileno(script), 0, SEEK_SET) == 0)
      status = run_gnuplot(standard_input, fileno(script), fileno(file->stream));
    fclose(script);
  }
  if (status > 0) return report_error("gnuplot failed with exit status %d", status);
  return output_close(file, status == 0);
}
