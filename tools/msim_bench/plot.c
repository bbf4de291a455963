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

#define BARS 0.8 /* total width at one place, over the distance of places */

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
      "--svg needs the program gnuplot, which cannot be run here (Debian's and Ubuntu's package "
      "is gnuplot-nox); --json writes the numbers");
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

/* Whether two places belong to one curve, as cloth32 and cloth64 do. */
static int are_family(const char *a, const char *b) {
  const size_t n = strcspn(a, "0123456789");
  return n == strcspn(b, "0123456789") && memcmp(a, b, n) == 0;
}

static int is_point(const plot *p, const json_t *row, plot_point *point) {
  return p->point(row, point) && isfinite(point->y) && (p->bars || isfinite(point->x));
}

static void collect_names(const plot *p, const report *r, names *series, names *places) {
  plot_point point;
  size_t i;
  json_t *row;
  json_array_foreach(r->rows, i, row) {
    if (!is_point(p, row, &point)) continue;
    name_index(series, point.series);
    name_index(places, point.place);
  }
}

/* Order by family, then by x. */
static int compare_points(const void *a, const void *b) {
  const plot_point *p = a, *q = b;
  if (are_family(p->place, q->place)) return (p->x > q->x) - (p->x < q->x);
  return strcmp(p->place, q->place);
}

/* A data line for each point: x, y, place; an empty line between families. */
static void print_curve(FILE *out, plot_point *points, int n) {
  qsort(points, (size_t)n, sizeof *points, compare_points);
  for (int i = 0; i < n; i++) {
    if (i > 0 && !are_family(points[i - 1].place, points[i].place)) putc('\n', out);
    fprintf(out, "%.9g %.9g \"%s\"\n", points[i].x, points[i].y, points[i].place);
  }
}

/* A data line for each bar, shifted by `offset` from its place. */
static void print_bars(FILE *out, const plot_point *points, int n, double offset, names *places) {
  for (int i = 0; i < n; i++)
    fprintf(out, "%.9g %.9g\n", name_index(places, points[i].place) + offset, points[i].y);
}

/* One series as a data block. points: scratch for all rows; place NULL: all. */
static void print_data(FILE *out, const plot *p, const report *r, int number, names *series,
                       names *places, const char *place, plot_point *points) {
  size_t i;
  json_t *row;
  int n = 0;
  json_array_foreach(r->rows, i, row) {
    if (is_point(p, row, &points[n]) && (!place || strcmp(points[n].place, place) == 0) &&
        name_index(series, points[n].series) == number)
      n++;
  }
  fprintf(out, "$data%d << END\n", number);
  if (p->bars) print_bars(out, points, n, BARS * ((number + 0.5) / series->count - 0.5), places);
  else print_curve(out, points, n);
  fputs("END\n", out);
}

/* gnuplot defines eight colours. */
static const char more_colours[] =
    "set linetype 9 lc '#808080'\nset linetype 10 lc '#a0522d'\nset linetype 11 lc '#ff69b4'\n"
    "set linetype 12 lc '#556b2f'\n";

static void print_title(FILE *out, const plot *p, const report *r) {
  const char *cpu = json_string_value(json_object_get(r->machine, "cpu"));
  char title[256];
  snprintf(title, sizeof title, "%s%s%s", p->title, cpu ? "; " : "", cpu ? cpu : "");
  fputs("set title ", out);
  print_quoted(out, title);
  putc('\n', out);
}

enum { WIDTH = 1000, HEIGHT = 600 };

static void print_axes(FILE *out, const plot *p, const names *places) {
  const int panels = p->panels && places->count > 1 ? places->count : 1;
  fprintf(out, "set terminal svg size %d,%d noenhanced background '#ffffff'\n", WIDTH,
          HEIGHT * panels);
  fprintf(out, "%s", more_colours);
  fprintf(out, "set ylabel '%s'\nset logscale y\nset grid ytics\nset key outside right top\n",
          p->y_label ? p->y_label : "");
  if (!p->bars) {
    fprintf(out, "set xlabel '%s'\nset logscale x\nset format x '%s'\n", p->x_label,
            p->x_format ? p->x_format : "%.0s%c");
    return;
  }
  fputs("set style fill solid\nset xtics rotate by -30 (", out);
  for (int i = 0; i < places->count; i++) {
    fputs(i ? ", " : "", out);
    print_quoted(out, places->all[i]);
    fprintf(out, " %d", i);
  }
  fprintf(out, ")\nset xrange [-0.6:%d - 0.4]\n", places->count);
}

/* Labels places at the first curve only, as x is the same in all; a panel has one place. all:
 * determines the colours. */
