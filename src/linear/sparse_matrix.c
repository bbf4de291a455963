#include "linear/sparse_matrix.h"

#include <stdlib.h>
#include <string.h>

#include "base/simd.h"
#include "physics/angle_springs.h"

/*------------------------------------- graph ----------------------------------------------------*/

static int compare_indices(const void *a, const void *b) {
  int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
  return (x > y) - (x < y);
}

/* The column of row j of a vector; -1: pinned */
static int32_t column_of(const ms_unknowns *rows, int32_t j) {
  if (j < rows->nfree) return j;
  return j >= rows->first_fixed ? -1 : rows->nfree + j - rows->first_pinned;
}

/* Add the neighbours of row r by angular springs to those in [begin, end), all ascending, each
 * once. Returns the end. */
static int32_t merge_corners(const ms_model *model, int32_t r, int32_t begin, int32_t end,
                             int32_t *ind) {
  const ms_angles *g = &model->angles;
  int32_t to = begin, next = end;
  if (g->n == 0) return end;
  for (int32_t at = g->of.first[r]; at < g->of.first[r + 1]; at++)
    for (int c = 0; c < 3; c++) {
      const int32_t other = column_of(&model->unknowns, g->row[g->of.item[at] / 3 * 3 + c]);
      if (other != r && other >= 0) ind[next++] = other;
    }
  if (next == end) return end;
  qsort(ind + begin, (size_t)(next - begin), sizeof *ind, compare_indices);
  for (int32_t at = begin; at < next; at++)
    if (at == begin || ind[at] != ind[to - 1]) ind[to++] = ind[at];
  return to;
}

msim_status ms_sparse_matrix_create_graph(const ms_model *model, ms_sparse_graph *graph,
                                          msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const ms_half_edges *half_edges = &model->half_edges;
  const int32_t n = model->unknowns.nfree;
  *graph = (ms_sparse_graph){.n = n};
  if (!MS_NEW(alloc, graph->ptr, (size_t)n + 1) ||
      !MS_NEW(alloc, graph->ind, 2 * (size_t)model->springs.n + 6 * (size_t)model->angles.n))
    return ms_error_set_memory(err, "the graph of the springs");
  for (int32_t r = 0; r < n; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(half_edges, r);
    int32_t to = graph->ptr[r], last = -1;
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      const int32_t j = column_of(&model->unknowns, ms_half_edges_neighbour(half_edges, at));
      if (half_edges->spring[at] < 0 || j < 0 || j == last) continue;
      graph->ind[to++] = last = j;
    }
    graph->ptr[r + 1] = merge_corners(model, r, graph->ptr[r], to, graph->ind);
  }
  return MSIM_OK;
}

void ms_sparse_matrix_destroy_graph(const ms_model *model, ms_sparse_graph *graph) {
  MS_FREE(&model->scene->alloc, graph->ptr, graph->ind);
  *graph = (ms_sparse_graph){0};
}

/*------------------------------------- pattern --------------------------------------------------*/

/* List the block columns of block row k, in the order of the matrix: the diagonal, and neighbours
 * that the format stores. */
static int32_t list_block_row(const ms_sparse_graph *g, const int32_t *order,
                              const int32_t *position, int32_t format, int32_t k,
                              int32_t *columns) {
  int32_t count = 0, row = order[k];
  columns[count++] = k;
  for (int32_t e = g->ptr[row]; e < g->ptr[row + 1]; e++) {
    int32_t column = position[g->ind[e]];
    if (format == MSIM_FORMAT_FULL || column > k) columns[count++] = column;
  }
  qsort(columns, (size_t)count, sizeof *columns, compare_indices);
  return count;
}

