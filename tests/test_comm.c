/* Tests of communicators: ranks that are threads keep the contract of comm.h, calls that do not fit
 * together fail on all ranks, none waits for one that has ended; plugins are opened and checked. */
#include <string.h>

#include "base/comm_plugin.h"
#include "comm_contract.h"
#include "counting_allocator.h"
#include "ranks.h"

/*------------------------------------- threads --------------------------------------------------*/

static const char *check_contract(msim_comm *comm, void *data) {
  (void)data;
  return comm_check_contract(comm, 40);
}

static void threads_keep_the_contract(void **state) {
  (void)state;
  for (int32_t n = 1; n <= MOST_RANKS; n++) {
    const char *wrong = run_ranks(n, check_contract, NULL);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
}

/* Sums are those in the order of ranks, which other orders do not give. */
static const char *check_order(msim_comm *comm, void *data) {
  (void)data;
  double value = comm->rank == 0 ? 1 : comm->rank == 1 ? 0x1p60 : comm->rank == 2 ? -0x1p60 : 3;
  if (comm->sum(comm->self, 1, &value)) return "sum failed";
  return value == 3 ? NULL : "the sum is not ((1 + 2^60) - 2^60) + 3 = 3";
}

static void threads_add_in_the_order_of_ranks(void **state) {
  (void)state;
  const char *wrong = run_ranks(4, check_order, NULL);
  if (wrong) fail_msg("%s", wrong);
}

/*------------------------------------- failures -------------------------------------------------*/

/* Which call rank 1 makes in place of a sum of 2 numbers */
enum { OTHER_FUNCTION, OTHER_LENGTH, NO_NEIGHBOUR, OTHER_MESSAGE, OTHER_PART, OTHER_TARGET, LAST };

static msim_status make_fitting_call(const msim_comm *c, int kind, int wrong) {
  double out[4] = {0}, in[16];
  int64_t bytes[MOST_RANKS] = {8, 8, 8};
  msim_comm_message m = {
      .rank = 1 - c->rank, .send_bytes = 8, .receive_bytes = 8, .send = out, .receive = in};
  if (wrong && kind == OTHER_MESSAGE) m.send_bytes = 16;
  if (wrong && kind == OTHER_TARGET) m.rank = c->rank;
  if (wrong && kind == OTHER_PART) bytes[2] = 16;
  switch (kind) {
    case OTHER_FUNCTION:
      return wrong ? c->maximum(c->self, 2, out) : c->sum(c->self, 2, out);
    case OTHER_LENGTH:
      return c->sum(c->self, wrong ? 1 : 2, out);
    case OTHER_PART:
      return c->gather_parts(c->self, bytes, out, in);
    default:
      if (c->exchange_begin(c->self, c->rank == 2 || (wrong && kind == NO_NEIGHBOUR) ? 0 : 1, &m))
        return MSIM_ERR_ARG;
      return c->exchange_end(c->self);
  }
}

static const char *check_mismatch(msim_comm *comm, void *data) {
  const int kind = *(const int *)data;
  double value = 1;
  if (make_fitting_call(comm, kind, 0)) return comm->reason(comm->self);
  if (make_fitting_call(comm, kind, comm->rank == 1) != MSIM_ERR_BACKEND) return "no failure";
  if (!strstr(comm->reason(comm->self), "do not make the same calls")) return "another reason";
  if (comm->sum(comm->self, 1, &value) != MSIM_ERR_BACKEND) return "the group goes on";
  return NULL;
}

static void calls_that_do_not_fit_fail_everywhere(void **state) {
  (void)state;
  for (int kind = 0; kind < LAST; kind++) {
    const char *wrong = run_ranks(3, check_mismatch, &kind);
    if (wrong) fail_msg("kind %d: %s", kind, wrong);
  }
}

/* Rank 1 ends; the others are told so in the middle of their calls. */
static const char *check_end(msim_comm *comm, void *data) {
  (void)data;
  double value = 1;
  if (comm->rank == 1) {
    msim_comm_threads_fail(comm, "rank 1 has ended");
    msim_comm_threads_fail(comm, "a second reason");
    return NULL;
  }
  if (comm->sum(comm->self, 1, &value) != MSIM_ERR_BACKEND) return "the sum succeeded";
  return strcmp(comm->reason(comm->self), "rank 1 has ended") == 0 ? NULL : "another reason";
}

static void no_rank_waits_for_one_that_has_ended(void **state) {
  (void)state;
  for (int i = 0; i < 200; i++) {
    const char *wrong = run_ranks(3, check_end, NULL);
    if (wrong) fail_msg("%s", wrong);
  }
}

static void threads_are_refused_without_ranks_or_memory(void **state) {
  (void)state;
  msim_comm *comm;
  msim_error why;
  assert_int_equal(msim_comm_threads_create(0, NULL, &comm, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "nranks"));
  assert_int_equal(msim_comm_threads_create(1, NULL, NULL, &why), MSIM_ERR_ARG);
  counting_allocator count = {.fail_at = 0};
  msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free, &count};
  for (; msim_comm_threads_create(1, &alloc, &comm, &why); count.fail_at++, count.calls = 0) {
    assert_int_equal(why.status, MSIM_ERR_MEMORY);
    assert_int_equal(count.live, 0);
  }
  assert_int_equal(count.fail_at, 2);
  msim_comm_threads_destroy(comm);
  msim_comm_threads_destroy(NULL);
  assert_int_equal(count.live, 0);
}

