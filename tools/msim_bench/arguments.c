#include "arguments.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/files.h"
#include "../common/message.h"
#include "../common/mpirun.h"

/*------------------------------------- flags ----------------------------------------------------*/

enum { QUICK, JSON, SCENE, THREADS, RANKS, HELP, VERSION, NFLAGS };

static const bench_flag flags[NFLAGS] = {
    [QUICK] = {"quick", NULL, "finish within a minute, with fewer scenes and fewer runs"},
    [JSON] = {"json", "FILE", "write all rows and the summary as JSON, for tools/plot_bench too"},
    [SCENE] = {"scene", "NAME,...", "run these scenes only"},
    [THREADS] = {"threads", "N",
                 "number of threads of msim; reference programs keep their defaults"},
    [RANKS] = {"ranks", "N,...", "numbers of ranks of the bench `distributed` (1,2,4)"},
    [HELP] = {"help", NULL, "show this text"},
    [VERSION] = {"version", NULL, "show the version"},
};

const bench_flag *flag_info(int i) { return i >= 0 && i < NFLAGS ? &flags[i] : NULL; }

/* Output goes to a temporary file that is then renamed, which would replace a device or a pipe. */
static int take_json(arguments *args, const char *value) {
  const char *kind = special_file_kind(value);
  if (!*value) return report_usage_error("", "--json needs the name of a file; give --json FILE");
  if (kind) return report_usage_error("", "--json '%s' is %s, not a file", value, kind);
  args->json = value;
  return EXIT_OK;
}

static int take_threads(arguments *args, const char *value) {
  msim_options options;
  msim_error err;
  msim_options_init(&options, sizeof options);
  if (msim_options_set(&options, "threads", value, &err) != MSIM_OK)
    return report_usage_error("", "--threads: %s", err.text);
  args->options.threads = options.threads;
  return EXIT_OK;
}

/* Appends a name to a list, behind a separator unless it is the first. */
static void append_name(char *list, size_t size, const char *separator, const char *name) {
  const size_t used = strlen(list);
  snprintf(list + used, size - used, "%s%s", used ? separator : "", name);
}

/* value: names separated by commas; check_scenes() knows which the bench has */
static int take_scene(arguments *args, const char *value) {
  bench_options *w = &args->options;
  for (const char *name = value, *end; name; name = *end ? end + 1 : NULL) {
    end = name + strcspn(name, ",");
    if (w->nscenes == MAX_SCENES)
      return report_usage_error("", "--scene takes at most %d scenes", MAX_SCENES);
    snprintf(w->scenes[w->nscenes++], MAX_SCENE_NAME, "%.*s", (int)(end - name), name);
  }
  return EXIT_OK;
}

/* value: numbers separated by commas */
static int take_ranks(arguments *args, const char *value) {
  enum { MOST = 64 };
  bench_options *w = &args->options;
  char *end = NULL;
  for (const char *at = value; at; at = *end ? end + 1 : NULL) {
    const long n = strtol(at, &end, 10);
    if (end == at || (*end && *end != ',') || n < 1 || n > MOST || w->nranks == MAX_RANK_COUNTS)
      return report_usage_error("", "--ranks '%s' is no list of up to %d numbers from 1 to %d",
                                value, MAX_RANK_COUNTS, MOST);
    w->ranks[w->nranks++] = (int32_t)n;
  }
  return EXIT_OK;
}

static int take_flag(arguments *args, int flag, const char *value) {
  switch (flag) {
    case JSON:
      return take_json(args, value);
    case SCENE:
      return take_scene(args, value);
    case THREADS:
      return take_threads(args, value);
    case RANKS:
      return take_ranks(args, value);
    case QUICK:
      args->options.quick = 1;
      break;
    case HELP:
      args->help = 1;
      break;
    default:
      args->version = 1;
  }
  return EXIT_OK;
}

/*------------------------------------- parsing --------------------------------------------------*/

static int parse_bench_name(arguments *args, const char *name) {
  const bench_entry *bench;
  if (args->bench)
    return report_usage_error("", "only one bench can run at a time; '%s' and '%s' were given",
                              args->bench->name, name);
  for (int i = 0; (bench = bench_info(i)) != NULL; i++)
    if (strcmp(bench->name, name) == 0) args->bench = bench;
  return args->bench ? EXIT_OK : report_usage_error("", "unknown bench '%s'", name);
}

/* Parses "--NAME", "--NAME VALUE" or "--NAME=VALUE" at argv[*i]; moves *i to the last word used. */
static int parse_flag(arguments *args, int argc, char **argv, int *i) {
  const char *given = argv[*i] + 2, *value = strchr(given, '=');
  const size_t length = strcspn(given, "=");
  for (int k = 0; k < NFLAGS; k++) {
    const bench_flag *flag = &flags[k];
    if (strlen(flag->name) != length || memcmp(flag->name, given, length) != 0) continue;
    if (!flag->value && value) return report_usage_error("", "--%s takes no value", flag->name);
    if (value || !flag->value) return take_flag(args, k, value ? value + 1 : NULL);
    if (++*i == argc) return report_usage_error("", "--%s needs a value", flag->name);
    return take_flag(args, k, argv[*i]);
  }
  return report_usage_error("", "unknown option '--%.*s'", (int)length, given);
}

/*------------------------------------- what fits together ---------------------------------------*/

static int has_name(const char *list, const char *name) {
  const size_t length = strlen(name);
  for (const char *at = list; *at; at += strcspn(at, ","), at += strspn(at, ", "))
    if (strncmp(at, name, length) == 0 && (!at[length] || at[length] == ',')) return 1;
  return 0;
}

static int check_scenes(const bench_entry *bench, const bench_options *w) {
  char known[MAX_SCENE_LIST];
  list_scenes(bench, known);
  if (w->nscenes && !*known)
    return report_usage_error("", "the bench '%s' has its own scenes; omit --scene", bench->name);
  for (int i = 0; i < w->nscenes; i++)
    if (!has_name(known, w->scenes[i]))
      return report_usage_error("", "scene '%s' is not part of the bench '%s', which has: %s",
                                w->scenes[i], bench->name, known);
  return EXIT_OK;
}

static int check_bench(const bench_entry *bench, const bench_options *w) {
  if (w->threads && bench->threads)
    return report_usage_error("", "the bench '%s' runs with %s; omit --threads", bench->name,
                              bench->threads);
  if (w->nranks && !bench->has_ranks)
    return report_usage_error("", "the bench '%s' has no ranks; omit --ranks", bench->name);
  if (w->nranks && mpirun_may_be_several())
    return report_usage_error("", "the processes of mpirun are the ranks; omit --ranks");
  return check_scenes(bench, w);
}

static int complain_no_bench(void) {
  char known[128] = "";
  for (int i = 0; bench_info(i); i++)
    append_name(known, sizeof known, bench_info(i + 1) ? ", " : " or ", bench_info(i)->name);
  return report_usage_error("", "the name of a bench is missing: %s", known);
}

int arguments_parse(int argc, char **argv, arguments *args) {
  *args = (arguments){.bench = NULL};
  int status = EXIT_OK;
  for (int i = 1; i < argc && !status; i++) {
    if (strncmp(argv[i], "--", 2) == 0 && argv[i][2]) status = parse_flag(args, argc, argv, &i);
    else if (argv[i][0] == '-') status = report_usage_error("", "unknown option '%s'", argv[i]);
    else status = parse_bench_name(args, argv[i]);
    if (args->help || args->version) return EXIT_OK;
  }
  if (status) return status;
  return args->bench ? check_bench(args->bench, &args->options) : complain_no_bench();
}