static void write_scalar_pattern(ms_sparse_matrix *m) {
  const int32_t size = m->block;
  for (int32_t k = 0; k < m->n; k++) {
    int32_t first = m->graphptr[k], blocks = m->graphptr[k + 1] - first;
    for (int32_t q = 0; q < size; q++) {
      int32_t at = size * (size * first + blocks * q);
      m->rowptr[size * k + q] = at;
      for (int32_t b = 0; b < blocks; b++)
        for (int32_t c = 0; c < size; c++) m->colind[at++] = size * m->graphind[first + b] + c;
    }
  }
  m->rowptr[size * m->n] = size * size * m->graphptr[m->n];
}

/* Offset in val of the block at (row, column), which must be in the pattern. */
static int32_t find_block_offset(const ms_sparse_matrix *m, int32_t row, int32_t column) {
  int32_t low = m->graphptr[row], high = m->graphptr[row + 1] - 1;
  while (low < high) {
    int32_t middle = low + (high - low) / 2;
    if (m->graphind[middle] < column) low = middle + 1;
    else high = middle;
  }
  return m->block * (m->block * m->graphptr[row] + low - m->graphptr[row]);
}

/* 1 if the block of this half-edge is stored. UPPER stores that of the end that comes first. */
static int is_stored(const ms_model *model, const int32_t *position, const ms_sparse_matrix *m,
                     int32_t r, int32_t at) {
  const int32_t j = column_of(&model->unknowns, ms_half_edges_neighbour(&model->half_edges, at));
  return model->half_edges.spring[at] >= 0 && j >= 0 &&
         (m->format == MSIM_FORMAT_FULL || position[r] < position[j]);
}

/* Offsets in val of the diagonal block of each unknown, and of the blocks of its half-edges */
static void find_block_offsets(const ms_model *model, const int32_t *position,
                               ms_sparse_matrix *m) {
  for (int32_t r = 0; r < m->n; r++) {
    m->row_offset[r] = m->block * m->block * m->graphptr[position[r]];
    m->diagonal_offset[r] = find_block_offset(m, position[r], position[r]);
    m->row_step[r] = m->block * (m->graphptr[position[r] + 1] - m->graphptr[position[r]]);
    m->first[r + 1] = m->first[r];
    const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, r);
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      if (!is_stored(model, position, m, r, at)) continue;
      const int32_t column =
          position[column_of(&model->unknowns, ms_half_edges_neighbour(&model->half_edges, at))];
      m->entry[m->first[r + 1]++] =
          (struct ms_sparse_entry){at, ms_half_edges_neighbour(&model->half_edges, at),
                                   find_block_offset(m, position[r], column)};
    }
  }
}

/* Likewise, of the pairs of corners of angular springs */
static void find_angle_offsets(const ms_model *model, const int32_t *position,
                               ms_sparse_matrix *m) {
  const ms_angles *g = &model->angles;
  for (int32_t at = 0; at < 9 * g->n; at++) {
    const int32_t *corner = g->row + at / 9 * 3, r = corner[at % 9 / 3];
    const int32_t c = column_of(&model->unknowns, corner[at % 3]);
    const int stored = r != c && r < m->n && c >= 0 &&
                       (m->format == MSIM_FORMAT_FULL || position[r] < position[c]);
    m->angle_offset[at] = stored ? find_block_offset(m, position[r], position[c]) : -1;
  }
}

static msim_status count_blocks(const ms_sparse_graph *g, const ms_sparse_matrix *m,
                                int64_t *blocks, msim_error *err) {
  const int32_t off_diagonal = g->ptr[g->n], limit = INT32_MAX / (m->block * m->block);
  *blocks = (int64_t)g->n + (m->format == MSIM_FORMAT_FULL ? off_diagonal : off_diagonal / 2);
  if (*blocks <= limit) return MSIM_OK;
  return ms_error_set(
      err, MSIM_ERR_ARG,
      "the matrix has %lld blocks of %d x %d scalars, more than the limit of %d; use solver = pcg",
      (long long)*blocks, m->block, m->block, limit);
}

