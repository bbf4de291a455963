/* adapter - makes a backend of the plugin ABI (msim/backend.h) a linear solver of linear.h */
#include <string.h>

#include "linear/jacobi.h"
#include "linear/linear.h"
#include "linear/backends.h"
#include "linear/iteration_estimate.h"
#include "physics/rank_model.h"

typedef struct adapter {
  ms_linear base;
  const msim_backend *table;
  void *backend;
  int32_t format;
  ms_plugin_host host;
  ms_sparse_matrix matrix;
  msim_system view;
  double *b, *y;    /* in the order of the matrix; NULL with MSIM_FORMAT_NONE */
  double *x;        /* positions at creation, in that order; NULL: not passed on */
  int64_t *ghost;   /* numbers of the ghosts in the whole system; NULL: one process */
  ms_jacobi jacobi; /* with MSIM_FORMAT_NONE; else empty */
  ms_linear *pcg;   /* with MSIM_BACKEND_TWO_LEVEL besides, for its preconditioner; else NULL */
  double *work;     /* likewise, where blocks are scalar: a vector of all components */
} adapter;

/* Pass on the backend's status and message. A status that backends must not return becomes
 * MSIM_ERR_BACKEND. */
static msim_status convert_backend_status(adapter *self, msim_status status, msim_error *err) {
  switch (status) {
    case MSIM_OK:
      return MSIM_OK;
    case MSIM_NOT_SPD:
    case MSIM_NOT_CONVERGED:
    case MSIM_ERR_ARG:
    case MSIM_ERR_MEMORY:
    case MSIM_ERR_BACKEND:
      return ms_plugin_fail(&self->host, self->table->name, status, err);
    default:
      self->host.base.fail(
          &self->host.base,
          "returned status %d, which is not one that a backend may return (see msim/backend.h)",
          (int)status);
      return ms_plugin_fail(&self->host, self->table->name, MSIM_ERR_BACKEND, err);
  }
}

/* The status of all ranks that share the system */
static msim_status agree_on_backend_status(adapter *self, msim_status status, msim_error *err) {
  status = convert_backend_status(self, status, err);
  return ms_ranks_agree(self->base.system->model->shape.ranks, status, err);
}

/* Set padding and pinned particles to 0. */
static void clear_padding(const ms_unknowns *rows, int32_t components, double *y) {
  const size_t n = (size_t)rows->nfree, stride = (size_t)rows->stride;
  for (size_t c = 0; c < (size_t)components; c++)
    memset(y + c * stride + n, 0, (stride - n) * sizeof *y);
}

/* msim_system.apply. Padding is zero on input and on output. */
static void adapter_apply(const msim_system *view, const double *x, double *y) {
  const adapter *self = view->data;
  const ms_linear_system *s = self->base.system;
  if (view->block == 1) ms_coefficients_apply_component(s->model, &s->a, x, y);
  else ms_linear_system_apply(s, x, y);
  clear_padding(&s->model->unknowns, view->block, y);
}

static void adapter_precondition(const msim_system *view, const double *r, double *z) {
  const adapter *self = view->data;
  if (z != r) memset(z, 0, (size_t)(view->block * view->stride) * sizeof *z);
  ms_jacobi_apply(self->base.system->model, &self->jacobi, view->block, r, z);
}

/* Where blocks are scalar, components are independent: the others stay 0. */
static void adapter_precondition_by_two_levels(const msim_system *view, const double *r,
                                               double *z) {
  const adapter *self = view->data;
  double *all = self->work ? self->work : z;
  if (all != r) memcpy(all, r, (size_t)(view->block * view->stride) * sizeof *all);
  self->pcg->ops->precondition(self->pcg, all, all);
  if (all != z) memcpy(z, all, (size_t)(view->block * view->stride) * sizeof *z);
}

