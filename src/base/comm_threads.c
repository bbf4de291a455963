/* comm_threads - ranks that are threads of one process: the last rank to make a call carries it out
 * for all (msim/comm.h), while the others poll, if each has a core, and then sleep */
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "base/pause.h"
#include "base/pool.h"
#include "msim/comm.h"

typedef enum function {
  SUM,
  MAXIMUM,
  GATHER,
  GATHER_PARTS,
  BROADCAST,
  ALL_TO_ALL,
  EXCHANGE
} function;

static const char *const function_names[] = {"sum",       "maximum",    "gather",  "gather_parts",
                                             "broadcast", "all_to_all", "exchange"};

/* The arguments of a call */
typedef struct thread_call {
  function function;
  int64_t n; /* values, bytes or messages */
  int32_t root;
  const void *send;
  void *receive;
  const int64_t *send_bytes, *receive_bytes;
} thread_call;

typedef struct thread_rank {
  msim_comm comm; /* first: a pointer to it is one to the rank */
  struct thread_group *group;
  thread_call call;
  int polls; /* for the end of a call, before it sleeps */
} thread_rank;

typedef struct thread_group {
  msim_allocator alloc;
  int32_t n, arrived;     /* ranks; those that wait in the present call */
  int most_polls;         /* of a rank; 0: not every rank has a core */
  _Atomic uint64_t calls; /* completed */
  atomic_int failed;
  char reason[256];
  pthread_mutex_t lock;
  pthread_cond_t changed; /* a call is complete, or the group has failed */
  thread_rank *rank;      /* n */
} thread_group;

/*------------------------------------- failure --------------------------------------------------*/

/* Called with the lock; the first reason stays. */
static void fail_group(thread_group *g, const char *reason) {
  if (!g->failed) snprintf(g->reason, sizeof g->reason, "%s", reason);
  g->failed = 1;
  pthread_cond_broadcast(&g->changed);
}

static void fail_mismatch(thread_group *g, int32_t p, int32_t q, const char *what) {
  char text[sizeof g->reason];
  snprintf(text, sizeof text,
           "ranks %d and %d do not make the same calls: %s in rank %d, %s in rank %d%s; all ranks "
           "must call the same functions of a sim in the same order",
           p, q, function_names[g->rank[p].call.function], p,
           function_names[g->rank[q].call.function], q, what);
  fail_group(g, text);
}

/*------------------------------------- functions ------------------------------------------------*/

/* NaN if one of them is */
static double larger(double a, double b) { return isnan(a) || a > b ? a : b; }

/* In the order of ranks */
static void reduce_values(thread_group *g) {
  const int is_sum = g->rank[0].call.function == SUM;
  for (int64_t i = 0; i < g->rank[0].call.n; i++) {
    double all = ((const double *)g->rank[0].call.receive)[i];
    for (int32_t r = 1; r < g->n; r++) {
      const double one = ((const double *)g->rank[r].call.receive)[i];
      all = is_sum ? all + one : larger(all, one);
    }
    for (int32_t r = 0; r < g->n; r++) ((double *)g->rank[r].call.receive)[i] = all;
  }
}

static void copy_bytes(char **to, const void *from, int64_t bytes) {
  if (bytes > 0) memcpy(*to, from, (size_t)bytes);
  *to += bytes;
}

static void gather_values(thread_group *g) {
  for (int32_t r = 0; r < g->n; r++) {
    char *to = g->rank[r].call.receive;
    for (int32_t q = 0; q < g->n; q++) {
      const thread_call *from = &g->rank[q].call;
      copy_bytes(&to, from->send, from->send_bytes ? from->send_bytes[q] : from->n);
    }
  }
}

static void broadcast_value(thread_group *g) {
  const thread_call *root = &g->rank[g->rank[0].call.root].call;
  for (int32_t r = 0; r < g->n; r++) {
    char *to = g->rank[r].call.receive;
    if (&g->rank[r].call != root) copy_bytes(&to, root->receive, root->n);
  }
}

static void send_all_to_all(thread_group *g) {
  for (int32_t q = 0; q < g->n; q++) {
    const char *from = g->rank[q].call.send;
    for (int32_t r = 0; r < g->n; r++) {
      const thread_call *to = &g->rank[r].call;
      char *at = to->receive;
      for (int32_t k = 0; k < q; k++) at += to->receive_bytes[k];
      copy_bytes(&at, from, g->rank[q].call.send_bytes[r]);
      from += g->rank[q].call.send_bytes[r];
    }
  }
}

