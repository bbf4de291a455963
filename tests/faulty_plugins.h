/* faulty_plugins - a folder of plugins, each with the fault that its file name says, and checks of
 * the messages that users see */
#ifndef FAULTY_PLUGINS_H
#define FAULTY_PLUGINS_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "scenes.h"

/* The folder of the plugins of a test. The build makes only one of them,
 * FAKES/msim_backend_good.so. */
static char plugin_folder[] = "/tmp/msim_plugins_XXXXXX";

static inline const char *plugin_file(const char *name) {
  static char path[512];
  snprintf(path, sizeof path, "%s/msim_backend_%s.so", plugin_folder, name);
  return path;
}

/* Copy that plugin under the name of a fault. Only once: a loaded file must not be overwritten. */
static inline void copy_plugin(const char *name) {
  if (access(plugin_file(name), F_OK) == 0) return;
  FILE *from = fopen(FAKES "/msim_backend_good.so", "rb"), *to = fopen(plugin_file(name), "wb");
  assert_true(from && to);
  for (int c; (c = fgetc(from)) != EOF;) fputc(c, to);
  fclose(from), fclose(to);
}

static inline int make_folder(void **state) {
  (void)state;
  unsetenv("MSIM_PLUGIN_PATH");
  return mkdtemp(plugin_folder) ? 0 : -1;
}

static inline int remove_folder(void **state) {
  char command[64];
  (void)state;
  snprintf(command, sizeof command, "rm -r %s", plugin_folder);
  return system(command);
}

/* The message with the folder in place of each @. */
static inline const char *with_folder(const char *sentence) {
  static char text[2048];
  size_t used = 0;
  for (; *sentence && used < sizeof text - sizeof plugin_folder; sentence++)
    used += (size_t)snprintf(text + used, sizeof text - used, *sentence == '@' ? "%s" : "%.1s",
                             *sentence == '@' ? plugin_folder : sentence);
  text[used] = '\0';
  return text;
}

/* 1 if the texts are equal; where `wanted` ends in "...", if text begins with what precedes
 * that. */
static inline int is_sentence(const char *text, const char *wanted) {
  const size_t length = strlen(wanted);
  if (length >= 3 && strcmp(wanted + length - 3, "...") == 0)
    return strncmp(text, wanted, length - 3) == 0;
  return strcmp(text, wanted) == 0;
}

/* Three steps of a small cloth; x: the positions at the end. */
static inline msim_status run_with_solver(const char *solver, const char *plugin_path, double *x,
                                          msim_stats *stats, msim_error *why) {
  msim_scene *scene = hanging_cloth(3, 100, 0);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  msim_sim *sim = NULL;
  *why = (msim_error){0, ""};
  opt.solver = solver, opt.plugin_path = plugin_path, opt.solver_rtol = 1e-10;
  msim_status status = msim_sim_create(scene, &opt, &sim, why);
  if (!status) {
    status = msim_sim_step(sim, 3, why);
    memcpy(x, state_of(sim).x, 27 * sizeof *x);
    *stats = stats_of(sim);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status;
}

/* The status and the message of a run with a solver. After a failed step the state must be bounded;
 * after success it must agree with that of pcg. */
static inline void expect_message(const char *solver, const char *plugin_path, msim_status wanted,
                                  const char *sentence) {
  double x[27] = {0}, right[27];
  msim_stats stats;
  msim_error why;
  const msim_status status = run_with_solver(solver, plugin_path, x, &stats, &why);
  if (status != wanted || !is_sentence(why.text, with_folder(sentence)))
    fail_msg("%s: status %d, \"%s\"; wanted %d, \"%s\"", solver, (int)status, why.text, (int)wanted,
             with_folder(sentence));
  for (int i = 0; i < 27; i++) assert_true(x[i] > -2 && x[i] < 2);
  if (status) return;
  assert_ok(run_with_solver("pcg", NULL, right, &stats, err));
  for (int i = 0; i < 27; i++) assert_close(x[i], right[i], 1e-9);
}

typedef struct plugin_case {
  const char *name;
  msim_status status;
  const char *sentence;
} plugin_case;

/* The same for several plugins, one after the other. */
static inline void expect_plugins(const plugin_case *attempts, size_t count) {
  for (size_t i = 0; i < count; i++) {
    copy_plugin(attempts[i].name);
    expect_message(attempts[i].name, plugin_folder, attempts[i].status, attempts[i].sentence);
  }
}
#define EXPECT_PLUGINS(attempts) expect_plugins(attempts, sizeof(attempts) / sizeof *(attempts))

#endif
