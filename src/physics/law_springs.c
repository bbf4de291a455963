#include "physics/law_springs.h"

#include <math.h>

#include "physics/law_kernels.h"

MS_TABLES(ms_law_kernels);

/*------------------------------------- creation -------------------------------------------------*/

static int is_free(const ms_model *model, int32_t e) {
  const int32_t n = model->unknowns.nfree;
  return model->springs.i[e] < n || model->springs.j[e] < n;
}

static int32_t law_number(const ms_model *model, int32_t e) {
  return is_free(model, e) ? model->scene->law[ms_springs_number(&model->springs, e)] : 0;
}

static int32_t round_up(int32_t n) { return (n + MS_SLICE - 1) / MS_SLICE * MS_SLICE; }

/* The springs by law, in the order of the model within each; slot[e]: that of spring e, -1 */
static void sort_springs(const ms_model *model, int32_t *slot, struct ms_law_springs *s) {
  const ms_springs *springs = &model->springs;
  int32_t next = 0;
  for (int32_t e = 0; e < springs->n; e++) slot[e] = -1;
  for (int32_t law = 1; law <= model->scene->nlaws; law++) {
    const int32_t start = next = round_up(next);
    for (int32_t e = 0; e < springs->n; e++) {
      if (law_number(model, e) != law) continue;
      s->i[next] = springs->i[e], s->j[next] = springs->j[e];
      s->spring[next] = e;
      slot[e] = next++;
    }
    for (int32_t at = start; at < next; at += MS_LAW_BATCH)
      s->run[s->nruns++] = (ms_law_run){&model->scene->laws[law - 1], at,
                                        at + MS_LAW_BATCH < next ? at + MS_LAW_BATCH : next};
  }
}

/* The number of a row's ends; to: NULL, or where to list them */
static int32_t list_row_ends(const ms_model *model, const int32_t *slot, int32_t row,
                             ms_law_end *to) {
  const ms_half_edges *h = &model->half_edges;
  const ms_half_edge_span span = ms_half_edges_of_row(h, row);
  int32_t n = 0;
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t e = h->spring[at];
    if (e < 0 || slot[e] < 0) continue;
    if (to) to[n] = (ms_law_end){slot[e], at, model->springs.i[e] == row ? 1 : -1};
    n++;
  }
  return n;
}

/* The rows that are single, or those that are not */
static void list_rows(const ms_model *model, const int32_t *slot, int single,
                      struct ms_law_springs *s) {
  int32_t n = s->first[s->nrows];
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const int32_t ends = list_row_ends(model, slot, r, NULL);
    if (ends == 0 || (ends == 1 && !ms_half_edges_is_split(&model->half_edges, r)) != single)
      continue;
    n += list_row_ends(model, slot, r, s->end + n);
    s->row[s->nrows++] = r, s->first[s->nrows] = n;
  }
}

static void list_ends(const ms_model *model, const int32_t *slot, struct ms_law_springs *s) {
  list_rows(model, slot, 1, s);
  s->nsingle = s->nrows;
  list_rows(model, slot, 0, s);
}

static int find_in_sweep(const ms_model *model) {
  if (model->half_edges.nparts || model->angles.n) return 0;
  for (int32_t e = 0; e < model->springs.n; e++) {
    const int32_t law = law_number(model, e);
    if (is_free(model, e) && (!law || model->scene->laws[law - 1].given.kind != MSIM_LAW_LINEAR))
      return 0;
  }
  return 1;
}

static int32_t count_springs(const ms_model *model) {
  int32_t n = 0;
  for (int32_t e = 0; e < model->springs.n && model->scene->law; e++) n += law_number(model, e) > 0;
  return n;
}