/* 1 if order contains each of [0, n) exactly once. seen: n zeros. */
static int is_permutation(int32_t n, const int32_t *order, uint8_t *seen) {
  for (int32_t k = 0; k < n; k++)
    if (order[k] < 0 || order[k] >= n || seen[order[k]]++) return 0;
  return 1;
}

/* The order of the block rows that the backend returns; NULL: that of the unknowns. */
static msim_status get_backend_order(adapter *self, const ms_sparse_graph *graph, int32_t **order,
                                     msim_error *err) {
  const msim_allocator *alloc = &self->base.system->model->scene->alloc;
  *order = NULL;
  if (!self->table->order) return MSIM_OK;
  const size_t n = (size_t)graph->n;
  uint8_t *seen = NULL;
  msim_status status = MS_NEW(alloc, *order, n) && MS_NEW(alloc, seen, n)
                           ? MSIM_OK
                           : ms_error_set_memory(err, "the order of the matrix");
  if (!status)
    status = convert_backend_status(
        self, self->table->order(self->backend, graph->n, graph->ptr, graph->ind, *order), err);
  if (!status && !is_permutation(graph->n, *order, seen))
    status = ms_error_set(err, MSIM_ERR_BACKEND,
                          "solver '%s': order() did not return a permutation of the %d block rows; "
                          "report this to the author of the plugin",
                          self->table->name, graph->n);
  ms_memory_free(alloc, seen);
  return status;
}

static msim_status build_matrix(adapter *self, msim_error *err) {
  const ms_model *model = self->base.system->model;
  const msim_allocator *alloc = &model->scene->alloc;
  ms_sparse_graph graph = {0};
  int32_t *order = NULL;
  msim_status status = ms_sparse_matrix_create_graph(model, &graph, err);
  if (!status) status = get_backend_order(self, &graph, &order, err);
  const ms_sparse_layout layout = {self->format, self->base.system->a.block, order};
  if (!status) status = ms_sparse_matrix_create(model, &graph, layout, &self->matrix, err);
  ms_memory_free(alloc, order);
  ms_sparse_matrix_destroy_graph(model, &graph);
  return status;
}

/* The number of this rank's first block row in the whole system */
static int64_t first_block_row(const ms_model *model) {
  const ms_rank_part *part = model->rank_model->part;
  int64_t first = 0;
  for (int32_t r = 0; r < part->ranks->rank; r++) first += ms_rank_part_count(part, r);
  return first;
}

static int32_t count_ghosts(const ms_model *model) {
  return model->unknowns.first_fixed - model->unknowns.first_pinned;
}

static msim_status adapter_analyze(adapter *self, msim_error *err) {
  const ms_model *model = self->base.system->model;
  ms_sparse_matrix *m = &self->matrix;
  const ms_ranks *ranks = model->shape.ranks;
  self->view = (msim_system){.size = sizeof self->view,
                             .n = model->unknowns.nfree,
                             .block = self->base.system->a.block,
                             .format = self->format,
                             .stride = model->unknowns.stride,
                             .graphptr = m->graphptr,
                             .graphind = m->graphind,
                             .rowptr = m->rowptr,
                             .colind = m->colind,
                             .val = m->val,
                             .apply = adapter_apply,
                             .precondition = self->jacobi.inverse ? adapter_precondition : NULL,
                             .data = self,
                             .x = self->x,
                             .comm = ranks ? ranks->comm : NULL,
                             .first = ranks ? first_block_row(model) : 0,
                             .nghosts = self->ghost ? count_ghosts(model) : 0,
                             .ghost = self->ghost,
                             .two_level = self->pcg ? adapter_precondition_by_two_levels : NULL};
  msim_solve_info info = {.size = sizeof info};
  msim_status status = self->table->analyze(self->backend, &self->view, &info);
  self->base.analyses = self->format != MSIM_FORMAT_NONE;
  self->base.fill = info.fill;
  self->base.flops = info.flops;
  return convert_backend_status(self, status, err);
}

