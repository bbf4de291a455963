/* amplification - one step of a method on the oscillator x'' = -2 zeta w x' - w^2 x, at z = h w
 *
 * Written from each method's published coefficients or stability function, which the .c file
 * names. The library has the same sources, so this checks its code, not their numbers: those,
 * tests/test_amplification.c holds to the order of each method. */
#ifndef BENCH_AMPLIFICATION_H
#define BENCH_AMPLIFICATION_H

/* In place: y = (x, v/w) */
typedef void amplification(double zeta, double z, double y[2]);

amplification amplify_rkc, amplify_dop853;
/* without damping */
amplification amplify_takahashi_imada, amplify_force_gradient, amplify_rkn6, amplify_respa;

/* Of the second spring beside the one of w in amplify_respa, over that of w */
#define SOFT_STIFFNESS 0.09

/* The logarithm of the spectral radius: how the amplitude grows in a step. */
double amplification_rate(amplification *step, double zeta, double z);

#endif
