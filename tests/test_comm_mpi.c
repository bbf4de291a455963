/* Tests of the plugin mpi: what comm.h promises, between 1 to 4 processes, also in pieces.
 * usage: test_comm_mpi, which starts itself by mpirun; the ranks are test_comm_mpi FOLDER */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "comm_contract.h"
#include "msim/msim.h"
#include "testing.h"

static const char *program;

/* The contract on this rank; prints what is broken. */
static int check_rank(const char *folder) {
  msim_comm *comm = NULL;
  msim_error why = {0, ""};
  const char *wrong = NULL;
  if (msim_comm_open("mpi", NULL, *folder ? folder : NULL, &comm, &why)) wrong = why.text;
  if (!wrong && comm->nranks != atoi(getenv("RANKS"))) wrong = "another number of ranks";
  if (!wrong && getenv("RANK_0_FAILS")) {
    double value = 1;
    if (comm->rank > 0) comm->sum(comm->self, 1, &value); /* waits for rank 0 */
    else comm->broadcast(comm->self, 99, sizeof value, &value);
    msim_comm_close(comm);
    return 0;
  }
  if (!wrong) wrong = comm_check_contract(comm, 20);
  if (wrong) {
    fprintf(stderr, "%s\n", wrong);
    _exit(1); /* mpirun then ends the others, for which MPI_Finalize would wait */
  }
  msim_comm_close(comm);
  return 0;
}

/* Exit status of so many ranks with the plugin of a folder; "": that of msim. Ranks that wait for
 * each other are ended after 30 s, with status 124: all tests together within the limit of ctest.
 * `timeout` signals the process group of mpirun, which ends its ranks. */
static int run_ranks(int ranks, const char *folder) {
  char command[2000], number[20];
  snprintf(number, sizeof number, "%d", ranks);
  setenv("RANKS", number, 1);
  snprintf(command, sizeof command, "timeout -k 5 30 mpirun -n %d '%s' '%s'", ranks, program,
           folder);
  const int status = system(command);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void the_contract_holds(void **state) {
  (void)state;
  for (int ranks = 1; ranks <= 4; ranks++) assert_int_equal(run_ranks(ranks, ""), 0);
}

static void in_pieces_too(void **state) {
  (void)state;
  for (int ranks = 1; ranks <= 4; ranks++) assert_int_equal(run_ranks(ranks, PIECES), 0);
}

/* The others wait for a rank whose call has failed, until it closes its communicator. */
static void a_failure_ends_all_ranks(void **state) {
  (void)state;
  setenv("RANK_0_FAILS", "1", 1);
  const int status = run_ranks(3, "");
  unsetenv("RANK_0_FAILS");
  assert_int_not_equal(status, 0);
}

/* A program that mpirun has not started is one rank. */
static void one_process_is_one_rank(void **state) {
  (void)state;
  msim_comm *comm = NULL;
  assert_ok(msim_comm_open("mpi", NULL, NULL, &comm, err));
  assert_int_equal(comm->nranks, 1);
  assert_string_equal(comm->name, "mpi");
  const char *wrong = comm_check_contract(comm, 3);
  if (wrong) fail_msg("%s", wrong);
  msim_comm_close(comm);
}

/* A rank that does not exist: the sentence names this rank, its host and what failed. */
static void errors_name_rank_and_host(void **state) {
  (void)state;
  msim_comm *comm = NULL;
  char data[4] = "abc";
  assert_ok(msim_comm_open("mpi", NULL, NULL, &comm, err));
  assert_int_equal(comm->broadcast(comm->self, 5, sizeof data, data), MSIM_ERR_BACKEND);
  const char *reason = comm->reason(comm->self);
  if (strncmp(reason, "rank 0 of 1 on host ", 20) != 0 || !strstr(reason, "MPI_Bcast failed: "))
    fail_msg("%s", reason);
  /* not closed: that would end this process */
}

/* In a process of its own, as MPI in this one would make mpirun part of it */
static int is_plugin_there(void) {
  const pid_t child = fork();
  if (child == 0) {
    msim_comm *comm = NULL;
    _exit(msim_comm_open("mpi", NULL, NULL, &comm, NULL) != MSIM_OK);
  }
  int status = 1;
  waitpid(child, &status, 0);
  return status == 0;
}

int main(int argc, char **argv) {
  if (argc > 1) return check_rank(argv[1]);
  program = argv[0];
  if (!is_plugin_there()) return missing_status("the communicator mpi");
  if (system("mpirun --version >/dev/null 2>&1")) return missing_status("mpirun");
  if (system("timeout --version >/dev/null 2>&1")) return missing_status("timeout of coreutils");
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_contract_holds), cmocka_unit_test(in_pieces_too),
      cmocka_unit_test(a_failure_ends_all_ranks), cmocka_unit_test(one_process_is_one_rank),
      cmocka_unit_test(errors_name_rank_and_host)};
  return cmocka_run_group_tests_name("mpi", tests, NULL, NULL);
}
