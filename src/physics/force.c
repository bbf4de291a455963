#include "physics/force.h"

#include "physics/step.h"

void ms_force(const ms_model *model, const double *x, const double *v, double *f) {
  ms_pass_run(model, &(ms_pass){.x = x, .v = v, .f = f});
}
