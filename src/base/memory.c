#define _DEFAULT_SOURCE /* madvise */
#include "base/memory.h"

#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "base/sized.h"

/* Large blocks ask for huge pages, which most systems leave to programs: scenes that exceed the
 * caches then miss fewer translations of addresses. */
static void *libc_alloc(size_t bytes, void *user) {
  const size_t HUGE_PAGE = (size_t)1 << 21;
  void *block;
  (void)user;
  if (bytes < HUGE_PAGE) return malloc(bytes);
  if (posix_memalign(&block, HUGE_PAGE, bytes)) return NULL;
  (void)madvise(block, bytes, MADV_HUGEPAGE); /* a hint, which a kernel may refuse */
  return block;
}

static void libc_free(void *ptr, void *user) {
  (void)user;
  free(ptr);
}

msim_allocator ms_memory_allocator(const msim_allocator *alloc) {
  msim_allocator own = {.alloc = libc_alloc, .free = libc_free};
  if (alloc) own = *alloc;
  own.size = sizeof own; /* the caller's may be larger than what was copied */
  return own;
}

msim_status ms_memory_check_allocator(const msim_allocator *alloc, msim_error *err) {
  if (!alloc) return MSIM_OK;
  msim_status status =
      ms_sized_check(alloc, sizeof *alloc, sizeof *alloc, "allocator", "alloc", err);
  if (status || (alloc->alloc && alloc->free)) return status;
  return ms_error_set(err, MSIM_ERR_ARG, "alloc.alloc or alloc.free is NULL");
}

/* The pointer returned by the allocator is stored just before the aligned block. */
void *ms_memory_allocate(const msim_allocator *alloc, size_t count, size_t size) {
  const size_t extra = MS_ALIGNMENT + sizeof(void *);
  if (size && count > (SIZE_MAX - extra) / size) return NULL;
  char *raw = alloc->alloc(count * size + extra, alloc->user);
  if (!raw) return NULL;
  uintptr_t first = (uintptr_t)raw + sizeof(void *);
  char *block = raw + sizeof(void *) + (MS_ALIGNMENT - first % MS_ALIGNMENT) % MS_ALIGNMENT;
  /* cppcheck-suppress pointerSize; the pointer itself is stored */
  memcpy(block - sizeof(void *), &raw, sizeof(void *));
  return memset(block, 0, count * size);
}

void ms_memory_free(const msim_allocator *alloc, void *ptr) {
  if (!ptr) return;
  void *raw;
  memcpy(&raw, (char *)ptr - sizeof(void *), sizeof(void *));
  alloc->free(raw, alloc->user);
}

void ms_memory_free_all(const msim_allocator *alloc, size_t n, void *const blocks[]) {
  for (size_t i = 0; i < n; i++) ms_memory_free(alloc, blocks[i]);
}

msim_status ms_memory_reserve(const msim_allocator *alloc, ms_array array, int32_t used,
                              int32_t *capacity, int64_t needed, msim_error *err) {
  if (needed <= *capacity) return MSIM_OK;
  if (needed > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%lld elements exceed the limit of %d",
                        (long long)needed, INT32_MAX);
  int64_t doubled = 2 * (int64_t)*capacity;
  if (doubled > INT32_MAX) doubled = INT32_MAX;
  int64_t room = needed > doubled ? needed : doubled;
  void *larger = ms_memory_allocate(alloc, (size_t)room, array.size);
  if (!larger) return ms_error_set_memory(err, "the arrays of the scene");
  void *old;
  memcpy(&old, array.pointer, sizeof old);
  if (used) memcpy(larger, old, (size_t)used * array.size);
  ms_memory_free(alloc, old);
  memcpy(array.pointer, &larger, sizeof larger);
  *capacity = (int32_t)room;
  return MSIM_OK;
}

char *ms_memory_copy_string(const msim_allocator *alloc, const char *text) {
  size_t bytes = strlen(text) + 1;
  char *copy = ms_memory_allocate(alloc, bytes, 1);
  return copy ? memcpy(copy, text, bytes) : NULL;
}
