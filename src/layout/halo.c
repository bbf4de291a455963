#include "layout/halo.h"

#include <string.h>

#include "base/simd.h"
#include "scene/section.h"

/*------------------------------------- creation -------------------------------------------------*/

/* The number of a particle in the whole scene, and the particle of this number, or -1 */
static int64_t get_number(const ms_rank_part *part, int32_t particle) {
  return part->number ? part->number[particle] : particle;
}

static int32_t find_particle(const ms_scene *s, const ms_rank_part *part, int64_t number) {
  if (!part->number) return number >= 0 && number < s->nparticles ? (int32_t)number : -1;
  const int32_t p = ms_section_search(s->nparticles, part->number, (int32_t)number);
  return s->nparticles && part->number[p] == number ? p : -1;
}

/* What ranks request from each other: 64-bit numbers of particles */
typedef struct requests {
  int64_t *nin, *nout;           /* nranks: particles requested from each rank, and by it */
  int64_t *in_bytes, *out_bytes; /* nranks: scratch */
  int64_t *in, *out;             /* their numbers, by rank */
  int32_t *row;                  /* nparticles: the row of each, -1: not here */
} requests;

static int create_requests(const ms_scene *s, const ms_unknowns *rows, const ms_rank_part *part,
                           requests *q) {
  const size_t n = (size_t)part->ranks->n;
  if (!MS_NEW(&s->alloc, q->nin, n) || !MS_NEW(&s->alloc, q->nout, n) ||
      !MS_NEW(&s->alloc, q->in_bytes, n) || !MS_NEW(&s->alloc, q->out_bytes, n) ||
      !MS_NEW(&s->alloc, q->in, rows->first_fixed - rows->first_pinned) ||
      !MS_NEW(&s->alloc, q->row, s->nparticles))
    return 0;
  for (int32_t p = 0; p < s->nparticles; p++) q->row[p] = -1;
  ms_unknowns_find_rows(rows, q->row);
  for (int32_t r = rows->first_pinned; r < rows->first_fixed; r++) {
    q->in[r - rows->first_pinned] = get_number(part, rows->particle[r]);
    q->nin[part->owner[rows->particle[r]]]++;
  }
  return 1;
}

static void destroy_requests(const ms_scene *s, requests *q) {
  MS_FREE(&s->alloc, q->nin, q->nout, q->in_bytes, q->out_bytes, q->in, q->out, q->row);
}

static void count_requests(ms_ranks *ranks, requests *q) {
  for (int32_t r = 0; r < ranks->n; r++) q->in_bytes[r] = sizeof *q->nin;
  ms_ranks_all_to_all(ranks, q->in_bytes, q->nin, q->in_bytes, q->nout);
}

static void send_requests(ms_ranks *ranks, requests *q) {
  for (int32_t r = 0; r < ranks->n; r++) {
    q->in_bytes[r] = (int64_t)sizeof *q->in * q->nin[r];
    q->out_bytes[r] = (int64_t)sizeof *q->out * q->nout[r];
  }
  ms_ranks_all_to_all(ranks, q->in_bytes, q->in, q->out_bytes, q->out);
}

static int allocate_messages(const ms_scene *s, const requests *q, ms_halo *h, int64_t **out) {
  const size_t n = (size_t)h->ranks->n;
  int64_t nin = 0, nout = 0;
  for (size_t r = 0; r < n; r++) nin += q->nin[r], nout += q->nout[r];
  return MS_NEW(&s->alloc, *out, nout) && MS_NEW(&s->alloc, h->out, nout) &&
         MS_NEW(&s->alloc, h->first_out, n + 1) && MS_NEW(&s->alloc, h->first_in, n + 1) &&
         MS_NEW(&s->alloc, h->messages, n) && MS_NEW(&s->alloc, h->send, 6 * (size_t)nout) &&
         MS_NEW(&s->alloc, h->receive, 6 * (size_t)nin);
}

static void list_neighbours(const requests *q, ms_halo *h) {
  for (int32_t r = 0; r < h->ranks->n; r++) {
    if (q->nin[r] == 0 && q->nout[r] == 0) continue;
    h->messages[h->n++].rank = r;
    h->first_in[h->n] = h->first_in[h->n - 1] + (int32_t)q->nin[r];
    h->first_out[h->n] = h->first_out[h->n - 1] + (int32_t)q->nout[r];
  }
}

