/* amplification - one step of a method on the oscillator x'' = -2 zeta w x' - w^2 x, at z = h w
 *
 * Written from each method's published coefficients or stability function, which the .c file cites
 * and the library uses as well: a comparison checks its code, not the coefficients.
 * tests/test_amplification.c checks those by the order of each method. */
#ifndef BENCH_AMPLIFICATION_H
#define BENCH_AMPLIFICATION_H

/* Advances y = (x, v/w) in place. */
typedef void amplification_step(double zeta, double z, double y[2]);

amplification_step amplify_ssprk102, amplify_ssprk104, amplify_rk6, amplify_rkc, amplify_dop853;
/* r_7 ... r_11 of the polynomial of rk6, found by linear programming (src/methods/rk6_table.h). For
 * tests/test_rk6.c, too */
extern const double amplification_rk6_terms[5];
/* undamped: zeta is ignored */
amplification_step amplify_takahashi_imada, amplify_force_gradient, amplify_rkn6, amplify_respa;

/* Stiffness of the soft spring in amplify_respa over that of the stiff one */
#define SOFT_STIFFNESS 0.09

/* ln of the spectral radius of a step: the growth rate of the amplitude. */
double amplification_rate(amplification_step *step, double zeta, double z);

#endif