/*------------------------------------- plugins --------------------------------------------------*/

static void plugins_are_opened_and_checked(void **state) {
  (void)state;
  msim_comm *comm, *second;
  msim_error why;
  assert_ok(msim_comm_open("alone", NULL, FAKES, &comm, err));
  const char *wrong = comm_check_contract(comm, 3);
  if (wrong) fail_msg("%s", wrong);
  assert_ok(msim_comm_open("alone", NULL, FAKES, &second, err));
  assert_string_equal(comm->reason(comm->self), "several are open");
  msim_comm_close(second);
  assert_string_equal(comm->reason(comm->self), "one is open");
  assert_int_equal(msim_comm_open("alone", &(int){1}, FAKES, &second, &why), MSIM_ERR_BACKEND);
  assert_string_equal(why.text, "alone: there is no network");
  assert_null(second);
  assert_int_equal(msim_comm_open("alone", &(int){2}, FAKES, &second, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "the communicator's table lacks `sum`");
  assert_string_equal(comm->reason(comm->self), "one is open");
  msim_comm_close(comm);
  msim_comm_close(NULL);
  assert_int_equal(msim_comm_open("pigeons", NULL, FAKES, &comm, &why), MSIM_ERR_NAME);
  assert_non_null(strstr(why.text, "unknown communicator 'pigeons'"));
  assert_int_equal(msim_comm_open("alone", NULL, FAKES, NULL, &why), MSIM_ERR_ARG);
}

static void tables_of_programs_are_checked(void **state) {
  (void)state;
  msim_comm *comm;
  msim_error why;
  assert_ok(msim_comm_threads_create(1, NULL, &comm, err));
  assert_ok(ms_comm_plugin_check(comm, err));
  msim_comm wrong = *comm;
  wrong.abi++;
  assert_int_equal(ms_comm_plugin_check(&wrong, &why), MSIM_ERR_ABI);
  wrong = *comm, wrong.size = MSIM_COMM_SIZE_1 - 1;
  assert_int_equal(ms_comm_plugin_check(&wrong, &why), MSIM_ERR_ABI);
  wrong = *comm, wrong.rank = 1;
  assert_int_equal(ms_comm_plugin_check(&wrong, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text,
                      "communicator 'threads' has rank 1 of 1; ranks are 0 to nranks - 1");
  wrong = *comm, wrong.exchange_end = NULL;
  assert_int_equal(ms_comm_plugin_check(&wrong, &why), MSIM_ERR_ARG);
  msim_comm_threads_destroy(comm);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(threads_keep_the_contract),
      cmocka_unit_test(threads_add_in_the_order_of_ranks),
      cmocka_unit_test(calls_that_do_not_fit_fail_everywhere),
      cmocka_unit_test(no_rank_waits_for_one_that_has_ended),
      cmocka_unit_test(threads_are_refused_without_ranks_or_memory),
      cmocka_unit_test(plugins_are_opened_and_checked),
      cmocka_unit_test(tables_of_programs_are_checked),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
