#include "base/archive.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Copy what lies in the buffer, which has a part of all bytes. */
static void write_overlap(ms_archive *b, const unsigned char *data, size_t size) {
  const size_t end = b->position + size, last = b->first + b->size;
  const size_t from = b->position > b->first ? b->position : b->first, to = end < last ? end : last;
  if (from < to) memcpy(b->data + (from - b->first), data + (from - b->position), to - from);
}

void ms_archive_transfer(ms_archive *b, void *data, size_t size) {
  if (b->direction == MS_ARCHIVE_WRITE && b->data) write_overlap(b, data, size);
  else if (size > 0 && b->direction != MS_ARCHIVE_COUNT && b->position <= b->size &&
           size <= b->size - b->position) {
    const unsigned char *at = b->data + b->position;
    if (b->direction == MS_ARCHIVE_READ) memcpy(data, at, size);
    else b->differs |= memcmp(data, at, size) != 0;
  }
  b->position += size;
}

void ms_archive_transfer_count(ms_archive *b, int64_t *count) {
  MS_ARCHIVE_TRANSFER(b, *count);
  ms_archive_check(b, *count >= 0 && *count < INT64_MAX / 2, "a counter");
}

void ms_archive_transfer_vector(ms_archive *b, ms_shape shape, void *x) {
  const size_t size = ms_vector_number_size(shape);
  for (int32_t c = 0; c < ms_vector_count_components(shape); c++) {
    void *component = x ? (char *)x + (size_t)c * (size_t)shape.stride * size : NULL;
    if (b->rows) b->rows->transfer(b, component);
    else ms_archive_transfer(b, component, (size_t)shape.n * size);
  }
  if (b->direction == MS_ARCHIVE_READ && !b->rows)
    ms_archive_check(b, ms_vector_find_invalid(shape, x) < 0, "a vector of the state");
}

void ms_archive_check(ms_archive *b, int is_so, const char *what) {
  if (b->direction == MS_ARCHIVE_READ && !is_so && !b->invalid_item) b->invalid_item = what;
}

void ms_archive_check_rounding(ms_archive *b, double sum, double rounding, const char *what) {
  ms_archive_check(b, fabs(rounding) <= 2 * DBL_EPSILON * fabs(sum), what);
}

/* For a fixed word this is a bijection of the hash, for a fixed hash one of the word: data that
 * differ in one word only have different hashes. The shift carries high bits down, which the
 * product does not; the factor is that of SplitMix (Steele, Lea and Flood 2014). */
static uint64_t mix_word(uint64_t hash, uint64_t word) {
  hash = (hash ^ word) * 0xbf58476d1ce4e5b9u;
  return hash ^ hash >> 31;
}

uint64_t ms_archive_hash_begin(uint64_t before, size_t size) { return mix_word(before, size); }

uint64_t ms_archive_hash_words(uint64_t hash, const void *data, size_t size) {
  const unsigned char *at = data;
  uint64_t word;
  for (size_t i = 0; i + sizeof word <= size; i += sizeof word) {
    memcpy(&word, at + i, sizeof word);
    hash = mix_word(hash, word);
  }
  return hash;
}

uint64_t ms_archive_hash_last(uint64_t hash, const void *data, size_t size) {
  const size_t rest = size % sizeof hash;
  uint64_t word = 0;
  hash = ms_archive_hash_words(hash, data, size);
  if (rest) memcpy(&word, (const unsigned char *)data + (size - rest), rest);
  return mix_word(hash, word);
}

uint64_t ms_archive_hash(uint64_t before, const void *data, size_t size) {
  return ms_archive_hash_last(ms_archive_hash_begin(before, size), data, size);
}
