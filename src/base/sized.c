#include "base/sized.h"

#include <string.h>

/* Structs do not grow by more: a larger size was never set. */
enum { LARGEST_GROWTH = 4096 };

static size_t size_of(const void *sized) {
  size_t size;
  memcpy(&size, sized, sizeof size);
  return size;
}

static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

msim_status ms_sized_check(const void *from, size_t known, size_t least, const char *type,
                           const char *what, msim_error *err) {
  const unsigned char *bytes = from;
  const size_t size = size_of(from);
  if (size < least || size > known + LARGEST_GROWTH)
    return ms_error_set(err, MSIM_ERR_SIZE,
                        "%s.size is %zu; it must be sizeof(msim_%s), which is %zu", what, size,
                        type, known);
  for (size_t i = known; i < size; i++)
    if (bytes[i])
      return ms_error_set(err, MSIM_ERR_SIZE,
                          "%s has members beyond the %zu bytes that msim %s has, and they are "
                          "not 0: the program was built with a newer msim",
                          what, known, msim_version());
  return MSIM_OK;
}

void ms_sized_read(void *to, size_t known, const void *from) {
  memset(to, 0, known);
  memcpy(to, from, smaller(size_of(from), known));
}

msim_status ms_sized_write(void *to, const void *full, size_t known) {
  const size_t size = size_of(to), first = sizeof size;
  if (size <= first) return MSIM_ERR_SIZE;
  memcpy((char *)to + first, (const char *)full + first, smaller(size, known) - first);
  return MSIM_OK;
}
