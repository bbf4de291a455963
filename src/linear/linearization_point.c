#include "linear/linearization_point.h"

msim_status ms_linearization_point_create(const ms_model *model, int has_constraints,
                                          ms_linearization_point *point, msim_error *err) {
  point->x = ms_unknowns_new_vector(model->scene, &model->unknowns);
  if (has_constraints)
    point->constraint = ms_memory_allocate(&model->scene->alloc, (size_t)model->unknowns.nfree,
                                           sizeof *point->constraint);
  if (point->x && (point->constraint || !has_constraints)) return MSIM_OK;
  return ms_error_set_memory(err, "the linear solver");
}

void ms_linearization_point_destroy(const ms_model *model, ms_linearization_point *point) {
  ms_memory_free(&model->scene->alloc, point->x);
  ms_memory_free(&model->scene->alloc, point->constraint);
  *point = (ms_linearization_point){0};
}
