#include "rig.h"

#include <math.h>

const char *rig_options;

/*------------------------------------- pattern --------------------------------------------------*/

/* coupled[n i + j]: 1 if the block (i, j) or (j, i) has an entry, and on the diagonal. */
static uint8_t *find_coupled(const problem *p) {
  const size_t n = (size_t)p->n;
  uint8_t *coupled = calloc(n * n + 1, 1);
  for (int32_t e = 0; e < p->count; e++) {
    const size_t i = (size_t)(p->entries[e].row / p->block);
    const size_t j = (size_t)(p->entries[e].column / p->block);
    coupled[n * i + j] = coupled[n * j + i] = 1;
  }
  for (size_t i = 0; i < n; i++) coupled[n * i + i] = 1;
  return coupled;
}

/* Rows of the graph, in an order: all couplings; or without the diagonal; or without the lower
 * triangle. ind: space for n^2. */
enum { ALL, OFF_DIAGONAL, UPPER };

static void list_rows(int32_t n, const uint8_t *coupled, const int32_t *order, int which,
                      int32_t *ptr, int32_t *ind) {
  ptr[0] = 0;
  for (int32_t k = 0; k < n; k++) {
    ptr[k + 1] = ptr[k];
    for (int32_t l = which == UPPER ? k : 0; l < n; l++)
      if (coupled[n * order[k] + order[l]] && !(which == OFF_DIAGONAL && k == l))
        ind[ptr[k + 1]++] = l;
  }
}

/* The scalar pattern: each block of the graph in full. */
static void expand_pattern(rig *r, int32_t m) {
  int32_t at = 0;
  for (int32_t row = 0; row < m * r->problem->n; row++) {
    r->rowptr[row] = at;
    for (int32_t e = r->graphptr[row / m]; e < r->graphptr[row / m + 1]; e++)
      for (int32_t c = 0; c < m; c++) r->colind[at++] = m * r->graphind[e] + c;
  }
  r->rowptr[m * r->problem->n] = at;
}

static int32_t *ints(size_t count) { return malloc((count + 1) * sizeof(int32_t)); }

static void build_matrix(rig *r, const uint8_t *coupled) {
  const problem *p = r->problem;
  const size_t n = (size_t)p->n, m = (size_t)p->block;
  r->graphptr = ints(n), r->graphind = ints(n * n);
  list_rows(p->n, coupled, r->order, r->A.format == MSIM_FORMAT_UPPER ? UPPER : ALL, r->graphptr,
            r->graphind);
  const size_t blocks = (size_t)r->graphptr[n];
  r->rowptr = ints(m * n), r->colind = ints(m * m * blocks);
  expand_pattern(r, p->block);
  r->val = aligned_alloc(64, (m * m * blocks * sizeof(double) + 64) / 64 * 64);
  r->A.graphptr = r->graphptr, r->A.graphind = r->graphind;
  r->A.rowptr = r->rowptr, r->A.colind = r->colind, r->A.val = r->val;
}

/*------------------------------------- without a matrix -----------------------------------------*/

/* Position of the unknown i of the problem in the vectors of the backend. */
static size_t place(const rig *r, int32_t i) {
  const int32_t m = r->problem->block;
  if (r->A.format == MSIM_FORMAT_NONE) return (size_t)(i % m * r->A.stride + i / m);
  return (size_t)(m * r->order[r->problem->n + i / m] + i % m);
}

static size_t length(const rig *r) {
  return (size_t)(r->A.block * (r->A.format == MSIM_FORMAT_NONE ? r->A.stride : r->A.n));
}

static void apply(const msim_system *A, const double *x, double *y) {
  const rig *r = A->data;
  memset(y, 0, length(r) * sizeof *y);
  for (int32_t e = 0; e < r->problem->count; e++) {
    const entry *a = &r->problem->entries[e];
    const size_t row = place(r, a->row), column = place(r, a->column);
    y[row] += (a->value + a->skew) * x[column];
    if (row != column) y[column] += (a->value - a->skew) * x[row];
  }
}

static void precondition(const msim_system *A, const double *x, double *z) {
  const rig *r = A->data;
  const int32_t m = A->block;
  if (z != x) memset(z, 0, length(r) * sizeof *z);
  for (int32_t i = 0; i < A->n; i++) {
    const double *inverse = r->inverse + m * m * i;
    double sum[3] = {0};
    for (int32_t c = 0; c < m; c++)
      for (int32_t d = 0; d < m; d++) sum[c] += inverse[m * c + d] * x[d * A->stride + i];
    for (int32_t c = 0; c < m; c++) z[c * A->stride + i] = sum[c];
  }
}

/*------------------------------------- creation and destruction ---------------------------------*/

static void begin(rig *r) {
  r->host.sentence[0] = '\0';
  r->info = (msim_solve_info){.size = sizeof r->info};
  if (r->on_call) r->on_call(1);
}

/* Checks that apply to every call. */
static msim_status end(rig *r, const char *call, msim_status status) {
  if (r->on_call) r->on_call(0);
  if (status < 0 && status != MSIM_ERR_MEMORY && !r->host.sentence[0])
    fail_msg("%s: status %d without an error message", call, (int)status);
  r->fill = fmax(r->fill, r->info.fill);
  r->flops = fmax(r->flops, r->info.flops);
  return status;
}

