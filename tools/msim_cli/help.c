#include "help.h"

#include <stdio.h>

#include "../common/message.h"

enum { DOC_COLUMN = 27 };

static const char example[] =
    "Example: the first command creates a scene, a rope pinned at one end; the second\n"
    "one simulates it.\n"
    "  echo '{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"objects\": [{\"type\": \"rope\",\n"
    "    \"n\": 20, \"from\": [0, 0, 0], \"to\": [1, 0, 0], \"mass\": 1, \"k\": 1000,\n"
    "    \"pinned\": [0]}]}' >rope.json\n"
    "  msim_cli run rope.json --integrator velocity-verlet --t_end 2 --out rope.csv\n";

static const char usage_run[] =
    "Usage: msim_cli run SCENE [--OPTION VALUE]... [--out FILE]\n"
    "                          [--every N | --fps F] [--final FILE.json]\n"
    "                          [--init FINAL.json] [--resume] [--stats] [--quiet]\n"
    "Simulate a scene file, in JSON or HDF5 (*.h5).\n";

static const char usage_explain[] =
    "Usage: msim_cli explain SCENE [--OPTION VALUE]...\n"
    "Describe what a run would do: what is skipped and why, stability limits, size of\n"
    "the matrix.\n"
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

static void print_flags(command_id which) {
  const cli_flag *flag;
  for (int i = 0; (flag = flag_info(i)) != NULL; i++) {
    if (!(flag->commands & 1u << which)) continue;
    char text[80];
    snprintf(text, sizeof text, "--%s%s%s", flag->name, flag->value ? " " : "",
             flag->value ? flag->value : "");
    print_column(DOC_COLUMN, text);
    print_wrapped(DOC_COLUMN, flag->doc);
  }
}

static void print_option(const msim_option_entry *option) {
  char text[512];
  const char *preset = option->preset;
  snprintf(text, sizeof text, "--%s", option->name);
  print_column(DOC_COLUMN, text);
  snprintf(text, sizeof text, "%s (%s%s%s)", option->doc, option->values,
           *preset ? "; default " : "", preset);
  print_wrapped(DOC_COLUMN, text);
}

static void print_options(command_id which) {
  const msim_option_entry *option;
  for (int i = 0; (option = msim_option_info(i)) != NULL; i++)
    if (command_has_option(which, option)) print_option(option);
}

void help_command(command_id which) {
  static const char *const usage[NCOMMANDS] = {usage_run, usage_explain, usage_list};
  fputs(usage[which], stdout);
  if (which == COMMAND_RUN) printf("\n%s", example);
  puts("\nFlags:");
  print_flags(which);
  puts("\nOptions, as --NAME VALUE or --NAME=VALUE:");
  print_options(which);
  if (which != COMMAND_LIST) printf("\n%s", precedence);
  if (which == COMMAND_RUN) fputs(exit_status, stdout);
}

void help_program(void) {
  puts("Usage: msim_cli COMMAND [ARGUMENT]...\nSimulate mass-spring systems.\n");
  fputs(example, stdout);
  puts("\nCommands:");
  print_column(DOC_COLUMN, "run SCENE");
  print_wrapped(DOC_COLUMN, "simulate a scene");
  print_column(DOC_COLUMN, "explain SCENE");
  print_wrapped(DOC_COLUMN, "describe what a run would do, and why");
  print_column(DOC_COLUMN, "list");
  print_wrapped(DOC_COLUMN, "list integrators, linear solvers and recorders");
  puts("\nEnvironment:");
  print_column(DOC_COLUMN, "MSIM_PLUGIN_PATH");
  print_wrapped(DOC_COLUMN, "folders to search for plugins, separated by ':'");
  print_column(DOC_COLUMN, "OPENBLAS_CORETYPE");
  print_wrapped(DOC_COLUMN,
                "kernels of OpenBLAS, which cholmod uses; default on AMD processors with AVX-512: "
                "SkylakeX, because OpenBLAS does not recognize them");
  puts("\n'msim_cli COMMAND --help' describes a command and its options.");
}

void help_version(void) { printf("msim_cli %s\n", msim_version()); }
