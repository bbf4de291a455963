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
  X(ms_ssprk102)                \
  X(ms_ssprk104)                \
  X(ms_rk6)                     \
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

/* The i-th method of this version; NULL past the end. */
const ms_integrator *ms_methods_at(int32_t i);

/* The value of option `integrator` for which the sim chooses the method */
#define MS_AUTO "auto"

/* The method of this name; MSIM_ERR_NAME: there is none. */
msim_status ms_methods_find(const char *name, const ms_integrator **integrator, msim_error *err);

#endif
