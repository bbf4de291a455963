#include "base/bytes.h"

#include <string.h>

void ms_bytes_pass(ms_bytes *b, void *data, size_t size) {
  if (b->direction != MS_COUNT && b->used <= b->size && size <= b->size - b->used) {
    unsigned char *at = b->at + b->used;
    if (b->direction == MS_PUT) memcpy(at, data, size);
    else memcpy(data, at, size);
  }
  b->used += size;
}

void ms_bytes_pass_count(ms_bytes *b, int64_t *count) {
  MS_BYTES_PASS(b, *count);
  ms_bytes_check(b, *count >= 0 && *count < INT64_MAX / 2, "a count");
}

void ms_bytes_pass_rows(ms_bytes *b, ms_shape shape, double *x) {
  for (int32_t c = 0; c < shape.dims; c++) {
    double *component = x ? x + (size_t)c * (size_t)shape.stride : NULL;
    ms_bytes_pass(b, component, (size_t)shape.n * sizeof *x);
  }
  if (b->direction == MS_TAKE) ms_bytes_check(b, ms_find_bad(shape, x) < 0, "a vector");
}

void ms_bytes_check(ms_bytes *b, int is_so, const char *what) {
  if (b->direction == MS_TAKE && !is_so && !b->wrong) b->wrong = what;
}

/* For a fixed word this is a bijection of the hash, for a fixed hash one of the word: data that
 * differ in one word only have different hashes. The shift carries high bits down, which the
 * product does not; the factor is that of SplitMix (Steele, Lea and Flood 2014). */
static uint64_t mix(uint64_t hash, uint64_t word) {
  hash = (hash ^ word) * 0xbf58476d1ce4e5b9u;
  return hash ^ hash >> 31;
}

uint64_t ms_hash(uint64_t before, const void *data, size_t size) {
  const unsigned char *at = data;
  uint64_t hash = mix(before, size), word;
  for (; size >= sizeof word; size -= sizeof word, at += sizeof word) {
    memcpy(&word, at, sizeof word);
    hash = mix(hash, word);
  }
  word = 0;
  if (size) memcpy(&word, at, size);
  return mix(hash, word);
}