static const msim_comm_message *find_message(const thread_call *call, int32_t rank) {
  const msim_comm_message *messages = call->send;
  for (int64_t i = 0; i < call->n; i++)
    if (messages[i].rank == rank) return &messages[i];
  return NULL;
}

static void exchange_messages(thread_group *g) {
  for (int32_t r = 0; r < g->n; r++) {
    const msim_comm_message *to = g->rank[r].call.send;
    for (int64_t i = 0; i < g->rank[r].call.n; i++) {
      char *at = to[i].receive;
      copy_bytes(&at, find_message(&g->rank[to[i].rank].call, r)->send, to[i].receive_bytes);
    }
  }
}

/*------------------------------------- checks ---------------------------------------------------*/

static int check_messages(thread_group *g, int32_t r) {
  const thread_call *call = &g->rank[r].call;
  const msim_comm_message *m = call->send;
  for (int64_t i = 0; i < call->n; i++) {
    const int32_t q = m[i].rank;
    const int valid = q >= 0 && q < g->n && q != r && (i == 0 || q > m[i - 1].rank);
    const msim_comm_message *other = valid ? find_message(&g->rank[q].call, r) : NULL;
    if (other && other->send_bytes == m[i].receive_bytes) continue;
    fail_mismatch(g, r, valid ? q : 0, " with other messages");
    return 0;
  }
  return 1;
}

static int check_lengths(thread_group *g, int32_t r) {
  const thread_call *first = &g->rank[0].call, *call = &g->rank[r].call;
  int same = call->n == first->n && call->root == first->root;
  for (int32_t q = 0; q < g->n && call->function == GATHER_PARTS; q++)
    same &= call->send_bytes[q] == first->send_bytes[q];
  for (int32_t q = 0; q < g->n && call->function == ALL_TO_ALL; q++)
    same &= call->receive_bytes[q] == g->rank[q].call.send_bytes[r];
  if (!same) fail_mismatch(g, 0, r, " with other lengths");
  return same;
}

static int check_calls(thread_group *g) {
  for (int32_t r = 1; r < g->n; r++)
    if (g->rank[r].call.function != g->rank[0].call.function) {
      fail_mismatch(g, 0, r, "");
      return 0;
    }
  for (int32_t r = 0; r < g->n; r++)
    if (g->rank[r].call.function == EXCHANGE ? !check_messages(g, r) : !check_lengths(g, r))
      return 0;
  return 1;
}

/*------------------------------------- calls ----------------------------------------------------*/

static void carry_out(thread_group *g) {
  if (!check_calls(g)) return;
  switch (g->rank[0].call.function) {
    case SUM:
    case MAXIMUM:
      reduce_values(g);
      break;
    case GATHER:
    case GATHER_PARTS:
      gather_values(g);
      break;
    case BROADCAST:
      broadcast_value(g);
      break;
    case ALL_TO_ALL:
      send_all_to_all(g);
      break;
    case EXCHANGE:
      exchange_messages(g);
  }
  g->arrived = 0;
  g->calls++;
  pthread_cond_broadcast(&g->changed);
}

static int is_over(thread_group *g, uint64_t before) { return g->failed || g->calls != before; }

/* Poll twice as long after success, and half as long after failure, as on a busy machine. */
static void wait_for_end(thread_rank *own, uint64_t before) {
  thread_group *g = own->group;
  const int least = g->most_polls / 8;
  for (int i = 0; i < own->polls && !is_over(g, before); i++) ms_pause();
  const int success = is_over(g, before), next = success ? 2 * own->polls : own->polls / 2;
  own->polls = next < least ? least : next < g->most_polls ? next : g->most_polls;
  if (success) return;
  pthread_mutex_lock(&g->lock);
  while (!is_over(g, before)) pthread_cond_wait(&g->changed, &g->lock);
  pthread_mutex_unlock(&g->lock);
}

/* Wait for the other ranks; the last one to come does the work. */
static msim_status make_call(void *self, thread_call call) {
  thread_rank *own = self;
  thread_group *g = own->group;
  pthread_mutex_lock(&g->lock);
  const uint64_t before = g->calls;
  if (!g->failed) {
    own->call = call;
    if (++g->arrived == g->n) carry_out(g);
  }
  pthread_mutex_unlock(&g->lock);
  wait_for_end(own, before);
  return g->calls != before ? MSIM_OK : MSIM_ERR_BACKEND;
}

static msim_status call_sum(void *self, int32_t n, double *values) {
  return make_call(self, (thread_call){.function = SUM, .n = n, .receive = values});
}

