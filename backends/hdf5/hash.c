#include "hash.h"

#include <string.h>

#include "layout.h"

void h5_hash_words(hash *h, size_t count, const void *words) {
  const char *bytes = words;
  for (size_t i = 0; i < count; i++) {
    uint64_t w;
    memcpy(&w, bytes + 8 * i, 8);
    uint64_t z = w ^ ++h->count * UINT64_C(0x9e3779b97f4a7c15);
    h->sum += (z ^ z >> 32) * UINT64_C(0xbf58476d1ce4e5b9);
  }
}

uint64_t h5_slot_hash(const uint64_t *slot) {
  hash h = {0, 0};
  h5_hash_words(&h, h5_slot_words(slot[SLOT_LENGTH]) - 1, slot + 1);
  return h.sum;
}

uint64_t h5_slot_head_hash(const uint64_t *head) {
  hash h = {0, 0};
  h5_hash_words(&h, SLOT_BYTES - 1, head + 1);
  return h.sum;
}

uint64_t h5_slot_bytes_hash(size_t first, const void *bytes, size_t size) {
  hash h = {.count = SLOT_BYTES - 1 + first / 8};
  uint64_t last = 0;
  h5_hash_words(&h, size / 8, bytes);
  if (size % 8 == 0) return h.sum;
  memcpy(&last, (const char *)bytes + size / 8 * 8, size % 8);
  h5_hash_words(&h, 1, &last);
  return h.sum;
}

uint64_t h5_rows_hash(int64_t n, const msim_frame *frame, int64_t first, int64_t rows) {
  hash v = {.count = 3 * (uint64_t)first}, x = {.count = 3 * (uint64_t)(n + first)};
  h5_hash_words(&v, 3 * (size_t)rows, frame->v);
  h5_hash_words(&x, 3 * (size_t)rows, frame->x);
  return v.sum + x.sum;
}

uint64_t h5_frame_rest_hash(int64_t n, const msim_frame *frame) {
  hash h = {.count = 6 * (uint64_t)n};
  h5_hash_words(&h, 1, &frame->t);
  h5_hash_words(&h, 1, &frame->step);
  return h.sum;
}

uint64_t h5_scene_words(const msim_recording *what) {
  return 3 + (uint64_t)what->n + 4 * (uint64_t)what->nsprings;
}

uint64_t h5_static_hash(const msim_recording *what, uint64_t scene_hash) {
  const size_t n = (size_t)what->n, nsprings = (size_t)what->nsprings;
  hash h = {0, 0};
  h5_hash_words(&h, 2, (int64_t[]){what->n, what->nsprings});
  for (size_t i = 0; i < 2 * nsprings; i++) h5_hash_words(&h, 1, &(int64_t){what->ij[i]});
  h5_hash_words(&h, n, what->mass);
  h5_hash_words(&h, nsprings, what->k);
  h5_hash_words(&h, nsprings, what->rest);
  h5_hash_words(&h, 1, &(uint64_t){what->scene_length});
  h.sum += scene_hash, h.count += what->scene_length;
  for (size_t i = 0; i < 3 * (size_t)what->nfaces; i++)
    h5_hash_words(&h, 1, &(int64_t){what->faces[i]});
  return h.sum;
}
