#define _POSIX_C_SOURCE 200809L /* strndup */
#include "arguments.h"

#include <getopt.h>
#include <stdlib.h>
#include <string.h>

#include "../common/message.h"

/*------------------------------------- flags ----------------------------------------------------*/

#define FOR_RUN    (1u << COMMAND_RUN)
#define FOR_REST   (1u << COMMAND_REST)
#define FOR_MODES  (1u << COMMAND_MODES)
#define FOR_ALL    ((1u << NCOMMANDS) - 1)
#define AT(member) offsetof(arguments, member)

static const cli_flag flags[] = {
    {"out", "FILE",
     "write the motion: .html for a browser, .vtkhdf for ParaView, .pvd for ParaView before 5.12, "
     ".csv for spreadsheets and scripts, .EXT by the plugin msim_recorder_EXT.so",
     FOR_RUN, AT(out)},
    {"final", "FILE.json", "write the last state, its energies and statistics", FOR_RUN | FOR_REST,
     AT(final)},
    {"json", "FILE.json", "write the frequencies and shapes", FOR_MODES, AT(json)},
    {"count", "N", "how many of the lowest frequencies, as -n N (default 10)", FOR_MODES,
     AT(count)},
    {"ftol", "NEWTONS",
     "the largest force that may be left on a particle (default: 1e-9 of the weight and the other "
     "external forces, or, without any, of the largest force)",
     FOR_REST, AT(ftol)},
    {"energies", "FILE.csv", "write the energies of each frame, and the work supplied until then",
     FOR_RUN, AT(tables[TABLE_ENERGIES])},
    {"reactions", "FILE.csv", "write the force that supports each pinned particle in each frame",
     FOR_RUN, AT(tables[TABLE_REACTIONS])},
    {"springs", "FILE.csv", "write tension, elongation and strain of each spring in each frame",
     FOR_RUN, AT(tables[TABLE_SPRINGS])},
    {"init", "FINAL.json", "start from a state that --final wrote", FOR_RUN | FOR_REST | FOR_MODES,
     AT(init)},
    {"resume", NULL,
     "resume the run of the .vtkhdf file of --out after its last frame; start it if there is no "
     "such file",
     FOR_RUN, AT(resume)},
    {"force", NULL, "replace the files to be written even if msim did not write them",
     FOR_RUN | FOR_REST | FOR_MODES, AT(force)},
    {"stats", NULL, "print all counters and the seconds of each phase", FOR_RUN, AT(stats)},
    {"quiet", NULL, "print nothing but errors", FOR_RUN | FOR_REST | FOR_MODES, AT(quiet)},
    {"help", NULL, "show this text, as -h does", FOR_ALL, AT(help)},
};
enum { NFLAGS = sizeof flags / sizeof *flags };

const cli_flag *flag_info(int i) { return i >= 0 && i < NFLAGS ? &flags[i] : NULL; }

const char *command_name(command_id which) {
  static const char *const names[NCOMMANDS] = {"run", "rest", "modes", "explain", "list"};
  return names[which];
}

int command_has_option(command_id which, const msim_option_entry *option) {
  static const char *const statics[] = {"solver", "solver.options", "threads", "plugin_path"};
  if (which == COMMAND_LIST) return strcmp(option->name, "plugin_path") == 0;
  if (which != COMMAND_REST && which != COMMAND_MODES) return 1;
  for (size_t i = 0; i < sizeof statics / sizeof *statics; i++)
    if (strcmp(option->name, statics[i]) == 0) return 1;
  return 0;
}

/*------------------------------------- for getopt_long ------------------------------------------*/

/* Values of struct option: flag i is FIRST_FLAG + i, option i of the library FIRST_OPTION + i, both
 * above all characters, by which getopt_long reports unknown short options. */
enum { FIRST_FLAG = 1000, FIRST_OPTION = 2000 };

static int count_options(void) {
  int n = 0;
  while (msim_option_info(n)) n++;
  return n;
}

/* All flags of a command, to be freed by the caller; NULL: no memory. */
static struct option *long_options(command_id which) {
  struct option *all = calloc((size_t)(NFLAGS + count_options() + 1), sizeof *all);
  struct option *next = all;
  if (!all) return NULL;
  for (int i = 0; i < NFLAGS; i++) {
    if (!(flags[i].commands & 1u << which)) continue;
    int takes = flags[i].value ? required_argument : no_argument;
    *next++ = (struct option){flags[i].name, takes, NULL, FIRST_FLAG + i};
  }
  const msim_option_entry *entry;
  for (int i = 0; (entry = msim_option_info(i)) != NULL; i++)
    if (command_has_option(which, entry))
      *next++ = (struct option){entry->name, required_argument, NULL, FIRST_OPTION + i};
  return all;
}

/*------------------------------------- unknown options ------------------------------------------*/

/* The flag of the command that was probably meant by the first `length` characters; NULL: none */
static const char *nearest_flag(const struct option *all, const char *given, size_t length) {
  size_t n = 0;
  while (all[n].name) n++;
  const char **names = calloc(n + 1, sizeof *names);
  char *word = strndup(given, length);
  for (size_t i = 0; names && i < n; i++) names[i] = all[i].name;
  const char *meant = names && word ? msim_nearest_name(word, names) : NULL;
  free(names);
  free(word);
  return meant;
}

