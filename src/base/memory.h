/* memory - all of the library's own memory: zeroed, 64-byte aligned, from the host's allocator */
#ifndef MS_MEMORY_H
#define MS_MEMORY_H

#include "base/error.h"

/* A whole cache line and one AVX-512 register. */
enum { MS_ALIGNMENT = 64 };

/* malloc and free where alloc is NULL. */
msim_allocator ms_allocator(const msim_allocator *alloc);

/* count elements of `size` bytes, all zero; NULL when there is no memory or the product overflows.
 * count may be 0. */
void *ms_new(const msim_allocator *alloc, size_t count, size_t size);
void ms_delete(const msim_allocator *alloc, void *ptr);

/* Make room in *array for `needed` elements, at least doubling, keeping the first `used`. */
msim_status ms_reserve(const msim_allocator *alloc, void **array, size_t size, int32_t used,
                       int32_t *capacity, int64_t needed, msim_error *err);

/* A copy of a string. */
char *ms_strdup(const msim_allocator *alloc, const char *text);

#endif