/* Ranks ask for each other's unknowns, unless their scenes differ. */
static msim_status list_rows(const ms_scene *s, const ms_unknowns *rows, const ms_rank_part *part,
                             const requests *q, ms_halo *h, msim_error *err) {
  for (int32_t i = 0; i < h->first_out[h->n]; i++) {
    const int32_t p = find_particle(s, part, q->out[i]);
    h->out[i] = p >= 0 ? q->row[p] : -1;
    if (h->out[i] < 0 || h->out[i] >= rows->nfree)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "rank %d does not compute particle %lld, as another rank expects; create "
                          "the sims of all ranks from the same scene",
                          h->ranks->rank, (long long)q->out[i]);
  }
  return MSIM_OK;
}

msim_status ms_halo_create(const ms_scene *scene, const ms_unknowns *rows, const ms_rank_part *part,
                           ms_halo **halo, msim_error *err) {
  ms_ranks *ranks = part->ranks;
  requests q = {0};
  ms_halo *h = *halo = ms_memory_allocate(&scene->alloc, 1, sizeof *h);
  int fits = h && create_requests(scene, rows, part, &q);
  if (fits) h->ranks = ranks, h->first = rows->first_pinned;
  msim_status status = ms_ranks_agree_on_memory(ranks, fits, "the ghosts", err);
  if (!status) {
    count_requests(ranks, &q);
    fits = !ranks->failed && allocate_messages(scene, &q, h, &q.out);
    status = ms_ranks_agree_on_memory(ranks, fits, "the ghosts", err);
  }
  if (!status) {
    send_requests(ranks, &q);
    list_neighbours(&q, h);
    status = ranks->failed ? MSIM_OK : list_rows(scene, rows, part, &q, h, err);
    status = ms_ranks_agree(ranks, status, err);
  }
  destroy_requests(scene, &q);
  return status;
}

void ms_halo_destroy(const ms_scene *scene, ms_halo *h) {
  if (!h) return;
  MS_FREE(&scene->alloc, h->out, h->first_out, h->first_in, h->send, h->receive, h->messages, h);
}

/*------------------------------------- refresh --------------------------------------------------*/

/* Numbers of `size` bytes, a constant where this is inlined. Component by component; returns the
 * place after them. */
MS_INLINE char *pack(size_t size, const ms_halo *h, int32_t k, int32_t components, int32_t stride,
                     const void *vec, char *to) {
  for (int32_t c = 0; c < components && vec; c++)
    for (int32_t i = h->first_out[k]; i < h->first_out[k + 1]; i++, to += size) {
      const size_t at = (size_t)c * (size_t)stride + (size_t)h->out[i];
      memcpy(to, (const char *)vec + size * at, size);
    }
  return to;
}

static const char *unpack(size_t size, const ms_halo *h, int32_t k, int32_t components,
                          int32_t stride, const char *from, void *vec) {
  const size_t bytes = size * (size_t)(h->first_in[k + 1] - h->first_in[k]);
  const size_t row = (size_t)(h->first + h->first_in[k]);
  for (int32_t c = 0; c < components && vec; c++, from += bytes)
    memcpy((char *)vec + size * ((size_t)c * (size_t)stride + row), from, bytes);
  return from;
}

MS_INLINE void refresh(size_t size, ms_halo *h, int32_t components, int32_t stride, void *x,
                       void *v) {
  const int64_t width = (int64_t)size * components * (v ? 2 : 1);
  char *to = (char *)h->send;
  const char *from = (char *)h->receive;
  for (int32_t k = 0; k < h->n; k++) {
    msim_comm_message *m = &h->messages[k];
    m->send = to, m->receive = (char *)h->receive + width * h->first_in[k];
    to = pack(size, h, k, components, stride, x, to);
    to = pack(size, h, k, components, stride, v, to);
    m->send_bytes = width * (h->first_out[k + 1] - h->first_out[k]);
    m->receive_bytes = width * (h->first_in[k + 1] - h->first_in[k]);
    h->bytes += m->send_bytes;
  }
  ms_ranks_exchange(h->ranks, h->n, h->messages);
  for (int32_t k = 0; k < h->n; k++) {
    from = unpack(size, h, k, components, stride, from, x);
    from = unpack(size, h, k, components, stride, from, v);
  }
}

void ms_halo_refresh(ms_halo *h, int32_t components, int32_t stride, double *x, double *v) {
  if (h) refresh(sizeof *x, h, components, stride, x, v);
}

void ms_halo_refresh_floats(ms_halo *h, int32_t components, int32_t stride, float *x) {
  if (h) refresh(sizeof *x, h, components, stride, x, NULL);
}