/* The numbers of ghosts are those of their owners, exact as doubles. */
static msim_status number_ghosts(adapter *self, msim_error *err) {
  const ms_model *model = self->base.system->model;
  const ms_unknowns *rows = &model->unknowns;
  ms_ranks *ranks = model->shape.ranks;
  const size_t nghosts = (size_t)count_ghosts(model);
  double *number = ms_unknowns_new_vector(model->scene, rows);
  msim_status status = number && MS_NEW(&model->scene->alloc, self->ghost, nghosts)
                           ? MSIM_OK
                           : ms_error_set_memory(err, "the linear solver");
  status = ms_ranks_agree(ranks, status, err);
  for (int32_t k = 0; k < rows->nfree && !status; k++)
    number[self->matrix.order[k]] = (double)(first_block_row(model) + k);
  if (!status) ms_rank_model_refresh_components(model, 1, number);
  for (size_t g = 0; g < nghosts && !status; g++)
    self->ghost[g] = (int64_t)number[(size_t)rows->first_pinned + g];
  ms_memory_free(&model->scene->alloc, number);
  return status;
}

static msim_status adapter_connect(ms_linear *base, msim_error *err) {
  adapter *self = (adapter *)base;
  msim_status status = self->matrix.val ? number_ghosts(self, err) : MSIM_OK;
  if (!status && self->pcg) status = self->pcg->ops->connect(self->pcg, err);
  if (!status)
    status = ms_ranks_agree(base->system->model->shape.ranks, adapter_analyze(self, err), err);
  return status;
}

static void adapter_expand(ms_linear *base) {
  adapter *self = (adapter *)base;
  const ms_linear_system *s = base->system;
  if (!self->matrix.val) return;
  ms_sparse_matrix_assemble(s->model, &s->a, &self->matrix);
  if (s->damping_derivative.v)
    ms_sparse_matrix_add_damping_derivative(s->model, &s->damping_derivative, &self->matrix);
}

/* Each matrix gets its own coarse factor, so that solutions do not depend on matrices before. */
static msim_status update_preconditioners(adapter *self, int32_t kind, msim_error *err) {
  const ms_linear_system *s = self->base.system;
  if (!self->jacobi.inverse) return MSIM_OK;
  const msim_status status = ms_ranks_agree(
      s->model->shape.ranks, ms_jacobi_invert(s->model, &s->a, kind, &self->jacobi), err);
  if (status || !self->pcg) return status;
  self->pcg->ops->restart(self->pcg);
  return self->pcg->ops->factor(self->pcg, kind, err);
}

static msim_status adapter_factor(ms_linear *base, int32_t kind, msim_error *err) {
  adapter *self = (adapter *)base;
  msim_solve_info info = {.size = sizeof info};
  msim_status status = update_preconditioners(self, kind, err);
  if (status) return status;
  status = self->table->factor(self->backend, &self->view, kind, &info);
  if (!status && kind == MSIM_FACTOR_SPD && info.definite == MSIM_DEFINITE_NOT)
    status = MSIM_NOT_SPD;
  return agree_on_backend_status(self, status, err);
}

static msim_status adapter_solve(ms_linear *base, const ms_linear_target *target, const double *b,
                                 double *y, int64_t *iterations, msim_error *err) {
  adapter *self = (adapter *)base;
  const ms_model *model = base->system->model;
  const msim_solve_params params = {sizeof params, target->rtol, target->max_iterations};
  msim_solve_info info = {.size = sizeof info};
  if (self->b) {
    ms_sparse_matrix_pack(model, &self->matrix, b, self->b);
    if (!base->factorizes) ms_sparse_matrix_pack(model, &self->matrix, y, self->y);
  }
  msim_status status = self->table->solve(self->backend, &self->view, &params,
                                          model->unknowns.dims / self->view.block,
                                          self->b ? self->b : b, self->b ? self->y : y, &info);
  /* backends of MSIM_FORMAT_NONE can write there */
  if (!self->b) clear_padding(&model->unknowns, model->unknowns.dims, y);
  else if (status == MSIM_OK || status == MSIM_NOT_CONVERGED)
    ms_sparse_matrix_unpack(model, &self->matrix, self->y, y);
  if (info.iterations > 0) *iterations += info.iterations;
  return agree_on_backend_status(self, status, err);
}

