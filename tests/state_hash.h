/* state_hash - a 64-bit hash of the time, positions and velocities of a sim, to compare runs bit by
 * bit */
#ifndef TEST_STATE_HASH_H
#define TEST_STATE_HASH_H

#include <stdint.h>

#include "scenes.h"

/* 64-bit FNV-1a (Fowler, Noll and Vo) */
static inline uint64_t add_hash(uint64_t hash, const void *data, size_t bytes) {
  for (size_t i = 0; i < bytes; i++)
    hash = (hash ^ ((const unsigned char *)data)[i]) * UINT64_C(1099511628211);
  return hash;
}

static inline uint64_t hash_sim(msim_sim *sim) {
  const msim_state s = state_of(sim);
  const size_t bytes = 3 * (size_t)s.n * sizeof(double);
  const uint64_t hash = add_hash(UINT64_C(14695981039346656037), &s.t, sizeof s.t);
  return add_hash(add_hash(hash, s.x, bytes), s.v, bytes);
}

#endif
