#define _POSIX_C_SOURCE 200809L /* fork, strsignal */
#include "scene_precheck.h"

#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../common/files.h"
#include "../common/message.h"
#include "msim/msim.h"

int precheck_scene(const char *path) {
  if (!has_extension(path, ".h5")) return EXIT_OK;
  const pid_t child = fork();
  if (child == 0) {
    msim_scene *scene;
    msim_scene_load(NULL, path, &scene, NULL);
    _exit(EXIT_OK); /* the parent reports errors of the scene */
  }
  int how = 0;
  if (child < 0 || waitpid(child, &how, 0) != child || !WIFSIGNALED(how)) return EXIT_OK;
  return report_error("%s: libhdf5 crashed while reading it (%s): the file is damaged or malicious",
                      path, strsignal(WTERMSIG(how)));
}