static int allocate_matrix(const ms_model *model, size_t blocks, ms_sparse_matrix *m) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = (size_t)m->n, size = (size_t)m->block;
  const size_t half_edges = m->format == MSIM_FORMAT_FULL ? 2 : 1; /* half-edges per spring */
  return MS_NEW(alloc, m->order, n) && MS_NEW(alloc, m->graphptr, n + 1) &&
         MS_NEW(alloc, m->graphind, blocks) && MS_NEW(alloc, m->rowptr, size * n + 1) &&
         MS_NEW(alloc, m->colind, size * size * blocks) &&
         MS_NEW(alloc, m->val, size * size * blocks) && MS_NEW(alloc, m->row_offset, n) &&
         MS_NEW(alloc, m->diagonal_offset, n) && MS_NEW(alloc, m->row_step, n) &&
         MS_NEW(alloc, m->first, n + 1) &&
         MS_NEW(alloc, m->entry, half_edges * (size_t)model->springs.n) &&
         MS_NEW(alloc, m->angle_offset, 9 * (size_t)model->angles.n);
}

msim_status ms_sparse_matrix_create(const ms_model *model, const ms_sparse_graph *graph,
                                    ms_sparse_layout layout, ms_sparse_matrix *matrix,
                                    msim_error *err) {
  int64_t blocks;
  *matrix = (ms_sparse_matrix){.n = graph->n, .format = layout.format, .block = layout.block};
  msim_status status = count_blocks(graph, matrix, &blocks, err);
  if (status) return status;
  const int32_t nghosts = model->unknowns.first_fixed - model->unknowns.first_pinned;
  int32_t *position = NULL;
  if (!MS_NEW(&model->scene->alloc, position, (size_t)graph->n + (size_t)nghosts) ||
      !allocate_matrix(model, (size_t)blocks, matrix)) {
    ms_memory_free(&model->scene->alloc, position);
    return ms_error_set_memory(err, "the matrix");
  }
  for (int32_t k = 0; k < graph->n; k++) {
    matrix->order[k] = layout.order ? layout.order[k] : k;
    position[matrix->order[k]] = k;
  }
  for (int32_t g = graph->n; g < graph->n + nghosts; g++) position[g] = g;
  for (int32_t k = 0; k < graph->n; k++)
    matrix->graphptr[k + 1] =
        matrix->graphptr[k] + list_block_row(graph, matrix->order, position, layout.format, k,
                                             matrix->graphind + matrix->graphptr[k]);
  write_scalar_pattern(matrix);
  find_block_offsets(model, position, matrix);
  find_angle_offsets(model, position, matrix);
  ms_memory_free(&model->scene->alloc, position);
  return MSIM_OK;
}

void ms_sparse_matrix_destroy(const ms_model *model, ms_sparse_matrix *m) {
  if (!model->scene) return; /* the creation of the sim failed before that of the model */
  MS_FREE(&model->scene->alloc, m->order, m->graphptr, m->graphind, m->rowptr, m->colind, m->val,
          m->row_offset, m->diagonal_offset, m->row_step, m->first, m->entry, m->angle_offset);
  *m = (ms_sparse_matrix){0};
}

/*------------------------------------- values ---------------------------------------------------*/

/* Rows in a chunk of work: some 20 us; a multiple of the rows that are prefetched at a time. */
enum { CHUNK = 512 };

/* Consecutive unknowns may lie far apart in val, on pages of their own. Prefetch for rows after r:
 * far ahead a number of each block row, many at a time, so that the processor translates several
 * addresses at once; nearer all lines of one. */
MS_INLINE void prefetch_block_rows(const ms_sparse_matrix *m, int32_t r) {
  enum { FAR = 64, NEAR = 16 }; /* rows */
  for (int32_t q = r + FAR; r % FAR == 0 && q < r + 2 * FAR && q < m->n; q++)
    ms_simd_prefetch(m->val + m->row_offset[q], 1, 0);
  if (r + NEAR >= m->n) return;
  const double *from = m->val + m->row_offset[r + NEAR];
  const size_t n = (size_t)(m->block * m->row_step[r + NEAR]);
  ms_simd_prefetch(from, n * sizeof *from, 0);
  ms_simd_prefetch(from + n - 1, 1, 0);
}