static int report_unknown_flag(const arguments *args, const struct option *all, const char *given) {
  const char *command = command_name(args->which);
  int length = (int)strcspn(given, "=");
  const char *meant = length > 2 ? nearest_flag(all, given + 2, (size_t)length - 2) : NULL;
  if (meant)
    return report_usage_error(command, "there is no option '%.*s' (did you mean '--%s'?)", length,
                              given, meant);
  return report_usage_error(command, "there is no option '%.*s'", length, given);
}

/*------------------------------------- parsing --------------------------------------------------*/

static int take_operand(arguments *args, const char *text) {
  const char *command = command_name(args->which);
  if (args->which == COMMAND_LIST)
    return report_usage_error(command, "list takes no file, but '%s' is given", text);
  if (args->scene)
    return report_usage_error(command, "%s takes one scene, but '%s' and '%s' are given", command,
                              args->scene, text);
  args->scene = text;
  return EXIT_OK;
}

static int take_flag(arguments *args, const cli_flag *flag, const char *value) {
  void *member = (char *)args + flag->member;
  if (!flag->value) {
    *(int *)member = 1;
    return EXIT_OK;
  }
  if (!*value)
    return report_usage_error(command_name(args->which), "--%s needs a value", flag->name);
  *(const char **)member = value;
  return EXIT_OK;
}

static int take_option(arguments *args, const char *name, const char *value) {
  msim_error err;
  if (msim_options_set(&args->options, name, value, &err) != MSIM_OK)
    return report_usage_error(command_name(args->which), "on the command line, %s", err.text);
  args->settings[args->nsettings++] = (setting){name, value};
  return EXIT_OK;
}

/* Report an error of getopt_long; which: '?' or ':', optopt: the flag. */
static int report_getopt_error(const arguments *args, const struct option *all, int which,
                               const char *given) {
  const char *command = command_name(args->which);
  if (which == ':') return report_usage_error(command, "%s needs a value", given);
  if (optopt >= FIRST_FLAG)
    return report_usage_error(command, "%.*s takes no value", (int)strcspn(given, "="), given);
  if (optopt) return report_usage_error(command, "there is no option '-%c'", optopt);
  return report_unknown_flag(args, all, given);
}

/* Take a flag that getopt_long returned. Abbreviations, which it accepts, are errors: a new option
 * must not change what an old script means. */
static int take_long_option(arguments *args, const struct option *all, int value,
                            const char *given) {
  const msim_option_entry *option = msim_option_info(value - FIRST_OPTION);
  const char *name = option ? option->name : flags[value - FIRST_FLAG].name;
  if (strcspn(given, "=") != strlen(name) + 2) return report_unknown_flag(args, all, given);
  if (option) return take_option(args, name, optarg);
  return take_flag(args, &flags[value - FIRST_FLAG], optarg);
}

/* "-:": getopt_long returns operands in their order with the value 1, and different values for a
 * missing value and for an unknown flag. */
static int parse_all(arguments *args, int argc, char **argv, const struct option *all) {
  int value, status = EXIT_OK;
  opterr = 0;
  const char *letters = args->which == COMMAND_MODES ? "-:hn:" : "-:h";
  while (!status && (value = getopt_long(argc, argv, letters, all, NULL)) != -1) {
    const char *given = argv[optind - 1];
    if (value == 1) status = take_operand(args, optarg);
    else if (value == 'h') args->help = 1;
    else if (value == 'n') args->count = optarg;
    else if (value == '?' || value == ':') status = report_getopt_error(args, all, value, given);
    else status = take_long_option(args, all, value, optarg == given ? argv[optind - 2] : given);
    if (args->help) return EXIT_OK;
  }
  while (!status && optind < argc) status = take_operand(args, argv[optind++]);
  return status;
}

static int check_combination(const arguments *args) {
  const char *command = command_name(args->which);
  if (args->help) return EXIT_OK;
  if (args->resume && !args->out)
    return report_usage_error(command, "--resume needs --out FILE, the trajectory to resume");
  if (args->resume && args->force)
    return report_usage_error(command, "--resume and --force exclude each other");
  if (args->options.every > 0 && args->options.fps > 0)
    return report_usage_error(command, "--every and --fps exclude each other");
  if (!(args->scene && *args->scene) && args->which != COMMAND_LIST)
    return report_usage_error(command, "%s needs a scene file", command);
  return EXIT_OK;
}

int arguments_parse(command_id which, int argc, char **argv, arguments *args) {
  *args = (arguments){.which = which};
  msim_options_init(&args->options, sizeof args->options);
  args->settings = calloc((size_t)argc, sizeof *args->settings);
  struct option *all = long_options(which);
  int status = all && args->settings ? parse_all(args, argc, argv, all)
                                     : report_error("out of memory for the command line");
  free(all);
  return status ? status : check_combination(args);
}

void arguments_free(arguments *args) { free(args->settings); }

/*------------------------------------- options of a run -----------------------------------------*/

/* Some options replace one another: one on the command line unsets the other one of the scene. */
static void unset_replaced(const msim_options *given, msim_options *options) {
  if (given->t_end >= 0) options->steps = -1;
  if (given->steps >= 0) options->tol = 0, options->t_end = -1;
  if (given->every > 0) options->fps = 0;
  if (given->fps > 0) options->every = 0;
}

int arguments_options(const arguments *args, const msim_scene *scene, msim_options *options) {
  msim_error err;
  msim_options_init(options, sizeof *options);
  msim_status status = msim_options_from_scene(options, scene, &err);
  unset_replaced(&args->options, options);
  for (int i = 0; i < args->nsettings && !status; i++)
    status = msim_options_set(options, args->settings[i].name, args->settings[i].value, &err);
  return status ? report_error("%s", err.text) : EXIT_OK;
}