static void print_plot(FILE *out, const plot *p, const names *series, names *all) {
  fputs(series->count ? "plot " : "set yrange [1:10]\nplot 1 notitle", out);
  for (int i = 0; i < series->count; i++) {
    fprintf(out, "%s$data%d using 1:2 with %s linetype %d title ", i ? ", " : "", i,
            p->bars ? "boxes" : "linespoints linewidth 2", 1 + name_index(all, series->all[i]));
    print_quoted(out, series->all[i]);
    if (!p->bars && !p->panels && i == 0)
      fputs(", $data0 using 1:2:3 with labels offset 0,1 notitle", out);
  }
  putc('\n', out);
}

/* Prints one place, with the series that have points there. */
static void print_panel(FILE *out, const plot *p, const report *r, names *all, names *places,
                        const char *place, plot_point *points) {
  names series = {.count = 0};
  plot_point point;
  size_t i;
  json_t *row;
  json_array_foreach(r->rows, i, row) {
    if (is_point(p, row, &point) && strcmp(point.place, place) == 0)
      name_index(&series, point.series);
  }
  for (int s = 0; s < series.count; s++) print_data(out, p, r, s, &series, places, place, points);
  fputs("set title ", out);
  print_quoted(out, place);
  putc('\n', out);
  print_plot(out, p, &series, all);
}

static void print_panels(FILE *out, const plot *p, const report *r, names *all, names *places,
                         plot_point *points) {
  fprintf(out, "set multiplot layout %d,1\n", places->count);
  for (int i = 0; i < places->count; i++)
    print_panel(out, p, r, all, places, places->all[i], points);
  fputs("unset multiplot\n", out);
}

/* Decades of x from the smallest on, side by side within a place. */
enum { DECADES = 8 };

/* A heat map: a row for each series, a column for each place and decade of x. */
static void print_heat(FILE *out, const plot *p, const report *r, names *series, names *places) {
  plot_point point;
  size_t i;
  json_t *row;
  double least = INFINITY;
  json_array_foreach(r->rows, i, row) if (is_point(p, row, &point)) least = fmin(least, point.x);
  fputs(
      "unset logscale\nset format x\nunset grid\nset key off\nset ylabel ''\n"
      "set palette maxcolors 7 defined (0 '#1a9850', 1 '#a6d96a', 2 '#d9ef8b', 3 '#fdae61', "
      "4 '#d73027', 5 '#7f0000', 6 '#000000')\nset cbrange [-0.5:6.5]\n"
      "set cbtics ('stable' 0, 'bounded' 1, 'dissipated' 2, 'reported' 3, 'silent' 4, 'crash' 5, "
      "'hang' 6)\nset xtics rotate by -40 (",
      out);
  for (int k = 0; k < places->count; k++) {
    fputs(k ? ", " : "", out);
    print_quoted(out, places->all[k]);
    fprintf(out, " %d", k * DECADES + DECADES / 2 - 1);
  }
  fputs(")\nset ytics (", out);
  for (int k = 0; k < series->count; k++) {
    fputs(k ? ", " : "", out);
    print_quoted(out, series->all[k]);
    fprintf(out, " %d", k);
  }
  fprintf(out, ")\nset xrange [-1:%d]\nset yrange [-0.6:%d - 0.4] reverse\n$cells << END\n",
          places->count * DECADES, series->count);
  json_array_foreach(r->rows, i, row) {
    if (is_point(p, row, &point))
      fprintf(out, "%g %d %g\n",
              name_index(places, point.place) * DECADES + round(log10(point.x / least)),
              name_index(series, point.series), point.y);
  }
  fputs(
      "END\nplot $cells using 1:2:(0.5):(0.5):3 with boxxyerror fillcolor palette "
      "fillstyle solid noborder notitle\n",
      out);
}

static int print_script(FILE *out, const plot *p, const report *r) {
  plot_point *points = calloc(json_array_size(r->rows) + 1, sizeof *points);
  names series = {.count = 0}, places = {.count = 0};
  if (!points) return 0;
  collect_names(p, r, &series, &places);
  print_axes(out, p, &places);
  if (p->panels && places.count > 0) {
    print_panels(out, p, r, &series, &places, points);
  } else {
    print_title(out, p, r);
  }
  if (p->heat) {
    print_heat(out, p, r, &series, &places);
  } else if (!(p->panels && places.count > 0)) {
    for (int i = 0; i < series.count; i++) print_data(out, p, r, i, &series, &places, NULL, points);
    fprintf(out, "set boxwidth %g\n", BARS / (series.count ? series.count : 1));
    print_plot(out, p, &series, &series);
  }
  free(points);
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
  if (status > 0) return report_error("gnuplot failed with exit status %d on its script", status);
  return output_close(file, status == 0);
}
