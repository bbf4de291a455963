#include "help.h"

#include <stdio.h>

#include <string.h>

#include "../common/message.h"
#include "manual.h"
#include "scene_help.h"

const char help_example[] =
    "Example: the first command creates a scene, a rope pinned at one end; the second\n"
    "one simulates it.\n"
    "  echo '{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"objects\": [{\"type\": \"rope\",\n"
    "    \"n\": 20, \"from\": [0, 0, 0], \"to\": [1, 0, 0], \"mass\": 1, \"k\": 1000,\n"
    "    \"pinned\": [0]}]}' >rope.json\n"
    "  msim_cli run rope.json --integrator velocity-verlet --t_end 2 --out rope.csv\n";

static const help_entry commands[] = {
    {"run", "SCENE", "simulate a scene"},
    {"rest", "SCENE", "find the equilibrium near the start"},
    {"modes", "SCENE", "compute the lowest natural frequencies"},
    {"explain", "SCENE", "describe what a run would do, and why"},
    {"list", "", "list integrators, linear solvers and recorders"},
    {"help", "[TOPIC]",
     "describe a command, an option, a key of scene files, or all of them: scene; with --json as a "
     "JSON schema for editors; man: the manual page"},
    {"completion", "SHELL", "print the completion of commands and options for bash or zsh"},
    {"--help", "", "print this help, as -h and help do"},
    {"--version", "", "print the version, as -V does"}};

static const help_entry environment[] = {
    {"MSIM_PLUGIN_PATH", "", "folders to search for plugins, separated by ':'"},
    {"OPENBLAS_CORETYPE", "",
     "kernels of OpenBLAS, which cholmod uses; default on AMD processors with AVX-512: SkylakeX, "
     "because OpenBLAS does not recognize them"}};

const help_entry *help_command_info(int i) {
  return i < (int)(sizeof commands / sizeof *commands) ? &commands[i] : NULL;
}

const help_entry *help_environment_info(int i) {
  return i < (int)(sizeof environment / sizeof *environment) ? &environment[i] : NULL;
}

/*------------------------------------- commands -------------------------------------------------*/

static const char usage_run[] =
    "Usage: msim_cli run SCENE [--OPTION VALUE]... [--out FILE]\n"
    "                          [--every N | --fps F] [--final FILE.json]\n"
    "                          [--energies FILE.csv] [--reactions FILE.csv]\n"
    "                          [--springs FILE.csv] [--init FINAL.json] [--resume]\n"
    "                          [--stats] [--quiet]\n"
    "Simulate a scene file, in JSON or HDF5 (*.h5).\n";

static const char usage_rest[] =
    "Usage: msim_cli rest SCENE [--ftol NEWTONS] [--final FILE.json]\n"
    "                           [--init FINAL.json] [--quiet]\n"
    "Find the equilibrium near the start: a minimum of elastic and potential energy,\n"
    "where the forces on each particle sum up to 0. Damping and drag have no effect.\n"
    "\n"
    "Example: a run that starts at rest.\n"
    "  msim_cli rest rope.json --final rest.json\n"
    "  msim_cli run rope.json --init rest.json --integrator rk4 --t_end 1\n";

static const char usage_modes[] =
    "Usage: msim_cli modes SCENE [-n N] [--init FINAL.json] [--json FILE.json]\n"
    "Compute the lowest natural frequencies (Hz) of small undamped vibrations about\n"
    "the start, or the state of --init, as 'msim_cli rest' writes it. A negative\n"
    "frequency is that of an unstable motion.\n"
    "\n"
    "Example:\n"
    "  msim_cli modes rope.json --init rest.json -n 6\n";

static const char usage_explain[] =
    "Usage: msim_cli explain SCENE [--OPTION VALUE]...\n"
    "Describe what a run would do: advice in five lines, then what is skipped and\n"
    "why, stability limits, size of the matrix. Without an integrator: compare four\n"
    "methods.\n"
    "\n"
    "Example:\n"
    "  msim_cli explain rope.json --integrator linearly-implicit-euler --h 0.01\n";

static const char usage_list[] =
    "Usage: msim_cli list [--plugin_path FOLDERS]\n"
    "List the integrators, the linear solvers and which library each needs, and the\n"
    "recorders.\n";

static const char precedence[] =
    "Every option may also be given in the scene's \"run\", as in \"run\": {\"h\": 1e-3};\n"
    "the command line wins. A run needs --integrator, and --steps or --t_end.\n";

static const char exit_status[] =
    "\n"
    "Exit status: 0: success; 1: error; 2: a numerical event or Ctrl-C ended the run\n"
    "early, and all results up to then are kept.\n";

static void print_flag(const cli_flag *flag) {
  char text[80];
  snprintf(text, sizeof text, "--%s%s%s", flag->name, flag->value ? " " : "",
           flag->value ? flag->value : "");
  print_column(HELP_COLUMN, text);
  print_wrapped(HELP_COLUMN, flag->doc);
}

static void print_flags(command_id which) {
  const cli_flag *flag;
  for (int i = 0; (flag = flag_info(i)) != NULL; i++)
    if (flag->commands & 1u << which) print_flag(flag);
}

static void print_option(const msim_option_entry *option) {
  char text[512];
  const char *preset = option->preset;
  snprintf(text, sizeof text, "--%s", option->name);
  print_column(HELP_COLUMN, text);
  snprintf(text, sizeof text, "%s (%s%s%s)", option->doc, option->values,
           *preset ? "; default " : "", preset);
  print_wrapped(HELP_COLUMN, text);
}

static void print_options(command_id which) {
  const msim_option_entry *option;
  for (int i = 0; (option = msim_option_info(i)) != NULL; i++)
    if (command_has_option(which, option)) print_option(option);
}

