/* msim_cli - simulate mass-spring systems from the command line */
#include <stdio.h>
#include <string.h>

#include "../common/blas.h"
#include "../common/message.h"
#include "../common/standard.h"
#include "arguments.h"
#include "comparison.h"
#include "completion.h"
#include "help.h"
#include "mesh_note.h"
#include "ranks.h"
#include "report.h"
#include "run.h"
#include "setup.h"
#include "statics.h"

const char program_name[] = "msim_cli";

static int explain_command(const arguments *args) {
  setup made;
  msim_sim *sim = NULL;
  msim_error err;
  const char *text;
  int status = setup_load(args, &made);
  const mesh_note note = status ? (mesh_note){""} : mesh_note_make(made.scene);
  if (*note.text) report_error("note: %s", note.text);
  if (!status && !made.options.integrator) status = comparison_print(&made);
  else if (!status) {
    msim_status made_sim = msim_sim_create(made.scene, &made.options, &sim, &err);
    if (!made_sim) made_sim = msim_sim_explain(sim, &text, &err);
    if (made_sim) status = setup_report_error(made_sim, &err);
    else fputs(text, stdout);
  }
  msim_sim_destroy(sim);
  setup_free(&made);
  return status;
}

static int run_named_command(command_id which, int argc, char **argv) {
  static int (*const commands[NCOMMANDS])(const arguments *) = {
      run_command, rest_command, modes_command, explain_command, report_list};
  arguments args;
  if (which == COMMAND_RUN) ranks_begin();
  int status = arguments_parse(which, argc, argv, &args);
  if (!status && args.help) help_command(which);
  else if (!status) status = commands[which](&args);
  arguments_free(&args);
  return ranks_end(status);
}

static int is_one_of(const char *word, const char *a, const char *b) {
  return strcmp(word, a) == 0 || strcmp(word, b) == 0;
}

static int dispatch(int argc, char **argv) {
  if (argc < 2)
    return report_usage_error("", "a command is missing: run, rest, modes, explain or list");
  const char *name = argv[1];
  if (is_one_of(name, "-h", "--help")) return help_program(), EXIT_OK;
  if (is_one_of(name, "-V", "--version")) return help_version(), EXIT_OK;
  if (strcmp(name, "help") == 0) return help_topic(argc - 1, argv + 1);
  if (strcmp(name, "completion") == 0) return completion_command(argc - 1, argv + 1);
  for (int i = 0; i < NCOMMANDS; i++)
    if (strcmp(name, command_name((command_id)i)) == 0)
      return run_named_command((command_id)i, argc - 1, argv + 1);
  return help_refuse_command(name);
}

int main(int argc, char **argv) {
  standard_begin();
  blas_choose_kernels();
  return standard_end(dispatch(argc, argv));
}