static msim_status call_maximum(void *self, int32_t n, double *values) {
  return make_call(self, (thread_call){.function = MAXIMUM, .n = n, .receive = values});
}

static msim_status call_gather(void *self, int64_t bytes, const void *mine, void *all) {
  return make_call(self,
                   (thread_call){.function = GATHER, .n = bytes, .send = mine, .receive = all});
}

static msim_status call_gather_parts(void *self, const int64_t *bytes, const void *mine,
                                     void *all) {
  return make_call(
      self,
      (thread_call){.function = GATHER_PARTS, .send = mine, .receive = all, .send_bytes = bytes});
}

static msim_status call_broadcast(void *self, int32_t root, int64_t bytes, void *data) {
  return make_call(self,
                   (thread_call){.function = BROADCAST, .n = bytes, .root = root, .receive = data});
}

static msim_status call_all_to_all(void *self, const int64_t *send_bytes, const void *send,
                                   const int64_t *receive_bytes, void *receive) {
  return make_call(self, (thread_call){.function = ALL_TO_ALL,
                                       .send = send,
                                       .receive = receive,
                                       .send_bytes = send_bytes,
                                       .receive_bytes = receive_bytes});
}

/* The exchange is carried out at its end. */
static msim_status begin_exchange(void *self, int32_t n, const msim_comm_message *messages) {
  thread_rank *own = self;
  own->call = (thread_call){.function = EXCHANGE, .n = n, .send = messages};
  return MSIM_OK;
}

static msim_status end_exchange(void *self) {
  return make_call(self, ((const thread_rank *)self)->call);
}

static const char *get_reason(void *self) {
  thread_group *g = ((const thread_rank *)self)->group;
  pthread_mutex_lock(&g->lock);
  const char *reason = g->failed ? g->reason : "no call has failed"; /* constant once set */
  pthread_mutex_unlock(&g->lock);
  return reason;
}

/*------------------------------------- creation -------------------------------------------------*/

static msim_comm make_table(thread_group *g, int32_t rank) {
  return (msim_comm){.abi = MSIM_COMM_ABI,
                     .size = sizeof(msim_comm),
                     .name = "threads",
                     .nranks = g->n,
                     .rank = rank,
                     .self = &g->rank[rank],
                     .sum = call_sum,
                     .maximum = call_maximum,
                     .gather = call_gather,
                     .gather_parts = call_gather_parts,
                     .broadcast = call_broadcast,
                     .all_to_all = call_all_to_all,
                     .exchange_begin = begin_exchange,
                     .exchange_end = end_exchange,
                     .reason = get_reason};
}

msim_status msim_comm_threads_create(int32_t nranks, const msim_allocator *alloc, msim_comm **comms,
                                     msim_error *err) {
  if (!comms || nranks < 1)
    return ms_error_set(err, MSIM_ERR_ARG, "nranks is %d, or comms is NULL; nranks must be >= 1",
                        nranks);
  const msim_status status = ms_memory_check_allocator(alloc, err);
  if (status) return status;
  const msim_allocator memory = ms_memory_allocator(alloc);
  thread_group *g = ms_memory_allocate(&memory, 1, sizeof *g);
  if (!g || !MS_NEW(&memory, g->rank, nranks)) {
    ms_memory_free(&memory, g);
    return ms_error_set_memory(err, "the communicator");
  }
  g->alloc = memory, g->n = nranks;
  g->most_polls = nranks <= ms_pool_usable_cores() ? MS_POLLS_BEFORE_SLEEP : 0;
  pthread_mutex_init(&g->lock, NULL);
  pthread_cond_init(&g->changed, NULL);
  for (int32_t r = 0; r < nranks; r++) {
    g->rank[r] = (thread_rank){.comm = make_table(g, r), .group = g, .polls = g->most_polls};
    comms[r] = &g->rank[r].comm;
  }
  return ms_error_clear(err);
}

void msim_comm_threads_fail(msim_comm *comm, const char *reason) {
  thread_group *g = ((const thread_rank *)comm->self)->group;
  pthread_mutex_lock(&g->lock);
  fail_group(g, reason);
  pthread_mutex_unlock(&g->lock);
}

void msim_comm_threads_destroy(msim_comm *comm) {
  if (!comm) return;
  thread_group *g = ((const thread_rank *)comm->self)->group;
  const msim_allocator alloc = g->alloc;
  pthread_cond_destroy(&g->changed);
  pthread_mutex_destroy(&g->lock);
  MS_FREE(&alloc, g->rank, g);
}