void help_command(command_id which) {
  static const char *const usage[NCOMMANDS] = {usage_run, usage_rest, usage_modes, usage_explain,
                                               usage_list};
  fputs(usage[which], stdout);
  if (which == COMMAND_RUN) printf("\n%s", help_example);
  puts("\nFlags:");
  print_flags(which);
  puts("\nOptions, as --NAME VALUE or --NAME=VALUE:");
  print_options(which);
  if (which == COMMAND_RUN || which == COMMAND_EXPLAIN) printf("\n%s", precedence);
  if (which < COMMAND_EXPLAIN) fputs(exit_status, stdout);
}

static void print_entry(const help_entry *entry) {
  char text[80];
  snprintf(text, sizeof text, "%s%s%s", entry->name, *entry->operands ? " " : "", entry->operands);
  print_column(HELP_COLUMN, text);
  print_wrapped(HELP_COLUMN, entry->doc);
}

void help_program(void) {
  const help_entry *entry;
  puts("Usage: msim_cli COMMAND [ARGUMENT]...\nSimulate mass-spring systems.\n");
  fputs(help_example, stdout);
  puts("\nCommands:");
  for (int i = 0; (entry = help_command_info(i)) != NULL; i++) print_entry(entry);
  puts("\nEnvironment:");
  for (int i = 0; (entry = help_environment_info(i)) != NULL; i++) print_entry(entry);
  puts(
      "\n'msim_cli help COMMAND' describes a command and its options, 'msim_cli help\n"
      "scene' the format of scene files.");
}

void help_version(void) { printf("msim_cli %s\n", msim_version()); }

/*------------------------------------- topics ---------------------------------------------------*/

enum { MOST_NAMES = 256, NAME_SIZE = 48 };

/* The search for a word among all names, which are kept for a hint */
typedef struct search {
  const char *word;
  const char *heading; /* the last one printed */
  int nnames;
  char names[MOST_NAMES][NAME_SIZE];
} search;

/* 1: the word is this name; prints the heading once for all names under it. */
static int is_match(search *s, const char *name, const char *heading) {
  if (s->nnames < MOST_NAMES) snprintf(s->names[s->nnames++], NAME_SIZE, "%s", name);
  if (strcmp(name, s->word) != 0) return 0;
  if (!s->heading || strcmp(s->heading, heading) != 0)
    printf("%s%s\n", s->heading ? "\n" : "", heading);
  s->heading = heading;
  return 1;
}

static int print_matching_key(const scene_key *key, void *user) {
  const int is_path = strcmp(((search *)user)->word, key->path) == 0;
  if (is_match(user, is_path ? key->path : key->name, "Scene files:"))
    scene_help_print_key(key, NULL);
  return EXIT_OK;
}

static int print_matches(search *s) {
  const help_entry *command;
  const cli_flag *flag;
  const msim_option_entry *option;
  const msim_integrator_entry *method;
  for (int i = 0; (command = help_command_info(i)) != NULL; i++)
    if (is_match(s, command->name, "Commands:")) print_entry(command);
  for (int32_t i = 0; (method = msim_integrator_info(i)) != NULL; i++)
    if (is_match(s, method->name, "Integrators:"))
      print_entry(&(help_entry){method->name, "", method->doc});
  for (int i = 0; (flag = flag_info(i)) != NULL; i++)
    if (is_match(s, flag->name, "Command line:")) print_flag(flag);
  for (int i = 0; (option = msim_option_info(i)) != NULL; i++)
    if (is_match(s, option->name, "Command line:")) print_option(option);
  return scene_help_visit(print_matching_key, s);
}

static int refuse_topic(search *s) {
  const char *names[MOST_NAMES + 1] = {NULL};
  for (int i = 0; i < s->nnames; i++) names[i] = s->names[i];
  const char *meant = msim_nearest_name(s->word, names);
  if (meant)
    return report_usage_error("", "there is no topic '%s' (did you mean '%s'?)", s->word, meant);
  return report_usage_error(
      "", "there is no topic '%s', only commands, options, integrators, keys, scene and man",
      s->word);
}

static int help_name(const char *word) {
  search s = {.word = word + strspn(word, "-")};
  for (int i = 0; i < NCOMMANDS; i++)
    if (strcmp(command_name((command_id)i), word) == 0) return help_command((command_id)i), EXIT_OK;
  if (print_matches(&s)) return EXIT_ERROR;
  return s.heading ? EXIT_OK : refuse_topic(&s);
}

int help_topic(int argc, char **argv) {
  const char *topic = argc > 1 ? argv[1] : NULL;
  const int as_json = argc == 3 && strcmp(argv[2], "--json") == 0 && strcmp(topic, "scene") == 0;
  if (as_json) return scene_help_print_schema();
  if (argc > 2) return report_usage_error("", "help takes one topic, and --json after scene only");
  if (!topic || *topic == '\0' || strcmp(topic, "--help") == 0 || strcmp(topic, "-h") == 0)
    return help_program(), EXIT_OK;
  if (strcmp(topic, "scene") == 0) return scene_help_print();
  if (strcmp(topic, "man") == 0) return manual_print();
  return help_name(topic);
}

int help_refuse_command(const char *name) {
  const char *names[12] = {NULL};
  const help_entry *entry;
  for (int i = 0; (entry = help_command_info(i)) != NULL; i++) names[i] = entry->name;
  const char *meant = msim_nearest_name(name, names);
  if (meant)
    return report_usage_error("", "there is no command '%s' (did you mean '%s'?)", name, meant);
  return report_usage_error("",
                            "there is no command '%s', only run, rest, modes, explain, list, help "
                            "and completion",
                            name);
}