/* Two consecutive numbers of a row */
typedef double pair __attribute__((vector_size(16)));

/* A symmetric block: the rows xx xy, xy yy and xz yz, which is a column, too */
typedef struct symmetric_block {
  pair x, y, z;
  double zz;
} symmetric_block;

static inline void store_pair(double *to, pair v) { memcpy(to, &v, sizeof v); }

MS_INLINE void write_block(double *at, int32_t step, symmetric_block b, int32_t size) {
  if (size == 1) {
    at[0] = b.x[0];
    return;
  }
  store_pair(at, b.x);
  store_pair(at + step, b.y);
  if (size == 2) return;
  at[2] = b.z[0];
  at[step + 2] = b.z[1];
  store_pair(at + 2 * step, b.z);
  at[2 * step + 2] = b.zz;
}

MS_INLINE symmetric_block load_diagonal(const ms_coefficients *a, size_t stride, size_t r,
                                        int32_t size) {
  const double *e = a->diagonal + r;
  if (size == 1) return (symmetric_block){.x = {e[0], 0}};
  if (size == 2)
    return (symmetric_block){.x = {e[0], e[2 * stride]}, .y = {e[2 * stride], e[stride]}};
  return (symmetric_block){.x = {e[0], e[3 * stride]},
                           .y = {e[3 * stride], e[stride]},
                           .z = {e[4 * stride], e[5 * stride]},
                           .zz = e[2 * stride]};
}

/* b - (t I + g d d^T) */
MS_INLINE symmetric_block subtract_spring(symmetric_block b, double t, double g, pair d, double dz,
                                          int32_t size) {
  b.x = b.x - g * (d[0] * d) - (pair){t, 0};
  if (size == 1) return b;
  b.y = b.y - g * (d[1] * d) - (pair){0, t};
  b.z = b.z - g * (dz * d);
  b.zz = b.zz - g * (dz * dz) - t;
  return b;
}

typedef struct assembly_job {
  const ms_model *model;
  const ms_coefficients *a;
  const ms_sparse_matrix *matrix;
} assembly_job;

/* Each block of the pattern belongs to a spring, unless there are angular ones: all values are
 * written, and val is not cleared first. Springs that share a block are consecutive, as half-edges
 * are sorted by neighbour. */
MS_INLINE void assemble_rows(const assembly_job *job, int32_t begin, int32_t end, int32_t size) {
  const ms_sparse_matrix m = *job->matrix; /* copies, which stores to val cannot change */
  const ms_coefficients a = *job->a;
  const ms_unknowns *rows = &job->model->unknowns;
  const size_t stride = (size_t)rows->stride, sd = (size_t)rows->first_pinned;
  const double *x = a.x, *y = size > 1 ? x + stride : x, *z = size > 2 ? y + stride : x;
  for (int32_t r = begin; r < end; r++) {
    const int32_t step = m.row_step[r], last = m.first[r + 1];
    const pair own = size > 1 ? (pair){x[r], y[r]} : (pair){0};
    const double own_z = size > 2 ? z[r] : 0;
    prefetch_block_rows(&m, r);
    write_block(m.val + m.diagonal_offset[r], step, load_diagonal(&a, sd, (size_t)r, size), size);
    for (int32_t e = m.first[r]; e < last;) {
      const int32_t offset = m.entry[e].offset;
      symmetric_block b = {0};
      do {
        const int32_t at = m.entry[e].half_edge, j = m.entry[e].neighbour;
        const pair d = size > 1 ? (pair){x[j], y[j]} - own : own;
        b = subtract_spring(b, a.t[at], size > 1 ? a.g[at] : 0, d, size > 2 ? z[j] - own_z : 0,
                            size);
      } while (++e < last && m.entry[e].offset == offset);
      write_block(m.val + offset, step, b, size);
    }
  }
}

