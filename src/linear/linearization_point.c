#include "linear/linearization_point.h"

msim_status ms_linearization_point_create(const ms_model *model, int has_constraints,
                                          ms_linearization_point *point, msim_error *err) {
  if (MS_NEW_VECTORS(model->scene, &model->unknowns, &point->x) &&
      (!has_constraints || MS_NEW(&model->scene->alloc, point->constraint, model->unknowns.nfree)))
    return MSIM_OK;
  return ms_error_set_memory(err, "the linear solver");
}

void ms_linearization_point_destroy(const ms_model *model, ms_linearization_point *point) {
  MS_FREE(&model->scene->alloc, point->x, point->constraint);
  *point = (ms_linearization_point){0};
}
