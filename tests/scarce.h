/* scarce - memory that runs out when it is told to: malloc itself, or an allocator for scenes
 *
 * Taking malloc over reaches what libraries ask for, too. Sanitizers do that themselves and leave
 * the allocator only. All counting is of the calling thread. */
#ifndef TEST_SCARCE_H
#define TEST_SCARCE_H

#include "msim/api.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#  define SCARCE_MALLOC 1
#else
#  define SCARCE_MALLOC 0
#endif

enum { SCARCE_NOT, SCARCE_BY_MALLOC, SCARCE_BY_ALLOCATOR };

/* From here on blocks are counted, made by malloc or by scarce_allocator(); NOT: no more. */
void scarce_count(int by);

/* Of those to come, allocation number `which` fails, or all from it on; -1: none. */
void scarce_arm(int64_t which, int for_good);

/* 1 if one has failed since scarce_arm. */
int scarce_failed(void);

/* Blocks made while counting that were not freed while counting; the count begins anew. */
int64_t scarce_left(void);

const msim_allocator *scarce_allocator(void);

#endif
