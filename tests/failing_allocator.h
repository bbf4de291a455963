/* failing_allocator - allocations that fail on demand, by a replacement of malloc or by an
 * allocator for scenes
 *
 * The replacement of malloc also reaches the allocations of libraries. Sanitizers replace malloc
 * themselves, and leave only the allocator. Counts are per thread. */
#ifndef TEST_FAILING_ALLOCATOR_H
#define TEST_FAILING_ALLOCATOR_H

#include "msim/api.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#  define FAILING_MALLOC 1
#else
#  define FAILING_MALLOC 0
#endif

enum { FAILING_NONE, FAILING_BY_MALLOC, FAILING_BY_ALLOCATOR };

/* Start counting the blocks allocated by malloc or by failing_allocator_get(); FAILING_NONE: stop.
 * */
void failing_allocator_count(int by);

/* Of the allocations after this call, number `which` (from 0) fails, or all from it on if for_good;
 * -1: none. */
void failing_allocator_arm(int64_t which, int for_good);

/* 1 if an allocation has failed since failing_allocator_arm. */
int failing_allocator_has_failed(void);

/* Blocks allocated while counting and not freed while counting; resets the count to 0. */
int64_t failing_allocator_count_leaks(void);

const msim_allocator *failing_allocator_get(void);

#endif
