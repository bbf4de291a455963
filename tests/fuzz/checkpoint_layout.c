#include "checkpoint_layout.h"

#include <string.h>

#include "base/archive.h"

typedef struct header {
  char magic[8];
  uint32_t order, version;
  uint64_t length, hash, marks;
} header;

size_t checkpoint_layout_run(const uint8_t *saved) {
  header h;
  memcpy(&h, saved, sizeof h);
  return sizeof h + (size_t)h.marks;
}

void checkpoint_layout_rehash(uint8_t *saved, size_t length) {
  header h;
  if (length < sizeof h) return;
  memcpy(&h, saved, sizeof h);
  h.length = length;
  h.hash = 0;
  h.hash = ms_archive_hash(ms_archive_hash(0, &h, sizeof h), saved + sizeof h, length - sizeof h);
  memcpy(saved, &h, sizeof h);
}
