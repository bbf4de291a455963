#include "physics/force.h"

#include "physics/fused_step.h"

void ms_force_compute(const ms_model *model, const double *x, const double *v, double *f) {
  ms_fused_step_run(model, &(ms_fused_step){.x = x, .v = v, .f = f});
}