static msim_status adapter_substitute(ms_linear *base, int32_t n, double *const *b,
                                      double *const *y, double *room, msim_error *err) {
  const double FINE = 1e-12;
  adapter *self = (adapter *)base;
  const ms_model *model = base->system->model;
  const size_t length = (size_t)model->unknowns.dims * (size_t)model->unknowns.nfree;
  const msim_solve_params params = {sizeof params, FINE, 1};
  msim_solve_info info = {.size = sizeof info};
  double *solution = room + (size_t)n * length;
  for (int32_t i = 0; i < n; i++)
    ms_sparse_matrix_pack(model, &self->matrix, b[i], room + (size_t)i * length);
  const msim_status status =
      self->table->solve(self->backend, &self->view, &params,
                         n * (model->unknowns.dims / self->view.block), room, solution, &info);
  for (int32_t i = 0; i < n && !status; i++)
    ms_sparse_matrix_unpack(model, &self->matrix, solution + (size_t)i * length, y[i]);
  return agree_on_backend_status(self, status, err);
}

static void adapter_destroy(ms_linear *base) {
  if (!base) return;
  adapter *self = (adapter *)base;
  const ms_model *model = base->system->model;
  if (self->backend) self->table->destroy(self->backend);
  ms_sparse_matrix_destroy(model, &self->matrix);
  ms_jacobi_destroy(model, &self->jacobi);
  if (self->pcg) self->pcg->ops->destroy(self->pcg);
  MS_FREE(&model->scene->alloc, self->b, self->y, self->x, self->ghost, self->work, self);
}

static void adapter_set_model(ms_linear *base) {
  adapter *self = (adapter *)base;
  if (self->pcg) self->pcg->ops->set_model(self->pcg);
}

static int takes_options(const msim_backend *table) {
  const size_t least = offsetof(msim_backend, set_options) + sizeof table->set_options;
  return table->size >= least && table->set_options;
}

static msim_status choose_format(adapter *self, msim_error *err) {
  const msim_backend *table = self->table;
  const size_t least = offsetof(msim_backend, choose_format) + sizeof table->choose_format;
  self->format = table->format;
  if (table->size >= least && table->choose_format)
    self->format = table->choose_format(self->backend);
  if (self->format >= MSIM_FORMAT_NONE && self->format <= MSIM_FORMAT_FULL) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_BACKEND,
                      "solver '%s': choose_format() returned %d, which is no format of "
                      "msim/backend.h; report this to the author of the plugin",
                      table->name, self->format);
}

/* Positions in the order of the matrix, for backends that may make rigid-body modes of them. */
static msim_status pack_positions(adapter *self, msim_error *err) {
  const ms_model *model = self->base.system->model;
  const ms_scene *scene = model->scene;
  const size_t length = (size_t)model->unknowns.dims * (size_t)model->unknowns.nfree;
  double *x = ms_unknowns_new_vector(scene, &model->unknowns);
  const int allocated = x && MS_NEW(&scene->alloc, self->x, length);
  if (allocated) {
    ms_unknowns_gather(&model->unknowns, scene->x, x);
    ms_sparse_matrix_pack(model, &self->matrix, x, self->x);
  }
  ms_memory_free(&scene->alloc, x);
  return allocated ? MSIM_OK : ms_error_set_memory(err, "the linear solver");
}