/* r->order: the block rows in the order of the backend, then the position of each in that order. */
static msim_status ask_order(rig *r, const uint8_t *coupled) {
  const int32_t n = r->problem->n;
  int32_t *position = r->order + n;
  for (int32_t k = 0; k < n; k++) r->order[k] = position[k] = k;
  if (r->table->order) {
    int32_t *ptr = ints((size_t)n), *ind = ints((size_t)n * (size_t)n);
    list_rows(n, coupled, position, OFF_DIAGONAL, ptr, ind);
    begin(r);
    const msim_status status = end(r, "order", r->table->order(r->self, n, ptr, ind, r->order));
    free(ptr), free(ind);
    if (status) return status;
  }
  for (int32_t k = 0; k < n; k++) position[k] = -1;
  for (int32_t k = 0; k < n; k++) {
    const int32_t row = r->order[k];
    if (row < 0 || row >= n || position[row] >= 0)
      fail_msg("order[%d] = %d is out of range or repeated", k, row);
    position[row] = k;
  }
  return MSIM_OK;
}

void rig_init(rig *r, const msim_backend *table, const problem *p) {
  *r = (rig){.table = table, .problem = p};
  host_init(&r->host);
  r->order = ints(2 * (size_t)p->n);
  r->A = (msim_system){.size = sizeof r->A,
                       .n = p->n,
                       .block = p->block,
                       .format = table->format,
                       .stride = (p->n + 15) / 8 * 8,
                       .apply = apply,
                       .precondition = precondition,
                       .two_level = table->flags & MSIM_BACKEND_TWO_LEVEL ? precondition : NULL,
                       .data = r};
}

/* The options of the instance, and the format that it chooses with them */
static msim_status set_options(rig *r, const char *options) {
  msim_status status = MSIM_OK;
  begin(r);
  if (options) status = r->table->set_options(r->self, options);
  if (!status && r->table->choose_format) r->A.format = r->table->choose_format(r->self);
  return end(r, "set_options", status);
}

msim_status rig_create(rig *r) {
  const problem *p = r->problem;
  begin(r);
  msim_status status = end(r, "create", r->table->create(&r->host.host, &r->self));
  if (!status) status = set_options(r, rig_options);
  if (status) return status;
  uint8_t *coupled = find_coupled(p);
  status = ask_order(r, coupled);
  if (!status && r->A.format != MSIM_FORMAT_NONE) build_matrix(r, coupled);
  if (!status && r->A.format == MSIM_FORMAT_NONE)
    r->inverse = malloc((size_t)(p->block * p->block * p->n) * sizeof(double) + 1);
  free(coupled);
  if (!status) rig_set(r, p);
  return status;
}

msim_status rig_analyze(rig *r) {
  begin(r);
  return end(r, "analyze", r->table->analyze(r->self, &r->A, &r->info));
}

msim_status rig_open(rig *r, const msim_backend *table, const problem *p) {
  rig_init(r, table, p);
  const msim_status status = rig_create(r);
  return status ? status : rig_analyze(r);
}

void rig_close(rig *r) {
  begin(r);
  if (r->self) r->table->destroy(r->self);
  end(r, "destroy", MSIM_OK);
  void *arrays[] = {r->order, r->graphptr, r->graphind, r->rowptr, r->colind, r->val, r->inverse};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
  if (r->host.live != 0) fail_msg("%d blocks of memory were not freed", r->host.live);
}

/*------------------------------------- calls ----------------------------------------------------*/

/* val at (row, column), if the format stores it */
static void put(rig *r, size_t row, size_t column, double value) {
  for (int32_t e = r->rowptr[row]; e < r->rowptr[row + 1]; e++)
    if (r->colind[e] == (int32_t)column) r->val[e] += value;
}

void rig_set(rig *r, const problem *p) {
  r->problem = p;
  if (!r->val) return;
  memset(r->val, 0, (size_t)r->rowptr[unknowns(p)] * sizeof *r->val);
  for (int32_t e = 0; e < p->count; e++) {
    const size_t row = place(r, p->entries[e].row), column = place(r, p->entries[e].column);
    put(r, row, column, p->entries[e].value + p->entries[e].skew);
    if (row != column) put(r, column, row, p->entries[e].value - p->entries[e].skew);
  }
}

msim_status rig_factor(rig *r, int32_t kind) {
  if (r->inverse) problem_invert_blocks(r->problem, r->inverse);
  begin(r);
  return end(r, "factor", r->table->factor(r->self, &r->A, kind, &r->info));
}

msim_status rig_solve(rig *r, double rtol, int32_t max_iterations, int32_t nrhs, const double *b,
                      double *y) {
  const msim_solve_params params = {sizeof params, rtol, max_iterations};
  const int32_t n = unknowns(r->problem);
  const size_t columns = nrhs > 0 ? (size_t)nrhs : 0, all = columns * length(r);
  double *packed = calloc(2 * all + 1, sizeof *packed), *answer = packed + all;
  for (size_t k = 0; k < columns; k++)
    for (int32_t i = 0; i < n; i++) {
      packed[k * length(r) + place(r, i)] = b[k * (size_t)n + (size_t)i];
      answer[k * length(r) + place(r, i)] = y[k * (size_t)n + (size_t)i];
    }
  begin(r);
  const msim_status status =
      end(r, "solve", r->table->solve(r->self, &r->A, &params, nrhs, packed, answer, &r->info));
  for (size_t k = 0; k < columns; k++)
    for (int32_t i = 0; i < n; i++)
      y[k * (size_t)n + (size_t)i] = answer[k * length(r) + place(r, i)];
  free(packed);
  return status;
}
