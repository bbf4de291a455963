#include "setup.h"

#include "../common/message.h"
#include "scene_precheck.h"

int setup_report_error(msim_status status, const msim_error *err) {
  report_error("%s", err->text);
  return status > 0 ? EXIT_EVENT : EXIT_ERROR;
}

int setup_read(const arguments *args, int rank, int nranks, setup *made) {
  msim_error err;
  *made = (setup){.scene = NULL};
  if (msim_scene_load_part(NULL, args->scene, rank, nranks, &made->scene, &err) != MSIM_OK)
    return report_error("%s", err.text);
  return arguments_options(args, made->scene, &made->options);
}

int setup_load(const arguments *args, setup *made) {
  *made = (setup){.scene = NULL};
  if (precheck_scene(args->scene, 0, 1)) return EXIT_ERROR;
  return setup_read(args, 0, 1, made);
}

void setup_free(setup *made) { msim_scene_destroy(made->scene); }
