/* msim_cli - simulate mass-spring systems from the command line */
#define _POSIX_C_SOURCE 200809L /* fcntl, signals */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "arguments.h"
#include "help.h"
#include "message.h"
#include "report.h"
#include "run.h"
#include "setup.h"

static int explain_command(const arguments *args) {
  setup made;
  msim_sim *sim = NULL;
  msim_error err;
  const char *text;
  int status = setup_make(args, &made);
  if (!status) {
    msim_status made_sim = msim_sim_create(made.scene, &made.options, &sim, &err);
    if (!made_sim) made_sim = msim_sim_explain(sim, &text, &err);
    if (made_sim) status = setup_failed(made_sim, &err);
    else fputs(text, stdout);
  }
  msim_sim_destroy(sim);
  setup_free(&made);
  return status;
}

static int run_one(command_id which, int argc, char **argv) {
  static int (*const commands[NCOMMANDS])(const arguments *) = {run_command, explain_command,
                                                                report_list};
  arguments args;
  int status = arguments_parse(which, argc, argv, &args);
  if (!status && args.help) help_command(which);
  else if (!status) status = commands[which](&args);
  arguments_free(&args);
  return status;
}

static int dispatch(int argc, char **argv) {
  if (argc < 2) return complain_usage("", "a command is missing: run, explain or list");
  if (strcmp(argv[1], "--help") == 0) help_program();
  else if (strcmp(argv[1], "--version") == 0) help_version();
  else {
    for (int i = 0; i < NCOMMANDS; i++)
      if (strcmp(argv[1], command_name((command_id)i)) == 0)
        return run_one((command_id)i, argc - 1, argv + 1);
    return complain_usage("", "there is no command '%s', only run, explain and list", argv[1]);
  }
  return EXIT_OK;
}

/* Where standard files are closed, the next file opened would take their place and get what is
 * printed. Here writing to stdout fails as it should, and what goes to stderr is lost. */
static void reserve_standard_files(void) {
  for (int fd = 0; fd <= 2; fd++)
    if (fcntl(fd, F_GETFD) == -1 && errno == EBADF)
      open("/dev/null", fd == 2 ? O_WRONLY : O_RDONLY);
}

/* What buffering hid. */
static int close_stdout(void) {
  int failed = ferror(stdout);
  errno = 0;
  if (fclose(stdout) == 0 && !failed) return EXIT_OK;
  return complain("cannot write to standard output%s%s", errno ? ": " : "",
                  errno ? strerror(errno) : "");
}

int main(int argc, char **argv) {
  reserve_standard_files();
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN); /* a limit on file sizes is an error of the write, as a full disk is */
  int status = dispatch(argc, argv);
  int written = close_stdout();
  return status ? status : written;
}