msim_status ms_law_springs_create(const ms_model *model, struct ms_law_springs **laws,
                                  msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = (size_t)count_springs(model), rows = (size_t)model->unknowns.nfree;
  *laws = NULL;
  if (n == 0) return MSIM_OK;
  const size_t ends = 2 * n, runs = n / MS_LAW_BATCH + (size_t)model->scene->nlaws;
  const size_t slots = n + MS_SLICE * (size_t)model->scene->nlaws;
  int32_t *slot = NULL;
  struct ms_law_springs *s;
  int fits = MS_NEW(alloc, s, 1) != NULL;
  fits = fits && MS_NEW(alloc, slot, model->springs.n) && MS_NEW(alloc, s->run, runs) &&
         MS_NEW(alloc, s->i, slots) && MS_NEW(alloc, s->j, slots) &&
         MS_NEW(alloc, s->spring, slots) && MS_NEW(alloc, s->k, slots) &&
         MS_NEW(alloc, s->rest, slots) &&
         (!model->scene->broken ||
          (MS_NEW(alloc, s->broken, slots) && MS_NEW(alloc, s->limit, slots) &&
           MS_NEW_VECTORS(model->scene, &model->unknowns, &s->seen))) &&
         MS_NEW(alloc, s->scratch, 3 * slots) && MS_NEW(alloc, s->sum, runs) &&
         MS_NEW(alloc, s->row, rows < ends ? rows : ends) &&
         MS_NEW(alloc, s->first, (rows < ends ? rows : ends) + 1) && MS_NEW(alloc, s->end, ends);
  if (fits) {
    s->nslots = (int32_t)slots;
    s->in_sweep = find_in_sweep(model);
    sort_springs(model, slot, s);
    list_ends(model, slot, s);
  }
  ms_memory_free(alloc, slot);
  *laws = s;
  return fits ? MSIM_OK : ms_error_set_memory(err, "the springs with a law");
}

void ms_law_springs_destroy(const ms_scene *scene, struct ms_law_springs *s) {
  if (!s) return;
  MS_FREE(&scene->alloc, s->run, s->i, s->j, s->spring, s->k, s->rest, s->broken, s->limit, s->seen,
          s->scratch, s->sum, s->row, s->first, s->end, s);
}

static void update_spring(const ms_model *model, int32_t slot) {
  struct ms_law_springs *s = model->laws;
  const ms_scene *scene = model->scene;
  const int32_t e = ms_springs_number(&model->springs, s->spring[slot]);
  const int is_broken = ms_scene_is_broken(scene, e);
  s->k[slot] = is_broken ? 0 : scene->k[e], s->rest[slot] = scene->rest[e];
  if (s->broken) s->broken[slot] = (uint8_t)is_broken;
}

void ms_law_springs_update(const ms_model *model) {
  for (int32_t r = 0; r < model->laws->nruns; r++) {
    ms_law_run *run = &model->laws->run[r];
    for (int32_t at = run->begin; at < run->end; at++) update_spring(model, at);
    run->law = ms_scene_law(model->scene,
                            ms_springs_number(&model->springs, model->laws->spring[run->begin]));
  }
  model->laws->has_limits = 0;
}

/*------------------------------------- batches --------------------------------------------------*/

/* A law that does not scale with k would give broken springs a force. */
static void clear_broken(const struct ms_law_springs *s, const ms_law_run *run, ms_law_batch *at) {
  for (int32_t e = 0; e < run->end - run->begin; e++)
    if (s->broken[run->begin + e]) at->force[e] = at->slope[e] = at->energy[e] = 0;
}

/* Measure and evaluate the springs of a run. */
static void evaluate_at(const ms_model *model, const ms_law_run *run, const double *x,
                        ms_law_lengths *to) {
  to->at.only_force = 0;
  ms_law_kernels_of[model->isa]->measure(model, run, x, to);
  ms_law_springs_evaluate(model, run, &to->at);
}

void ms_law_springs_evaluate(const ms_model *model, const ms_law_run *run, ms_law_batch *at) {
  const struct ms_law_springs *s = model->laws;
  ms_law_evaluate(run->law, run->end - run->begin, s->k + run->begin, s->rest + run->begin, at);
  if (s->broken && !run->law->scales) clear_broken(s, run, at);
}

typedef struct law_job {
  const ms_model *model;
  const double *x, *d;
  double h, step; /* of the matrix; of nonlinearity: q = step d */
  int clamp;
  ms_coefficients *a;
} law_job;

/* Rows in a chunk of work: some 5 us. */
enum { ROWS = 256 };

/*------------------------------------- forces ---------------------------------------------------*/

