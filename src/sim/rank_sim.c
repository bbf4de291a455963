#include "sim/rank_sim.h"

#include <stdio.h>
#include <string.h>

#include "base/archive.h"
#include "base/comm_plugin.h"
#include "base/isa.h"
#include "linear/backends.h"
#include "sim/refusal.h"

/*------------------------------------- creation -------------------------------------------------*/

msim_status ms_rank_sim_join(const msim_comm *comm, const msim_allocator *alloc, ms_ranks **ranks,
                             msim_error *err) {
  *ranks = NULL;
  if (!comm) return MSIM_OK;
  const msim_status status = ms_comm_plugin_check(comm, err);
  if (status || comm->nranks == 1) return status;
  *ranks = ms_ranks_create(comm, alloc);
  double missing = *ranks ? 0 : 1; /* a sum needs no memory */
  const msim_status failed = comm->sum(comm->self, 1, &missing);
  if (!failed && missing == 0) return MSIM_OK;
  ms_ranks_destroy(alloc, *ranks);
  *ranks = NULL;
  if (!failed) return ms_error_set_memory(err, "the communicator");
  return ms_error_set(err, failed, "communicator '%s': %s", comm->name, comm->reason(comm->self));
}

/*------------------------------------- refusals -------------------------------------------------*/

static int any_rank_is_empty(const ms_rank_part *part) {
  for (int32_t r = 0; r < part->ranks->n; r++)
    if (part->bytes[r] == 0) return 1;
  return 0;
}

/* Of implicit methods */
static ms_refusal find_refused_system(const msim_sim *sim) {
  const msim_options *opt = &sim->config.opt;
  if (strcmp(opt->solver, "pcg") != 0 && !ms_backends_supports_ranks(opt, &sim->alloc))
    return (ms_refusal){"that solver", "use solver = pcg or petsc"};
  if (opt->indefinite == MSIM_INDEFINITE_SOLVE)
    return (ms_refusal){"indefinite = solve", "use indefinite = clamp"};
  if (any_rank_is_empty(sim->part))
    return (ms_refusal){"fewer free particles than ranks", "use fewer ranks"};
  return (ms_refusal){NULL, NULL};
}

static ms_refusal find_refused_option(const msim_sim *sim) {
  const msim_options *opt = &sim->config.opt;
  if (ms_sim_has_control(sim) && ms_scene_has_obstacles(sim->scene))
    return (ms_refusal){"error control (tol; dop853 without steps) at planes and colliders",
                        "set steps, and tol = 0"};
  if (opt->collision == MSIM_COLLISION_EVENT && ms_scene_has_obstacles(sim->scene))
    return (ms_refusal){"collision = event", "use collision = reflect"};
  if (opt->contacts != MSIM_CONTACTS_OFF)
    return (ms_refusal){"contacts = on", "use contacts = off"};
  if (sim->config.integrator->entry.implicit) return find_refused_system(sim);
  return (ms_refusal){NULL, NULL};
}

msim_status ms_rank_sim_check(msim_sim *sim, msim_error *err) {
  if (!sim->part) return MSIM_OK;
  const ms_integrator *method = sim->config.integrator;
  const int32_t n = sim->part->ranks->n;
  if (ms_sim_selects(sim) || method->is_multirate)
    return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                        "%d ranks do not support integrator '%s'; use velocity-verlet, "
                        "linearly-implicit-euler, or one process",
                        n, ms_sim_selects(sim) ? "auto" : method->entry.name);
  if (strcmp(sim->config.opt.solver, "auto") == 0) sim->config.opt.solver = "pcg";
  char ranks[32];
  snprintf(ranks, sizeof ranks, "%d ranks do", n);
  return ms_refusal_report(find_refused_option(sim), ranks, "use one process", err);
}

msim_status ms_rank_sim_refuse(const msim_sim *sim, const char *function, msim_error *err) {
  if (!sim->part) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_UNSUPPORTED,
                      "%s is not supported where %d ranks share the scene; use one process",
                      function, sim->part->ranks->n);
}

/*------------------------------------- the same scene -------------------------------------------*/

static uint64_t hash_motion(uint64_t hash, const ms_motion *m) {
  const int32_t numbers[3] = {m->n, m->nt, m->interpolation};
  const size_t nt = (size_t)m->nt, n = (size_t)m->n;
  hash = ms_archive_hash(hash, numbers, sizeof numbers);
  if (m->particles) hash = ms_archive_hash(hash, m->particles, n * sizeof *m->particles);
  hash = ms_archive_hash(hash, m->t, nt * sizeof *m->t);
  return ms_archive_hash(hash, m->x, 3 * nt * n * sizeof *m->x);
}

