/* scarce - allocations that fail on demand, by a replacement of malloc or by an allocator for
 * scenes
 *
 * The replacement of malloc also reaches the allocations of libraries. Sanitizers replace malloc
 * themselves, and leave only the allocator. Counts are per thread. */
#ifndef TEST_SCARCE_H
#define TEST_SCARCE_H

#include "msim/api.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#  define SCARCE_MALLOC 1
#else
#  define SCARCE_MALLOC 0
#endif

enum { SCARCE_NOT, SCARCE_BY_MALLOC, SCARCE_BY_ALLOCATOR };

/* Start counting the blocks allocated by malloc or by scarce_allocator(); SCARCE_NOT: stop. */
void scarce_count(int by);

/* Of the allocations after this call, number `which` (from 0) fails, or all from it on if for_good;
 * -1: none. */
void scarce_arm(int64_t which, int for_good);

/* 1 if an allocation has failed since scarce_arm. */
int scarce_failed(void);

/* Blocks allocated while counting and not freed while counting; resets the count to 0. */
int64_t scarce_left(void);

const msim_allocator *scarce_allocator(void);

#endif
