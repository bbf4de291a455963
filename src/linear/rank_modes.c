#include "linear/rank_modes.h"

#include <math.h>
#include <string.h>

#include "physics/angle_springs.h"
#include "physics/rank_model.h"

enum { WEIGHTS = 4 };

/*------------------------------------- creation -------------------------------------------------*/

/* Center and half the extent of the unknowns of each rank in the scene */
typedef struct frame {
  double low[3], high[3];
} frame;

static void measure_frames(const ms_model *model, frame *frames) {
  const ms_scene *s = model->scene;
  const ms_rank_part *part = model->rank_model->part;
  for (int32_t r = 0; r < part->ranks->n; r++)
    for (int c = 0; c < 3; c++) frames[r].low[c] = INFINITY, frames[r].high[c] = -INFINITY;
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (part->owner[p] < 0) continue;
    frame *f = &frames[part->owner[p]];
    for (int c = 0; c < 3; c++) {
      f->low[c] = fmin(f->low[c], s->x[3 * (size_t)p + (size_t)c]);
      f->high[c] = fmax(f->high[c], s->x[3 * (size_t)p + (size_t)c]);
    }
  }
}

static void set_weights(ms_rank_modes *q, const frame *frames) {
  const ms_unknowns *rows = &q->model->unknowns;
  for (int32_t r = 0; r < rows->first_fixed; r++) {
    const int32_t p = rows->particle[r];
    if (p < 0) continue;
    const frame *f = &frames[q->rank[r] = q->model->rank_model->part->owner[p]];
    double extent = 0;
    for (int c = 0; c < 3; c++) extent = fmax(extent, f->high[c] - f->low[c]);
    q->weight[WEIGHTS * (size_t)r] = 1;
    for (int32_t c = 0; c < rows->dims && extent > 0; c++) {
      const int32_t axis = rows->axis[c];
      const double x = q->model->scene->x[3 * (size_t)p + (size_t)axis];
      q->weight[WEIGHTS * (size_t)r + (size_t)c + 1] =
          (2 * x - f->low[axis] - f->high[axis]) / extent;
    }
  }
}

msim_status ms_rank_modes_create(const ms_model *model, ms_rank_modes **modes, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const ms_ranks *ranks = model->shape.ranks;
  const size_t rows = (size_t)model->unknowns.first_fixed;
  frame *frames = NULL;
  *modes = NULL;
  if (!ranks) return MSIM_OK;
  ms_rank_modes *q = *modes = ms_memory_allocate(alloc, 1, sizeof *q);
  if (!q) return ms_error_set_memory(err, "the modes of the ranks");
  q->model = model;
  q->block = model->unknowns.dims * (1 + model->unknowns.dims);
  q->n = q->block * ranks->n, q->own = q->block * ranks->rank;
  const size_t n = (size_t)q->n, block = (size_t)q->block;
  const int fits = MS_NEW(alloc, q->rank, rows) && MS_NEW(alloc, q->weight, WEIGHTS * rows) &&
                   MS_NEW(alloc, q->rows, block * n) && MS_NEW(alloc, q->factor, n * n) &&
                   MS_NEW(alloc, q->message, block + 1) &&
                   MS_NEW(alloc, q->messages, n + (size_t)ranks->n) && MS_NEW(alloc, q->z, n) &&
                   MS_NEW(alloc, frames, ranks->n);
  if (fits) {
    measure_frames(model, frames);
    set_weights(q, frames);
  }
  ms_memory_free(alloc, frames);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the modes of the ranks");
}

void ms_rank_modes_destroy(const msim_allocator *alloc, ms_rank_modes *q) {
  if (q) MS_FREE(alloc, q->rank, q->weight, q->rows, q->factor, q->message, q->messages, q->z, q);
}

/*------------------------------------- the matrix -----------------------------------------------*/

/* Rows of this rank += (weights of row i) block (weights of row j) */
static void add_block(ms_rank_modes *q, int32_t i, int32_t j, double block[3][3]) {
  const int32_t dims = q->model->unknowns.dims, modes = 1 + dims;
  const double *wi = q->weight + WEIGHTS * (size_t)i, *wj = q->weight + WEIGHTS * (size_t)j;
  for (int32_t b = 0; b < dims; b++)
    for (int32_t c = 0; c < dims; c++)
      for (int32_t k = 0; k < modes; k++) {
        double *to = q->rows + (size_t)(modes * b + k) * (size_t)q->n +
                     (size_t)(q->block * q->rank[j] + modes * c);
        for (int32_t l = 0; l < modes; l++) to[l] += wi[k] * block[b][c] * wj[l];
      }
}

static void get_diagonal_block(const ms_model *model, const ms_coefficients *a, double by,
                               int32_t row, double block[3][3]) {
  const size_t sd = (size_t)model->unknowns.first_pinned, dims = (size_t)model->unknowns.dims;
  for (size_t b = 0; b < dims; b++)
    for (size_t c = 0; c < dims; c++) {
      const size_t at = a->block == 1 ? 0 : ms_coefficients_diagonal_element(dims, b, c);
      block[b][c] = a->block == 1 && b != c ? 0 : by * a->diagonal[at * sd + (size_t)row];
    }
}

/* -(t I + g d d^T) of a half-edge of row i (force.h) */
static void get_spring_block(const ms_model *model, const ms_coefficients *a, double by, int32_t i,
                             int32_t at, double block[3][3]) {
  const size_t stride = (size_t)model->unknowns.stride, dims = (size_t)model->unknowns.dims;
  const size_t j = (size_t)model->half_edges.neighbour[at];
  double d[3] = {0};
  for (size_t c = 0; c < dims && a->block > 1; c++)
    d[c] = a->x[c * stride + j] - a->x[c * stride + (size_t)i];
  for (size_t b = 0; b < dims; b++)
    for (size_t c = 0; c < dims; c++)
      block[b][c] = -by * ((b == c ? a->t[at] : 0) + (a->block > 1 ? a->g[at] * d[b] * d[c] : 0));
}

