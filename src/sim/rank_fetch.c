#include "sim/rank_fetch.h"

#include <stdlib.h>
#include <string.h>

static const msim_allocator *alloc_of(const ms_rank_fetch *f) { return &f->slices->slice->alloc; }

/* The first element of a rank's slice */
static int64_t slice_begin(const ms_rank_scene *s, ms_element of, int32_t rank, int32_t nranks) {
  if (rank == nranks) return of == MS_PARTICLES ? s->nparticles : s->nsprings;
  const ms_section is = ms_rank_scene_section(s, rank, nranks);
  return of == MS_PARTICLES ? is.first : is.first_spring;
}

static void count_wanted(const ms_rank_fetch *f, ms_element of, int32_t n, const int32_t *number) {
  int32_t i = 0;
  for (int32_t r = 0; r < f->ranks->n; r++) {
    const int64_t end = slice_begin(f->slices, of, r + 1, f->ranks->n);
    const int32_t first = i;
    while (i < n && number[i] < end) i++;
    f->nin[r] = i - first;
  }
}

/* send: to the ranks that have rows, receive: from those that request them, or vice versa */
static void set_bytes(const ms_rank_fetch *f, const int64_t *nsend, const int64_t *nreceive,
                      size_t size) {
  for (int32_t r = 0; r < f->ranks->n; r++) {
    f->slices->send_bytes[r] = nsend[r] * (int64_t)size;
    f->slices->receive_bytes[r] = nreceive[r] * (int64_t)size;
  }
}

static int compare_numbers(const void *a, const void *b) {
  const int32_t i = *(const int32_t *)a, j = *(const int32_t *)b;
  return (i > j) - (i < j);
}

int32_t ms_rank_fetch_sort(int64_t n, int32_t *number) {
  int32_t count = 0;
  qsort(number, (size_t)n, sizeof *number, compare_numbers);
  for (int64_t k = 0; k < n; k++)
    if (k == 0 || number[k] != number[k - 1]) number[count++] = number[k];
  return count;
}

msim_status ms_rank_fetch_create(ms_ranks *ranks, const ms_rank_scene *slices, ms_element of,
                                 int32_t n, const int32_t *number, ms_rank_fetch *f,
                                 msim_error *err) {
  static const char WHAT[] = "the part of this rank";
  *f = (ms_rank_fetch){.ranks = ranks, .slices = slices};
  const msim_allocator *alloc = alloc_of(f);
  msim_status status = ms_ranks_agree_on_memory(
      ranks, MS_NEW(alloc, f->nin, ranks->n) && MS_NEW(alloc, f->nout, ranks->n), WHAT, err);
  if (status) return status;
  count_wanted(f, of, n, number);
  for (int32_t r = 0; r < ranks->n; r++)
    slices->send_bytes[r] = slices->receive_bytes[r] = sizeof *f->nin;
  ms_ranks_all_to_all(ranks, slices->send_bytes, f->nin, slices->receive_bytes, f->nout);
  for (int32_t r = 0; r < ranks->n && !ranks->failed; r++) f->sum_out += f->nout[r];
  const size_t widest = of == MS_PARTICLES ? 3 * sizeof(double) : sizeof(double);
  f->buffer = ms_memory_allocate(alloc, (size_t)f->sum_out, widest);
  status =
      ms_ranks_agree_on_memory(ranks, MS_NEW(alloc, f->out, f->sum_out) && f->buffer, WHAT, err);
  if (status) return status;
  set_bytes(f, f->nin, f->nout, sizeof *number);
  ms_ranks_all_to_all(ranks, slices->send_bytes, number, slices->receive_bytes, f->out);
  const int32_t first = (int32_t)slice_begin(slices, of, ranks->rank, ranks->n);
  for (int64_t k = 0; k < f->sum_out; k++) f->out[k] -= first;
  return ms_ranks_agree(ranks, MSIM_OK, err);
}

void ms_rank_fetch_destroy(ms_rank_fetch *f) {
  if (f->slices) MS_FREE(alloc_of(f), f->nin, f->nout, f->out, f->buffer);
  *f = (ms_rank_fetch){0};
}

void ms_rank_fetch_rows(const ms_rank_fetch *f, size_t size, const void *from, void *to) {
  const char *rows = from;
  for (int64_t k = 0; k < f->sum_out; k++)
    memcpy(f->buffer + (size_t)k * size, rows + (size_t)f->out[k] * size, size);
  set_bytes(f, f->nout, f->nin, size);
  ms_ranks_all_to_all(f->ranks, f->slices->send_bytes, f->buffer, f->slices->receive_bytes, to);
}
