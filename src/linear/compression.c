#include "linear/compression.h"

#include <math.h>
#include <string.h>

enum { CHUNK = 128 }; /* slice ranges per work item */

msim_status ms_compression_create(const ms_model *model, ms_compression *c, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  *c = (ms_compression){
      .model = model,
      .left_out = ms_new(alloc, MS_GROUP * (size_t)model->halves.nslots, sizeof *c->left_out),
      .largest = ms_new(alloc, (size_t)ms_chunks(&model->halves, CHUNK) + 1, sizeof *c->largest)};
  return c->left_out && c->largest ? MSIM_OK : ms_fail_memory(err, "conjugate gradients");
}

void ms_compression_destroy(ms_compression *c) {
  if (!c->model) return;
  ms_delete(&c->model->scene->alloc, c->left_out);
  ms_delete(&c->model->scene->alloc, c->largest);
}

typedef struct job {
  ms_compression *c;
  float *coefficients; /* of pcg.h: by entry, t of 8 half-edges, then w */
  const double *p;
  double threshold;
} job;

static void run(ms_item *work, job *j) {
  const ms_model *model = j->c->model;
  ms_pool_run(model->pool, work, j, ms_chunks(&model->halves, CHUNK));
}

/*------------------------------------- all springs ----------------------------------------------*/

void ms_compression_forget(ms_compression *c) {
  memset(c->left_out, 0, MS_GROUP * (size_t)c->model->halves.nslots * sizeof *c->left_out);
}

static void apply_chunk(void *data, int32_t item) {
  const float KEPT = 0.1f;
  const job *j = data;
  const ms_halves *halves = &j->c->model->halves;
  const int32_t begin = halves->first[CHUNK * item];
  const int32_t end = halves->first[ms_chunk_end(halves, CHUNK, item)];
  for (int32_t slot = begin; slot < end; slot++) {
    float *t = j->coefficients + 4 * MS_GROUP * (size_t)slot;
    float *left_out = j->c->left_out + MS_GROUP * (size_t)slot;
    for (size_t lane = 0; lane < MS_GROUP; lane++) {
      left_out[lane] *= KEPT;
      t[lane] *= t[lane] < 0 ? 1 - left_out[lane] : 1;
    }
  }
}

void ms_compression_apply(ms_compression *c, float *coefficients) {
  run(apply_chunk, &(job){.c = c, .coefficients = coefficients});
}

/*------------------------------------- springs that buckle --------------------------------------*/

/* -t |p_i - p_j|^2, the contribution of t to -p.A p, for the 8 half-edges of an entry */
static void find_parts(const job *j, int32_t segment, int32_t slot, double part[MS_GROUP]) {
  const ms_model *model = j->c->model;
  const ms_halves *halves = &model->halves;
  const size_t stride = (size_t)model->rows.stride;
  const float *t = j->coefficients + 4 * MS_GROUP * (size_t)slot;
  const int32_t long_part = segment - halves->ngroups;
  for (size_t lane = 0; lane < MS_GROUP; lane++) {
    const size_t row =
        long_part < 0 ? MS_GROUP * (size_t)segment + lane : (size_t)halves->part_row[long_part];
    const size_t other = (size_t)halves->neighbour[MS_GROUP * (size_t)slot + lane];
    double sum = 0;
    for (size_t c = 0; c < (size_t)model->rows.dims; c++) {
      const double d = j->p[c * stride + row] - j->p[c * stride + other];
      sum += d * d;
    }
    part[lane] = -(double)t[lane] * sum;
  }
}

static void find_largest_chunk(void *data, int32_t item) {
  const job *j = data;
  const ms_halves *halves = &j->c->model->halves;
  double largest = 0;
  for (int32_t s = CHUNK * item; s < ms_chunk_end(halves, CHUNK, item); s++)
    for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
      double part[MS_GROUP];
      find_parts(j, s, slot, part);
      for (size_t lane = 0; lane < MS_GROUP; lane++) largest = fmax(largest, part[lane]);
    }
  j->c->largest[item] = largest;
}

static void halve_chunk(void *data, int32_t item) {
  const job *j = data;
  const ms_halves *halves = &j->c->model->halves;
  for (int32_t s = CHUNK * item; s < ms_chunk_end(halves, CHUNK, item); s++)
    for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
      float *t = j->coefficients + 4 * MS_GROUP * (size_t)slot;
      float *left_out = j->c->left_out + MS_GROUP * (size_t)slot;
      double part[MS_GROUP];
      find_parts(j, s, slot, part);
      for (size_t lane = 0; lane < MS_GROUP; lane++)
        if (part[lane] >= j->threshold) {
          t[lane] *= 0.5f;
          left_out[lane] = 0.5f + 0.5f * left_out[lane];
        }
    }
}

int ms_compression_reduce(ms_compression *c, const double *p, float *coefficients) {
  const double LITTLE = 0.001;
  job j = {.c = c, .coefficients = coefficients, .p = p};
  double largest = 0;
  run(find_largest_chunk, &j);
  for (int32_t i = 0; i < ms_chunks(&c->model->halves, CHUNK); i++)
    largest = fmax(largest, c->largest[i]);
  if (!(largest > 0)) return 0;
  j.threshold = LITTLE * largest;
  run(halve_chunk, &j);
  return 1;
}
