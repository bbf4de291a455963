#include "saved.h"

#include <string.h>

#include "base/bytes.h"

typedef struct header {
  char magic[8];
  uint32_t order, version;
  uint64_t length, hash, marks;
} header;

size_t saved_run(const uint8_t *saved) {
  header h;
  memcpy(&h, saved, sizeof h);
  return sizeof h + (size_t)h.marks;
}

void saved_mend(uint8_t *saved, size_t length) {
  header h;
  if (length < sizeof h) return;
  memcpy(&h, saved, sizeof h);
  h.length = length;
  h.hash = 0;
  h.hash = ms_hash(ms_hash(0, &h, sizeof h), saved + sizeof h, length - sizeof h);
  memcpy(saved, &h, sizeof h);
}
