#include "benches.h"

const bench_entry *bench_info(int i) {
  static const bench_entry benches[] = {
      {"linear", "one linearly implicit step by every solver, beside the libraries out of the box",
       bench_linear},
      {"forces", "explicit steps, beside a plain loop over the springs and the speed of memory",
       bench_forces},
      {"scaling", "steps as scenes grow", NULL},
      {"skip", "what leaving out saves, beside CHOLMOD in every step", bench_skip},
      {"step", "nonlinear implicit steps", NULL},
      {"precision", "error against work", NULL},
      {"stability", "the longest stable steps", NULL},
  };
  return i >= 0 && i < (int)(sizeof benches / sizeof *benches) ? &benches[i] : NULL;
}