static void compute_run_forces(void *data, int32_t item) {
  const law_job *j = data;
  ms_law_kernels_of[j->model->isa]->forces(j->model, &j->model->laws->run[item], j->x);
}

static void add_row_forces(void *data, int32_t begin, int32_t end) {
  const law_job *j = data;
  ms_law_kernels_of[j->model->isa]->add_forces(j->model, begin, end);
}

void ms_law_springs_add_forces(const ms_model *model, const double *x) {
  law_job j = {.model = model, .x = x};
  ms_pool_run(model->pool, compute_run_forces, &j, model->laws->nruns);
  ms_pool_run_chunks(model->pool, add_row_forces, &j, model->laws->nrows, ROWS);
}

/*------------------------------------- matrix ---------------------------------------------------*/

/* t = h^2 f/l and g = h^2 max(0, f' - f/l)/l^2 */
static void compute_run_matrix(void *data, int32_t item) {
  const law_job *j = data;
  const struct ms_law_springs *s = j->model->laws;
  const ms_law_run *run = &s->run[item];
  const double hh = j->h * j->h;
  double *t = s->scratch + run->begin, *g = t + s->nslots;
  ms_law_lengths at;
  evaluate_at(j->model, run, j->x, &at);
  for (int32_t e = 0; e < run->end - run->begin; e++) {
    const int has_direction = !(at.l2[e] <= MS_MIN_LENGTH2);
    double along = at.at.slope[e];
    double across = has_direction ? at.at.force[e] / at.l[e] : along;
    if (j->clamp) along = fmax(0, along), across = fmax(0, across);
    t[e] = hh * across;
    g[e] = has_direction && along > across ? hh * (along - across) / at.l2[e] : 0;
  }
}

static void add_end_block(const law_job *j, int32_t row, const ms_law_end *end) {
  const ms_model *model = j->model;
  const struct ms_law_springs *s = model->laws;
  const size_t stride = (size_t)model->unknowns.stride, sd = (size_t)model->unknowns.first_pinned;
  const size_t dims = (size_t)model->unknowns.dims;
  const int32_t e = end->slot;
  const double t = s->scratch[e], g = s->scratch[s->nslots + e];
  const double *xi = j->x + s->i[e], *xj = j->x + s->j[e];
  double d[3];
  for (size_t c = 0; c < dims; c++) d[c] = xj[c * stride] - xi[c * stride];
  j->a->t[end->half_edge] += t, j->a->g[end->half_edge] += g;
  for (size_t b = 0; b < dims; b++) {
    j->a->diagonal[b * sd + (size_t)row] += t;
    for (size_t c = b; c < dims; c++)
      j->a->diagonal[ms_coefficients_diagonal_element(dims, b, c) * sd + (size_t)row] +=
          g * d[b] * d[c];
  }
}

static void add_row_matrix(void *data, int32_t begin, int32_t end) {
  const law_job *j = data;
  const struct ms_law_springs *s = j->model->laws;
  for (int32_t r = begin; r < end; r++)
    for (int32_t at = s->first[r]; at < s->first[r + 1]; at++)
      add_end_block(j, s->row[r], &s->end[at]);
}

void ms_law_springs_add_matrix(const ms_model *model, double h, int clamp, ms_coefficients *a) {
  law_job j = {.model = model, .x = a->x, .h = h, .clamp = clamp, .a = a};
  ms_pool_run(model->pool, compute_run_matrix, &j, model->laws->nruns);
  ms_pool_run_chunks(model->pool, add_row_matrix, &j, model->laws->nrows, ROWS);
}

/*------------------------------------- energies -------------------------------------------------*/

static double sum_runs(const law_job *j, ms_pool_item *work) {
  const struct ms_law_springs *s = j->model->laws;
  double sum = 0;
  ms_pool_run(j->model->pool, work, (void *)(uintptr_t)j, s->nruns);
  for (int32_t r = 0; r < s->nruns; r++) sum += s->sum[r];
  return sum;
}

static void sum_run_energies(void *data, int32_t item) {
  const law_job *j = data;
  const ms_law_run *run = &j->model->laws->run[item];
  double sum = 0;
  ms_law_lengths at;
  evaluate_at(j->model, run, j->x, &at);
  for (int32_t e = 0; e < run->end - run->begin; e++) sum += at.at.energy[e];
  j->model->laws->sum[item] = sum;
}

