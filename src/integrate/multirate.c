#include "integrate/multirate.h"

#include "integrate/stiffness_partition.h"

/*------------------------------------- the two models -------------------------------------------*/

/* Arrays needed during creation */
typedef struct creation_lists {
  int *stiffness_class;   /* springs.n: their stiffness classes (stiffness_partition.h) */
  int32_t *soft, *stiff;  /* springs.n: numbers of springs in the scene */
  int32_t *free, *pinned; /* nparticles: particles at stiff springs */
  int32_t *row;           /* nparticles */
  int32_t nsoft, nstiff, nfree, npinned;
} creation_lists;

static msim_status lists_create(const ms_model *model, creation_lists *l, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = (size_t)model->springs.n, particles = (size_t)model->scene->nparticles;
  *l = (creation_lists){0};
  const int fits = MS_NEW(alloc, l->stiffness_class, n) && MS_NEW(alloc, l->soft, n) &&
                   MS_NEW(alloc, l->stiff, n) && MS_NEW(alloc, l->free, particles) &&
                   MS_NEW(alloc, l->pinned, particles) && MS_NEW(alloc, l->row, particles);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the multirate split");
}

static void lists_destroy(const ms_model *model, creation_lists *l) {
  MS_FREE(&model->scene->alloc, l->stiffness_class, l->soft, l->stiff, l->free, l->pinned, l->row);
}

static void classify_springs(const ms_model *model, const ms_stiffness_partition *partition,
                             creation_lists *l) {
  const ms_scene *scene = model->scene;
  const ms_springs *s = &model->springs;
  for (int32_t e = 0; e < s->n; e++) {
    const int32_t spring = ms_springs_number(s, e), *ends = scene->ij + 2 * (size_t)spring;
    if (l->stiffness_class[e] < partition->stiffness_class) {
      l->soft[l->nsoft++] = spring;
      continue;
    }
    l->stiff[l->nstiff++] = spring;
    l->row[ends[0]] = l->row[ends[1]] = 1; /* a mark; overwritten by make_multirate_models() */
  }
  for (int32_t p = 0; p < scene->nparticles; p++) {
    if (!l->row[p]) continue;
    if (scene->pinned[p]) l->pinned[l->npinned++] = p;
    else l->free[l->nfree++] = p;
  }
}

static msim_status make_multirate_models(const ms_model *model, uint32_t skip_off,
                                         creation_lists *l, ms_multirate *split, msim_error *err) {
  const ms_island rest = {.nsprings = l->nsoft, .spring = l->soft, .row_scratch = l->row};
  const ms_island island = {.nfree = l->nfree,
                            .npinned = l->npinned,
                            .nsprings = l->nstiff,
                            .free = l->free,
                            .pinned = l->pinned,
                            .spring = l->stiff,
                            .row_scratch = l->row};
  msim_status status = ms_model_create_subset(model, &rest, skip_off, &split->soft, err);
  if (!status)
    status = ms_model_create_island(model->scene, &island, model->unknowns.dropped_axis, skip_off,
                                    &split->stiff, err);
  if (status) return status;
  ms_model_keep_springs_only(&split->stiff);
  split->stiff.pool = model->pool;
  const ms_unknowns *rows = &split->stiff.unknowns;
  if (!MS_NEW(&model->scene->alloc, split->row, rows->nfree))
    return ms_error_set_memory(err, "the multirate split");
  ms_unknowns_find_rows(&model->unknowns, l->row);
  for (int32_t r = 0; r < rows->nfree; r++) split->row[r] = l->row[rows->particle[r]];
  return MSIM_OK;
}

/*------------------------------------- the stepper ----------------------------------------------*/

/* Creates the vectors of a stepper for velocity Verlet, with the pinned positions in x, x_next. */
static msim_status make_inner_stepper(const msim_options *opt, double h, ms_multirate *split,
                                      msim_error *err) {
  ms_stepper *s = &split->stepper;
  const ms_scene *scene = split->stiff.scene;
  *s = (ms_stepper){.model = &split->stiff, .opt = opt, .h = h / split->inner};
  if (!MS_NEW_VECTORS(scene, &split->stiff.unknowns, &s->x, &s->x_next, &s->v, &s->v_next,
                      &s->work[0], &s->work[1], &s->work[2]))
    return ms_error_set_memory(err, "the multirate split");
  ms_unknowns_gather(&split->stiff.unknowns, scene->x, s->x);
  ms_unknowns_gather(&split->stiff.unknowns, scene->x, s->x_next);
  return MSIM_OK;
}

void ms_multirate_gather(const ms_multirate *split, ms_shape shape, const double *from,
                         double *to) {
  const ms_shape own = split->stiff.shape;
  for (int32_t c = 0; c < own.dims; c++)
    for (int32_t r = 0; r < own.n; r++)
      to[(size_t)c * (size_t)own.stride + (size_t)r] =
          from[(size_t)c * (size_t)shape.stride + (size_t)split->row[r]];
}

void ms_multirate_scatter(const ms_multirate *split, ms_shape shape, const double *from,
                          double *to) {
  const ms_shape own = split->stiff.shape;
  for (int32_t c = 0; c < own.dims; c++)
    for (int32_t r = 0; r < own.n; r++)
      to[(size_t)c * (size_t)shape.stride + (size_t)split->row[r]] =
          from[(size_t)c * (size_t)own.stride + (size_t)r];
}

/*------------------------------------- creation -------------------------------------------------*/

static msim_status build_multirate(const ms_model *model, const msim_options *opt, double h,
                                   creation_lists *l, ms_multirate **split, msim_error *err) {
  ms_stiffness_partition partition;
  msim_status status = ms_stiffness_partition_choose(model, h, l->stiffness_class, &partition, err);
  if (status || partition.nstiff == 0) return status;
  if (!MS_NEW(&model->scene->alloc, *split, 1))
    return ms_error_set_memory(err, "the multirate split");
  (*split)->inner = partition.inner;
  classify_springs(model, &partition, l);
  status = make_multirate_models(model, opt->skip_off, l, *split, err);
  return status ? status : make_inner_stepper(opt, h, *split, err);
}

msim_status ms_multirate_create(const ms_model *model, const msim_options *opt, double h,
                                ms_multirate **split, msim_error *err) {
  creation_lists l;
  *split = NULL;
  msim_status status = lists_create(model, &l, err);
  if (!status) status = build_multirate(model, opt, h, &l, split, err);
  lists_destroy(model, &l);
  if (!status) return MSIM_OK;
  ms_multirate_destroy(model, *split);
  *split = NULL;
  return status;
}

void ms_multirate_destroy(const ms_model *model, ms_multirate *split) {
  if (!split) return;
  const ms_stepper *s = &split->stepper;
  ms_model_destroy_subset(&split->soft);
  ms_model_destroy(&split->stiff);
  MS_FREE(&model->scene->alloc, s->x, s->x_next, s->v, s->v_next, s->work[0], s->work[1],
          s->work[2], split->row, split);
}
