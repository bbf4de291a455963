/* scaling_model - the time of a step on many ranks from constants that few ranks show
 *
 * n particles on P ranks, 64 on each node:
 *     T_explicit = c n/P + neighbours alpha + B/beta + alpha log2 P
 *     T_iteration = c_i n/P + neighbours alpha + B/beta + m alpha log2 P
 * c: seconds a particle and step, or iteration, of one process; B: bytes that a node sends to
 * others in an exchange, of the ghosts of its part; m: collective calls an iteration. */
#ifndef BENCH_SCALING_MODEL_H
#define BENCH_SCALING_MODEL_H

enum { MODEL_GHOST_BYTES = 24 }; /* positions */

/* Ghosts of a part of n particles inside a larger scene, s = n^(1/d) along an edge:
 * cloth 8 s + 16 (two layers, as bending springs reach), solid 6 s^2 + 12 s + 8 (one). */
double model_ghosts(int is_solid, double n);

/* The same for one half of a scene of n particles: two layers, or one, along one side */
double model_ghosts_of_half(int is_solid, double n);

/* Seconds; per_particle: c or c_i; collectives: 1 or m */
double model_seconds(int is_solid, double n, double ranks, double per_particle, double collectives);

#endif
