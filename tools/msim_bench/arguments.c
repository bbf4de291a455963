#include "arguments.h"

#include <stdio.h>
#include <string.h>

#include "../common/files.h"
#include "../common/message.h"

/*------------------------------------- flags ----------------------------------------------------*/

static int take_quick(arguments *args, const char *value) {
  (void)value;
  args->options.quick = 1;
  return EXIT_OK;
}

static int take_help(arguments *args, const char *value) {
  (void)value;
  args->help = 1;
  return EXIT_OK;
}

static int take_version(arguments *args, const char *value) {
  (void)value;
  args->version = 1;
  return EXIT_OK;
}

/* Output goes to a temporary file that is then renamed, which would replace a device or a pipe. */
static int take_file(const char *flag, const char *value, const char **path) {
  const char *kind = special_file_kind(value);
  if (!*value) return report_usage_error("", "--%s needs the name of a file", flag);
  if (kind) return report_usage_error("", "--%s '%s' is %s, not a file", flag, value, kind);
  *path = value;
  return EXIT_OK;
}

static int take_json(arguments *args, const char *value) {
  return take_file("json", value, &args->json);
}

static int take_csv(arguments *args, const char *value) {
  return take_file("csv", value, &args->csv);
}

static int take_svg(arguments *args, const char *value) {
  return take_file("svg", value, &args->svg);
}

static int take_threads(arguments *args, const char *value) {
  msim_options options;
  msim_error err;
  msim_options_init(&options, sizeof options);
  if (msim_options_set(&options, "threads", value, &err) != MSIM_OK)
    return report_usage_error("", "on the command line, %s", err.text);
  args->options.threads = options.threads;
  return EXIT_OK;
}

static int complain_scene(const char *name, size_t length) {
  char known[256] = "";
  const bench_scene *scene;
  for (int i = 0; (scene = scene_info(i)) != NULL; i++) {
    const size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s%s", i ? ", " : "", scene->name);
  }
  return report_usage_error("", "there is no scene '%.*s', only %s", (int)length, name, known);
}

/* value: scene names separated by commas */
static int take_scene(arguments *args, const char *value) {
  bench_options *w = &args->options;
  for (const char *name = value, *end; name; name = *end ? end + 1 : NULL) {
    end = name + strcspn(name, ",");
    const bench_scene *scene = scene_find(name, (size_t)(end - name));
    if (!scene) return complain_scene(name, (size_t)(end - name));
    if (w->nscenes == MAX_SCENES)
      return report_usage_error("", "--scene takes %d scenes at most", MAX_SCENES);
    w->scenes[w->nscenes++] = scene;
  }
  return EXIT_OK;
}

static const bench_flag flags[] = {
    {"quick", NULL, "end within a minute: fewer scenes, fewer runs", take_quick},
    {"json", "FILE", "write all rows and the summary too", take_json},
    {"csv", "FILE", "write all rows as a table", take_csv},
    {"scene", "NAME,...", "these scenes only", take_scene},
    {"threads", "N", "threads of msim itself; the libraries out of the box keep their own",
     take_threads},
    {"svg", "FILE", "draw a picture of it, by gnuplot", take_svg},
    {"help", NULL, "show this text", take_help},
    {"version", NULL, "show the version", take_version},
};
enum { NFLAGS = sizeof flags / sizeof *flags };

const bench_flag *flag_info(int i) { return i >= 0 && i < NFLAGS ? &flags[i] : NULL; }

/*------------------------------------- parsing --------------------------------------------------*/

static int parse_bench_name(arguments *args, const char *name) {
  const bench_entry *bench;
  if (args->bench)
    return report_usage_error("", "one bench at a time, but '%s' and '%s' are given",
                              args->bench->name, name);
  for (int i = 0; (bench = bench_info(i)) != NULL; i++) {
    if (strcmp(bench->name, name) != 0) continue;
    args->bench = bench;
    return EXIT_OK;
  }
  return report_usage_error("", "there is no bench '%s'", name);
}

/* Parses "--NAME", "--NAME VALUE" or "--NAME=VALUE" at argv[*i]; moves *i to the last word used. */
static int parse_flag(arguments *args, int argc, char **argv, int *i) {
  const char *given = argv[*i] + 2, *value = strchr(given, '=');
  const size_t length = strcspn(given, "=");
  for (const bench_flag *flag = flags; flag < flags + NFLAGS; flag++) {
    if (strlen(flag->name) != length || memcmp(flag->name, given, length) != 0) continue;
    if (!flag->value && value) return report_usage_error("", "--%s takes no value", flag->name);
    if (!flag->value) return flag->store(args, NULL);
    if (value) return flag->store(args, value + 1);
    if (++*i == argc) return report_usage_error("", "--%s needs a value", flag->name);
    return flag->store(args, argv[*i]);
  }
  return report_usage_error("", "there is no option '--%.*s'", (int)length, given);
}

static int check_output_files(const arguments *args) {
  const struct {
    const char *name, *path;
  } files[] = {{"json", args->json}, {"csv", args->csv}, {"svg", args->svg}};
  for (int i = 0; i < 3; i++)
    for (int j = i + 1; j < 3; j++)
      if (same_file(files[i].path, files[j].path))
        return report_usage_error("", "--%s and --%s name the same file", files[i].name,
                                  files[j].name);
  return EXIT_OK;
}

int arguments_parse(int argc, char **argv, arguments *args) {
  *args = (arguments){.bench = NULL};
  int status = EXIT_OK;
  for (int i = 1; i < argc && !status; i++) {
    if (strncmp(argv[i], "--", 2) == 0 && argv[i][2]) status = parse_flag(args, argc, argv, &i);
    else if (argv[i][0] == '-') status = report_usage_error("", "there is no option '%s'", argv[i]);
    else status = parse_bench_name(args, argv[i]);
    if (args->help || args->version) return EXIT_OK;
  }
  if (!status) status = check_output_files(args);
  if (status || args->bench) return status;
  return report_usage_error(
      "",
      "the name of a bench is missing: linear, forces, scaling, skip, step or "
      "precision");
}
