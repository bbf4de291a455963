/* rank_sim - a sim that shares its scene with other ranks: what it refuses, and what it adds up */
#ifndef MS_RANK_SIM_H
#define MS_RANK_SIM_H

#include "sim/sim.h"

/* The ranks of a communicator, which share a scene; *ranks NULL: comm is NULL or has one rank.
 * Collective; no memory on one rank is a failure on all. */
msim_status ms_rank_sim_join(const msim_comm *comm, const msim_allocator *alloc, ms_ranks **ranks,
                             msim_error *err);

/* Refuse options and scenes that ranks do not support; solver = auto becomes pcg. */
msim_status ms_rank_sim_check(msim_sim *sim, msim_error *err);

/* Of motions, of colliders with theirs, and of whether planes constrain */
uint64_t ms_rank_sim_hash_obstacles(uint64_t hash, const ms_scene *scene);

/* Refuse scenes or options that differ between ranks; collective. */
msim_status ms_rank_sim_compare(const msim_sim *sim, msim_error *err);

/* Refuse a function of the API in a sim of several ranks. */
msim_status ms_rank_sim_refuse(const msim_sim *sim, const char *function, msim_error *err);

/* After a step: all ranks return the first status of any that is not MSIM_OK, agree on whether one
 * of them was asked to stop, and rest only if all do. */
msim_status ms_rank_sim_agree_on_step(msim_sim *sim, msim_status status, msim_error *err);

/* In one process: the request to stop, which is cleared; else what all ranks have agreed on. */
int ms_rank_sim_takes_stop(msim_sim *sim);

#endif
