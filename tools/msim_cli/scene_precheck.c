#define _XOPEN_SOURCE 700 /* fork, strsignal, setrlimit */
#include "scene_precheck.h"

#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../common/files.h"
#include "../common/message.h"
#include "msim/msim.h"

enum { MOST_SECONDS = 120 }; /* of CPU time: damaged files may be read forever */

/* 1: the text "mesh" occurs in the file, with its quotes. A pipe can be read only once. */
static int mentions_mesh(const char *path) {
  static const char word[] = "\"mesh\"";
  struct stat info;
  if (stat(path, &info) || !S_ISREG(info.st_mode)) return 0;
  FILE *file = fopen(path, "rb");
  size_t matched = 0;
  for (int c; file && word[matched] && (c = getc(file)) != EOF;)
    matched = c == word[matched] ? matched + 1 : c == '"';
  if (file) fclose(file);
  return !word[matched];
}

int precheck_scene(const char *path, int rank, int nranks) {
  const int is_hdf5 = has_extension(path, ".h5");
  if (!is_hdf5 && !mentions_mesh(path)) return EXIT_OK;
  const pid_t child = fork();
  if (child == 0) {
    const struct rlimit seconds = {MOST_SECONDS, MOST_SECONDS};
    msim_scene *scene;
    setrlimit(RLIMIT_CPU, &seconds);
    if (!freopen("/dev/null", "w", stderr)) fclose(stderr); /* of failed assertions in libraries */
    msim_scene_load_part(NULL, path, rank, nranks, &scene, NULL);
    _exit(EXIT_OK); /* the parent reports errors of the scene */
  }
  int how = 0;
  if (child < 0 || waitpid(child, &how, 0) != child || !WIFSIGNALED(how)) return EXIT_OK;
  return report_error("%s: %s crashed while reading it (%s): the file is damaged or malicious",
                      path, is_hdf5 ? "libhdf5" : "Assimp, on a mesh of this scene,",
                      strsignal(WTERMSIG(how)));
}
