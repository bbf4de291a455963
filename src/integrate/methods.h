/* methods - the list of all time integration methods, in the order in which msim lists them */
#ifndef MS_METHODS_H
#define MS_METHODS_H

#include "integrate/integrator.h"

#define MS_INTEGRATORS(X)       \
  X(ms_explicit_euler)          \
  X(ms_heun)                    \
  X(ms_verlet)                  \
  X(ms_linearly_implicit_euler) \
  X(ms_symplectic_euler)        \
  X(ms_velocity_verlet)         \
  X(ms_respa)                   \
  X(ms_rk4)                     \
  X(ms_rkc)                     \
  X(ms_takahashi_imada)         \
  X(ms_force_gradient)          \
  X(ms_rkn6)                    \
  X(ms_dop853)                  \
  X(ms_implicit_euler)          \
  X(ms_implicit_midpoint)       \
  X(ms_trapezoidal)             \
  X(ms_newmark)                 \
  X(ms_bdf2)                    \
  X(ms_tr_bdf2)                 \
  X(ms_sdirk2)

#define MS_DECLARE(table) extern const ms_integrator table;
MS_INTEGRATORS(MS_DECLARE)
#undef MS_DECLARE

/* The stability limit (s) of symplectic Euler and Verlet */
double ms_verlet_limit(const ms_bounds *b);

#endif