double ms_law_springs_energy(const ms_model *model, const double *x) {
  return sum_runs(&(law_job){.model = model, .x = x}, sum_run_energies);
}

/* For a change of length from l by a + more, where f u.q = f a:
 *   E(l + a + more) - E(l) - f a = integral of (a + more - s) f'(l + s) ds + f more */
typedef struct extension {
  double a, more, whole;
} extension;

/* As half_edge_nonlinearity() of matrix_kernels.c */
static extension find_extension(double l, double a, double across2) {
  const double p2 = across2 > 0 ? across2 : 0, sum = l + a, next = sqrt(sum * sum + p2);
  const double more = sum > 0 ? p2 / (next + sum) : next - sum;
  return (extension){a, more, a + more};
}

static void find_extensions(const law_job *j, const ms_law_run *run, const ms_law_lengths *at,
                            extension *to) {
  const struct ms_law_springs *s = j->model->laws;
  const size_t stride = (size_t)j->model->unknowns.stride;
  for (int32_t e = 0; e < run->end - run->begin; e++) {
    const double l = at->l2[e] > MS_MIN_LENGTH2 ? at->l[e] : 0;
    const double *from = j->d + s->i[run->begin + e], *ahead = j->d + s->j[run->begin + e];
    double dot = 0, q2 = 0;
    for (size_t c = 0; c < (size_t)j->model->unknowns.dims; c++) {
      const double by = j->step * (ahead[c * stride] - from[c * stride]);
      dot += at->d[c][e] * by, q2 += by * by;
    }
    const double a = l > 0 ? dot / l : 0;
    to[e] = find_extension(l, a, q2 - a * a);
  }
}

static double share_of(const ms_model *model, int32_t slot) {
  const int32_t ends[2] = {model->laws->i[slot], model->laws->j[slot]};
  return ms_unknowns_own_share(&model->unknowns, 2, ends);
}

/* Small extensions by Gauss's rule of 3 points for the integral, where the difference of energies
 * has fewer than half its digits; it is exact for polynomials f of degree up to 5. */
static void sum_run_nonlinearity(void *data, int32_t item) {
  static const double node[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
  static const double weight[3] = {5. / 18, 4. / 9, 5. / 18};
  const law_job *j = data;
  const ms_law_run *run = &j->model->laws->run[item];
  const int32_t n = run->end - run->begin;
  ms_law_lengths at;
  extension by[MS_LAW_BATCH];
  double integral[MS_LAW_BATCH] = {0}, sum = 0;
  evaluate_at(j->model, run, j->x, &at);
  find_extensions(j, run, &at, by);
  ms_law_batch moved = {.only_force = 0};
  for (int i = 0; i < 3; i++) {
    for (int32_t e = 0; e < n; e++) moved.stretch[e] = at.at.stretch[e] + node[i] * by[e].whole;
    ms_law_springs_evaluate(j->model, run, &moved);
    for (int32_t e = 0; e < n; e++)
      integral[e] += weight[i] * (1 - node[i]) * by[e].whole * by[e].whole * moved.slope[e];
  }
  for (int32_t e = 0; e < n; e++) moved.stretch[e] = at.at.stretch[e] + by[e].whole;
  ms_law_springs_evaluate(j->model, run, &moved);
  for (int32_t e = 0; e < n; e++) {
    const double linear = at.at.force[e] * by[e].whole;
    const double difference = moved.energy[e] - at.at.energy[e] - linear;
    const double size = fabs(moved.energy[e]) + fabs(at.at.energy[e]) + fabs(linear);
    const double along = fabs(difference) > 1e-8 * size ? difference : integral[e];
    sum += share_of(j->model, run->begin + e) * (at.at.force[e] * by[e].more + along);
  }
  j->model->laws->sum[item] = sum;
}

double ms_law_springs_nonlinearity(const ms_model *model, const double *x, const double *d,
                                   double s) {
  return sum_runs(&(law_job){.model = model, .x = x, .d = d, .step = s}, sum_run_nonlinearity);
}
