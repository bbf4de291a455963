/* msim_bench - measures the speed and accuracy of msim on this machine, next to other libraries */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/blas.h"
#include "../common/clock.h"
#include "../common/interrupt.h"
#include "../common/message.h"
#include "../common/mpirun.h"
#include "../common/output.h"
#include "../common/standard.h"
#include "arguments.h"

const char program_name[] = "msim_bench";

enum { DOC_COLUMN = 27 };

static void print_help(void) {
  const bench_entry *bench;
  const bench_flag *flag;
  char text[80], scenes[MAX_SCENE_LIST];
  puts(
      "Usage: msim_bench NAME [--quick] [--json FILE] [--scene NAME,...] [--threads N]\n"
      "                       [--ranks N,...]\n"
      "Measure the speed and accuracy of msim on this machine, next to other libraries.\n\n"
      "Benches:");
  for (int i = 0; (bench = bench_info(i)) != NULL; i++) {
    print_column(DOC_COLUMN, bench->name);
    print_wrapped(DOC_COLUMN, bench->doc);
  }
  puts("\nOptions:");
  for (int i = 0; (flag = flag_info(i)) != NULL; i++) {
    snprintf(text, sizeof text, "--%s%s%s", flag->name, flag->value ? " " : "",
             flag->value ? flag->value : "");
    print_column(DOC_COLUMN, text);
    print_wrapped(DOC_COLUMN, flag->doc);
  }
  puts("\nScenes:");
  for (int i = 0; (bench = bench_info(i)) != NULL; i++) {
    list_scenes(bench, scenes);
    if (!*scenes) continue;
    print_column(DOC_COLUMN, bench->name);
    print_wrapped(DOC_COLUMN, scenes);
  }
  puts(
      "\nExit status: 0: success; 1: error; 2: stopped by Ctrl-C. A solver that fails is\n"
      "reported as a result: its row has the reason.");
}

/* Opens the file before the measurement, so that an unwritable path is reported at once. */
static int run_bench(const arguments *args, output_file *json) {
  const bench_entry *bench = args->bench;
  const int quick = args->options.quick;
  const double seconds = bench->seconds[quick];
  report r;
  if (args->json && output_open(json, args->json)) return EXIT_ERROR;
  if (!mpirun_may_be_several()) catch_interrupts(); /* processes would stop at different calls */
  report_begin(&r, bench->name, quick);
  bench_run b = {.options = &args->options,
                 .report = &r,
                 .until = seconds > 0 ? clock_seconds() + seconds : INFINITY,
                 .fall = bench->fall[quick]};
  int status = bench->run(&b);
  if (is_interrupted()) {
    report_error("interrupted%s", args->json ? "; no file was written" : "");
    status = EXIT_EVENT;
  }
  if (!status) report_print_summary(&r);
  if (!status && args->json) status = report_write(&r, json);
  report_free(&r);
  return status;
}

static int execute_command(int argc, char **argv) {
  arguments args;
  output_file json = {.path = NULL};
  if (arguments_parse(argc, argv, &args)) return EXIT_ERROR;
  if (args.help) print_help();
  else if (args.version) printf("msim_bench %s\n", msim_version());
  else {
    mpirun_mute();
    if (mpirun_rank() > 0) args.json = NULL;
    int status = run_bench(&args, &json);
    output_discard(&json);
    return status;
  }
  return EXIT_OK;
}

int main(int argc, char **argv) {
  standard_begin();
  blas_choose_kernels();
  return standard_end(execute_command(argc, argv));
}
