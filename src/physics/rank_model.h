/* rank_model - what joins a rank's model with those of the other ranks: its ghosts, and the springs
 * whose energy another rank counts */
#ifndef MS_RANK_MODEL_H
#define MS_RANK_MODEL_H

#include "layout/halo.h"
#include "physics/model.h"

/* A spring between two ranks belongs to the model of both. Its energy counts at the owner of its
 * first free end, that of an angular spring at the owner of its first free corner. */
struct ms_rank_model {
  const ms_rank_part *part; /* of the sim */
  ms_halo *halo;
  int32_t nsprings, nangles;
  int32_t *spring, *angle; /* those that count elsewhere, of model->springs and model->angles */
};

/* Connect the model with those of the other ranks, which get the same features; collective. After
 * an error it may be there, and ms_model_destroy destroys it. */
msim_status ms_rank_model_connect(ms_model *model, const ms_rank_part *part, msim_error *err);
/* After features were found anew; collective. */
void ms_rank_model_share_features(ms_model *model);
void ms_rank_model_destroy(const ms_scene *scene, struct ms_rank_model *m);

/* The ghosts of x, and of v if it is not NULL, become what their owners have; collective. */
static inline void ms_rank_model_refresh(const ms_model *model, const double *x, const double *v) {
  if (model->rank_model) /* x and v are vectors of a stepper or solver */
    ms_halo_refresh(model->rank_model->halo, model->unknowns.dims, model->unknowns.stride,
                    (double *)(uintptr_t)x, (double *)(uintptr_t)v);
}

/* The same for a vector of floats */
static inline void ms_rank_model_refresh_floats(const ms_model *model, float *x) {
  if (model->rank_model)
    ms_halo_refresh_floats(model->rank_model->halo, model->unknowns.dims, model->unknowns.stride,
                           x);
}

/* The same for a vector of so many components */
static inline void ms_rank_model_refresh_components(const ms_model *model, int32_t components,
                                                    const double *x) {
  if (model->rank_model)
    ms_halo_refresh(model->rank_model->halo, components, model->unknowns.stride,
                    (double *)(uintptr_t)x, NULL);
}

/* The ranks of the model; NULL: one process */
static inline ms_ranks *ms_rank_model_ranks(const ms_model *model) {
  return model->rank_model ? model->rank_model->halo->ranks : NULL;
}

/* 1: pins may move, of any rank */
static inline int ms_rank_model_may_have_motions(const ms_model *model) {
  return model->pins || (model->rank_model && model->scene->nmotions > 0);
}

/* 1: it is so on any rank. Collective */
static inline int ms_rank_model_any(const ms_model *model, int is_so) {
  double any = is_so;
  ms_ranks_maximum(ms_rank_model_ranks(model), 1, &any);
  return any > 0;
}

/* The sum over all ranks. Collective */
static inline double ms_rank_model_sum(const ms_model *model, double own) {
  ms_ranks_sum(ms_rank_model_ranks(model), 1, &own);
  return own;
}

/* The same; `own` after a failure of the communicator */
static inline int64_t ms_rank_model_count(const ms_model *model, int64_t own) {
  const double sum = ms_rank_model_sum(model, (double)own);
  return sum >= 0 ? (int64_t)sum : own;
}

/* The elastic energy at x of springs that count elsewhere; 0 in one process */
double ms_rank_model_foreign_energy(const ms_model *model, const double *x);

#endif
