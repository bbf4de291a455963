#include "linear/compression.h"

#include <math.h>
#include <string.h>

#include "base/ranks.h"

enum { CHUNK = 128 }; /* slice ranges in a chunk of work */

msim_status ms_compression_create(const ms_model *model, ms_compression *c, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const ms_half_edges *half_edges = &model->half_edges;
  const int32_t ranges = ms_half_edges_count_ranges(half_edges);
  *c = (ms_compression){.model = model};
  const int fits = MS_NEW(alloc, c->reduction, MS_SLICE * (size_t)half_edges->nentries) &&
                   MS_NEW(alloc, c->largest, ms_pool_count_chunks(ranges, CHUNK) + 1);
  return fits ? MSIM_OK : ms_error_set_memory(err, "conjugate gradients");
}

void ms_compression_destroy(ms_compression *c) {
  if (!c->model) return;
  MS_FREE(&c->model->scene->alloc, c->reduction, c->largest);
}

typedef struct compression_job {
  ms_compression *c;
  float *coefficients; /* of pcg.h: by entry, t of 8 half-edges, then w */
  ms_operands operands;
  double threshold;
} compression_job;

static int32_t compression_run(ms_pool_chunk *work, compression_job *j) {
  const ms_model *model = j->c->model;
  return ms_pool_run_chunks(model->pool, work, j, ms_half_edges_count_ranges(&model->half_edges),
                            CHUNK);
}

/*------------------------------------- all springs ----------------------------------------------*/

void ms_compression_reset(ms_compression *c) {
  memset(c->reduction, 0, MS_SLICE * (size_t)c->model->half_edges.nentries * sizeof *c->reduction);
}

static void carry_over_chunk(void *data, int32_t begin, int32_t end) {
  const float CARRIED = 0.1f;
  const compression_job *j = data;
  const int32_t *first = j->c->model->half_edges.first;
  for (int32_t entry = first[begin]; entry < first[end]; entry++) {
    float *t = j->coefficients + 4 * MS_SLICE * (size_t)entry;
    float *left_out = j->c->reduction + MS_SLICE * (size_t)entry;
    for (size_t lane = 0; lane < MS_SLICE; lane++) {
      left_out[lane] *= CARRIED;
      t[lane] *= t[lane] < 0 ? 1 - left_out[lane] : 1;
    }
  }
}

void ms_compression_carry_over(ms_compression *c, float *coefficients) {
  compression_run(carry_over_chunk, &(compression_job){.c = c, .coefficients = coefficients});
}

/*------------------------------------- springs that buckle --------------------------------------*/

/* -t |x_i - x_j|^2, the contribution of t to -x.A x, for the 8 half-edges of an entry */
static void find_contributions(const compression_job *j, int32_t range, int32_t entry,
                               double part[MS_SLICE]) {
  const ms_model *model = j->c->model;
  const ms_half_edges *half_edges = &model->half_edges;
  const size_t stride = (size_t)model->unknowns.stride;
  const float *t = j->coefficients + 4 * MS_SLICE * (size_t)entry;
  const int32_t long_part = range - half_edges->nslices;
  for (size_t lane = 0; lane < MS_SLICE; lane++) {
    const size_t row =
        long_part < 0 ? MS_SLICE * (size_t)range + lane : (size_t)half_edges->part_row[long_part];
    const size_t other =
        (size_t)ms_half_edges_neighbour(half_edges, MS_SLICE * entry + (int32_t)lane);
    double sum = 0;
    for (size_t c = 0; c < (size_t)model->unknowns.dims; c++) {
      const double d = ms_operands_get(&j->operands, c * stride + row) -
                       ms_operands_get(&j->operands, c * stride + other);
      sum += d * d;
    }
    part[lane] = -(double)t[lane] * sum;
  }
}

static void find_largest_chunk(void *data, int32_t begin, int32_t end) {
  const compression_job *j = data;
  const ms_half_edges *half_edges = &j->c->model->half_edges;
  double largest = 0;
  for (int32_t s = begin; s < end; s++)
    for (int32_t entry = half_edges->first[s]; entry < half_edges->first[s + 1]; entry++) {
      double part[MS_SLICE];
      find_contributions(j, s, entry, part);
      for (size_t lane = 0; lane < MS_SLICE; lane++) largest = fmax(largest, part[lane]);
    }
  j->c->largest[begin / CHUNK] = largest;
}

static void halve_chunk(void *data, int32_t begin, int32_t end) {
  const compression_job *j = data;
  const ms_half_edges *half_edges = &j->c->model->half_edges;
  for (int32_t s = begin; s < end; s++)
    for (int32_t entry = half_edges->first[s]; entry < half_edges->first[s + 1]; entry++) {
      float *t = j->coefficients + 4 * MS_SLICE * (size_t)entry;
      float *left_out = j->c->reduction + MS_SLICE * (size_t)entry;
      double part[MS_SLICE];
      find_contributions(j, s, entry, part);
      for (size_t lane = 0; lane < MS_SLICE; lane++)
        if (part[lane] >= j->threshold) {
          t[lane] *= 0.5f;
          left_out[lane] = 0.5f + 0.5f * left_out[lane];
        }
    }
}

int ms_compression_reduce(ms_compression *c, ms_operands operands, float *coefficients) {
  const double LITTLE = 0.001;
  compression_job j = {.c = c, .coefficients = coefficients, .operands = operands};
  double largest = 0;
  const int32_t chunks = compression_run(find_largest_chunk, &j);
  for (int32_t i = 0; i < chunks; i++) largest = fmax(largest, c->largest[i]);
  ms_ranks_maximum(c->model->shape.ranks, 1, &largest);
  if (!(largest > 0)) return 0;
  j.threshold = LITTLE * largest;
  compression_run(halve_chunk, &j);
  return 1;
}
