/* failing_sims - sims whose allocations fail in turn */
#ifndef TEST_FAILING_SIMS_H
#define TEST_FAILING_SIMS_H

#include "failing_allocator.h"
#include "testing.h"

/* Each allocation of a new sim of a scene with failing_allocator_get() fails in turn: it is created
 * without that memory, or nothing is left; and no step allocates. */
static inline void expect_creation_survives_failures(const msim_scene *scene,
                                                     const msim_options *opt, int64_t steps) {
  for (int64_t which = 0, failed = 1; failed; which++) {
    msim_sim *sim = NULL;
    failing_allocator_count(FAILING_BY_ALLOCATOR);
    failing_allocator_arm(which, 0);
    const msim_status status = msim_sim_create(scene, opt, &sim, NULL);
    failed = failing_allocator_has_failed();
    failing_allocator_arm(0, 1);
    if (!status) assert_int_equal(msim_sim_step(sim, steps, NULL), MSIM_OK);
    failing_allocator_arm(-1, 0);
    msim_sim_destroy(sim);
    assert_int_equal(failing_allocator_count_leaks(), 0);
    failing_allocator_count(FAILING_NONE);
    assert_true(!status || (failed && status == MSIM_ERR_MEMORY));
    assert_true(which < 2000);
  }
}

#endif
