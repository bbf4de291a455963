#include "benches.h"

#include <string.h>

const bench_entry *bench_info(int i) {
  static const bench_entry benches[] = {
      {"linear", "one linearly implicit step by every solver, beside the libraries out of the box",
       bench_linear, &linear_picture},
      {"forces", "explicit steps, beside a plain loop over the springs and the speed of memory",
       bench_forces, &forces_picture},
      {"scaling", "implicit steps as scenes and stiffness grow, beside CHOLMOD", bench_scaling,
       &scaling_picture},
      {"skip", "what leaving out saves, beside CHOLMOD in every step", bench_skip, &skip_picture},
      {"step", "a nonlinear implicit step to an accuracy, beside CHOLMOD and prefactored methods",
       bench_step, &step_picture},
      {"precision", "run time against error of every method, beside CVODE and ARKODE",
       bench_precision, &precision_picture},
      {"stability", "longest stable steps beside theory, and runs that break down", bench_stability,
       &stability_picture},
  };
  return i >= 0 && i < (int)(sizeof benches / sizeof *benches) ? &benches[i] : NULL;
}

int is_scene_selected(const bench_options *wishes, const char *scene) {
  for (int i = 0; i < wishes->nscenes; i++)
    if (strcmp(wishes->scenes[i]->name, scene) == 0) return 1;
  return wishes->nscenes == 0;
}