uint64_t ms_rank_sim_hash_obstacles(uint64_t hash, const ms_scene *s) {
  hash = ms_archive_hash(hash, &s->planes_constrain, sizeof s->planes_constrain);
  for (int32_t i = 0; i < s->nmotions; i++) hash = hash_motion(hash, &s->motions[i]);
  for (int32_t i = 0; i < s->ncolliders; i++) {
    hash = ms_colliders_hash(&s->colliders[i], hash);
    hash = hash_motion(hash, &s->collider_motions[i].x);
    hash = hash_motion(hash, &s->collider_motions[i].rotation);
  }
  return hash;
}

/* Of the arrays that ranks divide, unless they have read them in parts, and of what decides which
 * calls they make */
static uint64_t hash_sim(const msim_sim *sim) {
  const ms_scene *s = sim->scene;
  const msim_options *opt = &sim->config.opt;
  const size_t n = sim->kept ? 0 : (size_t)s->nparticles, m = sim->kept ? 0 : (size_t)s->nsprings,
               real = sizeof(double);
  const double numbers[] = {opt->h,
                            (double)opt->steps,
                            opt->t_end,
                            opt->collision,
                            (double)opt->every,
                            opt->fps,
                            opt->tol,
                            opt->skip_off,
                            opt->watch,
                            opt->solver_rtol,
                            opt->solver_max_iterations,
                            opt->newton_rtol,
                            opt->newton_max_iterations,
                            opt->newton_retries,
                            opt->jacobian,
                            opt->indefinite,
                            opt->incomplete,
                            opt->heun_collision,
                            opt->verlet_start,
                            ms_isa_choose()};
  const struct {
    const void *data;
    size_t bytes;
  } parts[] = {{s->x, 3 * n * real},
               {s->v, 3 * n * real},
               {s->mass, n * real},
               {s->pinned, n},
               {s->force, s->force ? 3 * n * real : 0},
               {s->ij, 2 * m * sizeof *s->ij},
               {s->k, m * real},
               {s->rest, m * real},
               {s->damping, m * real},
               {s->law, s->law ? m * sizeof *s->law : 0},
               {s->angles.ijk, 3 * (size_t)s->angles.n * sizeof *s->angles.ijk},
               {s->planes, (size_t)s->nplanes * sizeof *s->planes},
               {&s->external, sizeof s->external},
               {opt->integrator, strlen(opt->integrator)},
               {opt->solver, strlen(opt->solver)},
               {opt->solver_options, opt->solver_options ? strlen(opt->solver_options) : 0},
               {numbers, sizeof numbers}};
  uint64_t hash = 0;
  for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
    hash = ms_archive_hash(hash, parts[i].data, parts[i].bytes);
  return ms_rank_sim_hash_obstacles(hash, s);
}

msim_status ms_rank_sim_compare(const msim_sim *sim, msim_error *err) {
  if (!sim->ranks) return MSIM_OK;
  if (ms_ranks_have_same(sim->ranks, hash_sim(sim))) return MSIM_OK;
  if (sim->ranks->failed) return ms_ranks_agree(sim->ranks, MSIM_OK, err);
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the %d ranks have different scenes or options, or processors with different "
                      "instruction sets (set MSIM_ISA); create all sims from the same ones",
                      sim->ranks->n);
}

/*------------------------------------- steps ----------------------------------------------------*/

/* Bits of ms_agreement */
enum { RESTS = 1, STOPS = 2, INCOMPLETE = 4, CACHES_NOTHING = 8 };

/* A rank has one island. The rank that has the offending particle reports it. Where a failed force
 * function has left no cached stages on one rank, no rank goes on from its own. */
msim_status ms_rank_sim_agree_on_step(msim_sim *sim, msim_status status, msim_error *err) {
  if (!sim->part) return status;
  ms_island_sim *m = sim->islands;
  const ms_stepper *s = &m->stepper;
  ms_agreement bits = {.all = m->at_rest_next ? RESTS : 0,
                       .any = (atomic_load(&sim->stop) ? STOPS : 0) |
                              (s->incomplete ? INCOMPLETE : 0) |
                              (s->cached_stage ? 0 : CACHES_NOTHING),
                       .precedes = s->offender >= 0};
  status = ms_ranks_agree_on(sim->ranks, status, &bits, err);
  m->at_rest_next = (bits.all & RESTS) != 0;
  m->stepper.incomplete = (bits.any & INCOMPLETE) != 0;
  if (bits.any & CACHES_NOTHING) m->stepper.cached_stage = 0;
  sim->ranks_stop = (bits.any & STOPS) != 0;
  return status;
}

int ms_rank_sim_takes_stop(msim_sim *sim) {
  if (!sim->part) return atomic_exchange(&sim->stop, 0);
  const int stops = sim->ranks_stop;
  if (stops) atomic_store(&sim->stop, 0);
  sim->ranks_stop = 0;
  return stops;
}
