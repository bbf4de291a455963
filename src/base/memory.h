/* memory - allocation of all memory: zeroed, 64-byte aligned, by the scene's allocator */
#ifndef MS_MEMORY_H
#define MS_MEMORY_H

#include "base/error.h"

/* Size of a cache line and of an AVX-512 register. */
enum { MS_ALIGNMENT = 64 };

/* *alloc, or malloc and free if alloc is NULL. */
msim_allocator ms_memory_allocator(const msim_allocator *alloc);

/* Refuse an allocator of the caller without size or functions. Nullable: alloc. */
msim_status ms_memory_check_allocator(const msim_allocator *alloc, msim_error *err);

/* Allocate count elements of `size` bytes, all zero; NULL if memory is exhausted or the product
 * overflows. count may be 0. */
void *ms_memory_allocate(const msim_allocator *alloc, size_t count, size_t size);
void ms_memory_free(const msim_allocator *alloc, void *ptr);
void ms_memory_free_all(const msim_allocator *alloc, size_t n, void *const blocks[]);

/* Allocate `count` elements for the pointer p. Its value is p. */
#define MS_NEW(alloc, p, count) ((p) = ms_memory_allocate(alloc, (size_t)(count), sizeof *(p)))

/* Free all these blocks. */
#define MS_FREE(alloc, ...)                                                   \
  ms_memory_free_all(alloc, sizeof((void *[]){__VA_ARGS__}) / sizeof(void *), \
                     (void *[]){__VA_ARGS__})

/* An array that can be enlarged: the address of the pointer to it, and the size of an element. */
typedef struct ms_array {
  void *pointer;
  size_t size;
} ms_array;

#define MS_ARRAY(p) ((ms_array){&(p), sizeof *(p)})

/* Enlarge an array to `needed` elements, at least doubling it; the first `used` are kept. */
msim_status ms_memory_reserve(const msim_allocator *alloc, ms_array array, int32_t used,
                              int32_t *capacity, int64_t needed, msim_error *err);

/* Copy the struct `full` to the caller's, as far as the caller's size goes. */
#define MS_COPY_SIZED(to, full) \
  memcpy(to, &(full), (full).size < sizeof(full) ? (full).size : sizeof(full))

/* Copy a string; NULL if memory is exhausted. */
char *ms_memory_copy_string(const msim_allocator *alloc, const char *text);

#endif
