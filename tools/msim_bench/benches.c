#include "benches.h"

#include <stdio.h>
#include <string.h>

static const bench_entry benches[] = {
    {.name = "linear",
     .doc = "time of a linearly implicit step with each solver, compared with libraries in default "
            "settings",
     .seconds = {840, 54},
     .fall = {60, 3},
     .run = bench_linear},
    {.name = "forces",
     .doc =
         "time of explicit steps, compared with a textbook loop over the springs and with memory "
         "bandwidth",
     .seconds = {600, 45},
     .threads = "1 and 2 threads",
     .run = bench_forces},
    {.name = "scaling",
     .doc = "time of implicit steps for increasing scene size and stiffness, compared with CHOLMOD",
     .seconds = {840, 46},
     .fall = {60, 3},
     .scenes =
         "cloth32, cloth64, cloth100, cloth200, cloth316, cloth500, cloth1000, jelly8, jelly16, "
         "jelly24, jelly32, jelly46",
     .run = bench_scaling},
    {.name = "skip",
     .doc = "time saved by skipping features, compared with CHOLMOD in every step",
     .seconds = {600, 50},
     .scenes = "",
     .run = bench_skip},
    {.name = "step",
     .doc = "time of a nonlinear implicit step to a given accuracy, compared with CHOLMOD and "
            "prefactored methods",
     .seconds = {840, 45},
     .fall = {60, 3},
     .scenes = "cloth32, cloth64, cloth100, cloth200, jelly16",
     .threads = "1 thread",
     .run = bench_step},
    {.name = "precision",
     .doc = "run time against error of every integrator, compared with CVODE and ARKODE",
     .scenes = "trampoline, folding, stiff, damped, lightly_damped, damped_rope, damped_jelly, "
               "jelly, chain, dumbbells, slide, cord",
     .run = bench_precision},
    {.name = "stability",
     .doc = "longest stable steps compared with theory, and scenes in which integrators fail",
     .scenes = "",
     .run = bench_stability},
    {.name = "distributed",
     .doc = "time, communication and memory of steps on several ranks, that are threads or, under "
            "mpirun, processes, and a model of many",
     .scenes = "",
     .threads = "1 thread a rank",
     .has_ranks = 1,
     .run = bench_distributed},
};

const bench_entry *bench_info(int i) {
  return i >= 0 && i < (int)(sizeof benches / sizeof *benches) ? &benches[i] : NULL;
}

void list_scenes(const bench_entry *bench, char list[static MAX_SCENE_LIST]) {
  size_t used = (size_t)snprintf(list, MAX_SCENE_LIST, "%s", bench->scenes ? bench->scenes : "");
  for (int i = 0; !bench->scenes && scene_info(i); i++)
    used += (size_t)snprintf(list + used, MAX_SCENE_LIST - used, "%s%s", i ? ", " : "",
                             scene_info(i)->name);
}

int is_scene_selected(const bench_options *options, const char *scene) {
  for (int i = 0; i < options->nscenes; i++)
    if (strcmp(options->scenes[i], scene) == 0) return 1;
  return options->nscenes == 0;
}
