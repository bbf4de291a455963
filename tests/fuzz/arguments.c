/* Fuzz target: command lines, one argument per line, of which the first selects the command.
 * Accepted arguments are options of a run of a few steps. */
#include <getopt.h>
#include <stdlib.h>
#include <string.h>

#include "../../tools/common/message.h"
#include "../../tools/msim_cli/arguments.h"
#include "fuzz.h"

const char program_name[] = "fuzz";

enum { MOST_ARGUMENTS = 64 };

static const char text[] =
    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"particles\": {\"x\": [[0,0,2],[0.5,0,2],[1,0,0]],"
    "\"mass\": 1, \"pinned\": [0]}, \"springs\": {\"ij\": [[0,1],[1,2]], \"k\": 500},"
    "\"planes\": [{\"normal\": [0,0,1], \"offset\": 0}], \"run\": {\"h\": 0.01, \"t_end\": 1}}";

/* Ends each line with a zero; returns the number of lines. */
static int split(char *lines, char **argv) {
  int argc = 0;
  for (char *end; lines && argc < MOST_ARGUMENTS; lines = end) {
    argv[argc++] = lines;
    end = strchr(lines, '\n');
    if (end) *end++ = '\0';
  }
  return argc;
}

static void run(const arguments *args) {
  msim_error err;
  msim_scene *scene;
  msim_options options;
  fuzz_check(msim_scene_parse(NULL, "fuzz", text, sizeof text - 1, &scene, &err) == MSIM_OK,
             err.text);
  if (arguments_options(args, scene, &options) == EXIT_OK) {
    if (!options.integrator) options.integrator = "bdf2";
    options.plugin_path = NULL; /* a command line may load any code, which is no fault */
    fuzz_run(scene, &options);
  }
  msim_scene_destroy(scene);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  char *lines = calloc(size + 1, 1), *argv[MOST_ARGUMENTS + 1] = {NULL};
  arguments args;
  fuzz_check(lines != NULL, "memory");
  if (size) memcpy(lines, data, size);
  const int argc = split(lines, argv);
  optind = 0; /* glibc: restart the scan */
  if (arguments_parse((command_id)(*argv[0] % NCOMMANDS + NCOMMANDS) % NCOMMANDS, argc, argv,
                      &args) == EXIT_OK)
    run(&args);
  arguments_free(&args);
  free(lines);
  return 0;
}