static void add_row(ms_rank_modes *q, const ms_coefficients *a, double by, int32_t i) {
  const ms_half_edge_span span = ms_half_edges_of_row(&q->model->half_edges, i);
  double block[3][3];
  get_diagonal_block(q->model, a, by, i, block);
  add_block(q, i, i, block);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t j = q->model->half_edges.neighbour[at];
    if (q->model->half_edges.spring[at] < 0 || j >= q->model->unknowns.first_fixed) continue;
    get_spring_block(q->model, a, by, i, at, block);
    add_block(q, i, j, block);
  }
}

/* Off-diagonal blocks of angular springs between corners, the first at an own unknown */
static void add_angle(ms_rank_modes *q, const ms_coefficients *a, double by, int32_t e) {
  const int32_t *row = q->model->angles.row + 3 * (size_t)e;
  double block[3][3], element[MS_ANGLE_ELEMENT];
  ms_angle_springs_get_element(a, e, element);
  for (int32_t b = 0; b < 3; b++)
    for (int32_t c = 0; c < 3; c++) {
      if (b == c || row[b] >= q->model->unknowns.nfree) continue;
      if (row[c] >= q->model->unknowns.first_fixed) continue;
      ms_angle_block(element, b, c, block);
      for (int k = 0; k < 9; k++) block[k / 3][k % 3] *= by;
      add_block(q, row[b], row[c], block);
    }
}

/* L L^T by rows; a pivot that rounding errors may have left is infinite: its unknown is 0. */
static void factor_matrix(ms_rank_modes *q) {
  const double LITTLE = 1e-10;
  const size_t n = (size_t)q->n;
  double *l = q->factor;
  for (size_t i = 0; i < n; i++)
    for (size_t j = 0; j <= i; j++) {
      const double whole = l[n * i + j];
      double sum = whole;
      for (size_t k = 0; k < j; k++) sum -= l[n * i + k] * l[n * j + k];
      if (i > j) l[n * i + j] = sum / l[n * j + j];
      else l[n * i + i] = sum > LITTLE * whole ? sqrt(sum) : INFINITY;
    }
}

void ms_rank_modes_factor(ms_rank_modes *q, const ms_coefficients *a, double by) {
  const size_t bytes = (size_t)q->block * (size_t)q->n * sizeof *q->rows;
  memset(q->rows, 0, bytes);
  for (int32_t i = 0; i < q->model->unknowns.nfree; i++) add_row(q, a, by, i);
  for (int32_t e = 0; e < q->model->angles.n; e++) add_angle(q, a, by, e);
  ms_ranks_gather(q->model->shape.ranks, (int64_t)bytes, q->rows, q->factor);
  factor_matrix(q);
  q->is_ready = 1;
}

/*------------------------------------- solving --------------------------------------------------*/

/* message = share and Q^T r */
static void restrict_residual(ms_rank_modes *q, double share, const double *r) {
  const ms_unknowns *rows = &q->model->unknowns;
  const int32_t modes = 1 + rows->dims;
  memset(q->message, 0, (size_t)(q->block + 1) * sizeof *q->message);
  q->message[0] = share;
  for (int32_t c = 0; c < rows->dims; c++) {
    const double *from = r + (size_t)c * (size_t)rows->stride;
    double *to = q->message + 1 + modes * c;
    for (int32_t i = 0; i < rows->nfree; i++)
      for (int32_t k = 0; k < modes; k++)
        to[k] += q->weight[WEIGHTS * (size_t)i + (size_t)k] * from[i];
  }
}

static void add_correction(const ms_rank_modes *q, double *z) {
  const ms_unknowns *rows = &q->model->unknowns;
  const int32_t modes = 1 + rows->dims;
  for (int32_t c = 0; c < rows->dims; c++) {
    const double *by = q->z + q->own + modes * c;
    double *to = z + (size_t)c * (size_t)rows->stride;
    for (int32_t i = 0; i < rows->nfree; i++)
      for (int32_t k = 0; k < modes; k++)
        to[i] += q->weight[WEIGHTS * (size_t)i + (size_t)k] * by[k];
  }
}

/* z = (L L^T)^-1 b, b in the messages. Returns b.z. */
static double solve_modes(ms_rank_modes *q) {
  const size_t n = (size_t)q->n, block = (size_t)q->block;
  const double *l = q->factor;
  double sum = 0;
  for (size_t i = 0; i < n; i++) {
    double y = q->messages[i + i / block + 1];
    for (size_t k = 0; k < i; k++) y -= l[n * i + k] * q->z[k];
    q->z[i] = y / l[n * i + i];
    sum += q->z[i] * q->z[i];
  }
  for (size_t i = n; i-- > 0;) {
    for (size_t k = i + 1; k < n; k++) q->z[i] -= l[n * k + i] * q->z[k];
    q->z[i] /= l[n * i + i];
  }
  return sum;
}

double ms_rank_modes_solve(ms_rank_modes *q, double share, const double *r, double *z) {
  ms_ranks *ranks = q->model->shape.ranks;
  const size_t length = (size_t)q->block + 1;
  restrict_residual(q, share, r);
  ms_ranks_gather(ranks, (int64_t)(length * sizeof *q->message), q->message, q->messages);
  if (ranks->failed) return NAN;
  double sum = solve_modes(q);
  for (size_t k = 0; k < (size_t)ranks->n; k++) sum += q->messages[length * k];
  add_correction(q, z);
  return sum;
}