static msim_status create_matrix(adapter *self, msim_error *err) {
  const ms_model *model = self->base.system->model;
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t length = (size_t)model->unknowns.dims * (size_t)model->unknowns.nfree;
  const msim_status status = build_matrix(self, err);
  if (status) return status;
  if (!(MS_NEW(alloc, self->b, length) && MS_NEW(alloc, self->y, length)))
    return ms_error_set_memory(err, "the linear solver");
  const int has_modes = !self->base.factorizes && self->base.system->a.block > 1;
  return has_modes ? pack_positions(self, err) : MSIM_OK;
}

/* Without a matrix */
static msim_status create_preconditioners(adapter *self, const msim_options *opt, msim_error *err) {
  const ms_linear_system *s = self->base.system;
  const ms_unknowns *rows = &s->model->unknowns;
  const msim_status status = ms_jacobi_create(s->model, &s->a, &self->jacobi, err);
  if (status || !(self->table->flags & MSIM_BACKEND_TWO_LEVEL)) return status;
  if (s->a.block < rows->dims && !MS_NEW_VECTORS(s->model->scene, rows, &self->work))
    return ms_error_set_memory(err, "the linear solver");
  return ms_pcg_create(s, opt, (ms_coarse_size){.aggregate = MS_AGGREGATE}, &self->pcg, err);
}

static msim_status adapter_set_up(adapter *self, const msim_options *opt, const char *options,
                                  msim_error *err) {
  const ms_model *model = self->base.system->model;
  msim_status status =
      convert_backend_status(self, self->table->create(&self->host.base, &self->backend), err);
  if (!status && !self->backend)
    status = ms_error_set(err, MSIM_ERR_BACKEND,
                          "solver '%s': create() returned MSIM_OK but no instance; report this to "
                          "the author of the plugin",
                          self->table->name);
  if (!status && options)
    status = convert_backend_status(self, self->table->set_options(self->backend, options), err);
  if (!status) status = choose_format(self, err);
  self->base.substitutes = self->base.factorizes && self->format != MSIM_FORMAT_NONE;
  if (!status)
    status = self->format == MSIM_FORMAT_NONE ? create_preconditioners(self, opt, err)
                                              : create_matrix(self, err);
  return status || model->shape.ranks ? status : adapter_analyze(self, err);
}

msim_status ms_adapter_create(const ms_linear_system *system, const char *name,
                              const msim_options *opt, ms_linear **linear, msim_error *err) {
  static const ms_linear_ops ops = {.connect = adapter_connect,
                                    .expand = adapter_expand,
                                    .factor = adapter_factor,
                                    .solve = adapter_solve,
                                    .substitute = adapter_substitute,
                                    .set_model = adapter_set_model,
                                    .destroy = adapter_destroy};
  const msim_allocator *alloc = &system->model->scene->alloc;
  const msim_backend *table;
  *linear = NULL;
  msim_status status = ms_backends_find(name, opt, alloc, &table, err);
  if (status) return status;
  const char *options = strcmp(name, opt->solver) == 0 ? opt->solver_options : NULL;
  if (options && !takes_options(table)) return ms_backends_refuse_options(name, err);
  adapter *self = ms_memory_allocate(alloc, 1, sizeof *self);
  if (!self) return ms_error_set_memory(err, "the linear solver");
  self->base = (ms_linear){.ops = &ops,
                           .system = system,
                           .name = table->name,
                           .symmetric = (table->flags & MSIM_BACKEND_SYMMETRIC) != 0,
                           .unsymmetric = (table->flags & MSIM_BACKEND_UNSYMMETRIC) &&
                                          table->format != MSIM_FORMAT_UPPER,
                           .factorizes = !(table->flags & MSIM_BACKEND_ITERATIVE)};
  self->table = table;
  ms_plugin_init_host(&self->host, alloc);
  status = adapter_set_up(self, opt, options, err);
  if (status) adapter_destroy(&self->base);
  else *linear = &self->base;
  return status;
}