static void assemble_chunk(void *data, int32_t begin, int32_t end) {
  const assembly_job *job = data;
  if (job->matrix->block == 3) assemble_rows(job, begin, end, 3);
  else if (job->matrix->block == 2) assemble_rows(job, begin, end, 2);
  else assemble_rows(job, begin, end, 1);
}

static void add_block(double *at, int32_t step, double sign, int32_t size, double block[3][3]) {
  for (int32_t r = 0; r < size; r++, at += step)
    for (int32_t c = 0; c < size; c++) at[c] += sign * block[r][c];
}

/* Off-diagonal blocks of angular springs, to blocks of springs or to blocks of 0 */
static void add_angle_blocks(const ms_model *model, const ms_coefficients *a,
                             const ms_sparse_matrix *m) {
  const int32_t *offset = m->angle_offset;
  for (int32_t e = 0; e < model->angles.n; e++) {
    double element[MS_ANGLE_ELEMENT], block[3][3];
    ms_angle_springs_get_element(a, e, element);
    for (int at = 0; at < 9; at++, offset++) {
      if (*offset < 0) continue;
      ms_angle_block(element, at / 3, at % 3, block);
      add_block(m->val + *offset, m->row_step[model->angles.row[3 * e + at / 3]], 1, m->block,
                block);
    }
  }
}

void ms_sparse_matrix_assemble(const ms_model *model, const ms_coefficients *a,
                               ms_sparse_matrix *m) {
  const size_t size = (size_t)m->block * (size_t)m->block;
  if (model->angles.n) memset(m->val, 0, size * (size_t)m->graphptr[m->n] * sizeof *m->val);
  ms_pool_run_chunks(model->pool, assemble_chunk, &(assembly_job){model, a, m}, m->n, CHUNK);
  add_angle_blocks(model, a, m);
}

void ms_sparse_matrix_add_damping_derivative(const ms_model *model, const ms_damping_derivative *t,
                                             ms_sparse_matrix *m) {
  for (int32_t r = 0; r < m->n; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, r);
    const int32_t step = m->row_step[r];
    int32_t e = m->first[r];
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      const int is_stored = e < m->first[r + 1] && m->entry[e].half_edge == at;
      double block[3][3];
      if (ms_damping_derivative_block(model, t, r, at, block)) {
        add_block(m->val + m->diagonal_offset[r], step, 1, m->block, block);
        if (is_stored) add_block(m->val + m->entry[e].offset, step, -1, m->block, block);
      }
      e += is_stored;
    }
  }
}

void ms_sparse_matrix_pack(const ms_model *model, const ms_sparse_matrix *matrix, const double *vec,
                           double *packed) {
  const size_t stride = (size_t)model->unknowns.stride, block = (size_t)matrix->block;
  const size_t n = (size_t)matrix->n, apart = block == 1 ? n : 1;
  for (size_t c = 0; c < (size_t)model->unknowns.dims; c++)
    for (size_t k = 0; k < n; k++)
      packed[block * k + c * apart] = vec[c * stride + (size_t)matrix->order[k]];
}

void ms_sparse_matrix_unpack(const ms_model *model, const ms_sparse_matrix *matrix,
                             const double *packed, double *vec) {
  const size_t stride = (size_t)model->unknowns.stride, block = (size_t)matrix->block;
  const size_t n = (size_t)matrix->n, apart = block == 1 ? n : 1;
  for (size_t c = 0; c < (size_t)model->unknowns.dims; c++)
    for (size_t k = 0; k < n; k++)
      vec[c * stride + (size_t)matrix->order[k]] = packed[block * k + c * apart];
}
