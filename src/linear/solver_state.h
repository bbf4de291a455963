/* solver_state - serializes the state of a solver that affects later solves, for checkpoints:
 *
 *   linear solver         auto may have replaced pcg by cholmod for good
 *   lagged factor         its linearization point; its age and cost, which decide on its use
 *   coarse factor         of pcg, likewise
 *   constant matrix       its h, as a scalar matrix is factored once for a whole run
 *   amortization          flops of pcg so far; whether cholmod was opened for a factor, or given up
 *
 * All else is computed anew in each solve. The caller creates the solver for the same h and springs
 * before its state is read. Instead of factors their linearization points are stored, which are
 * hundreds of times smaller and reproduce the factors to the bit. */
#ifndef MS_SOLVER_STATE_H
#define MS_SOLVER_STATE_H

#include "linear/solver.h"

/* Count, write or read all that later solves take over from earlier ones. To be
 * read by a solver created with the same h, and, if ms_solver_choice_depends_on_springs(), the
 * same springs: it then solves to the same bits. After an error, or with invalid bytes, it must not
 * be used. in_use: 1: it has made solves. Factors that it has already are then kept, and a stored
 * state of another linear solver is refused with MSIM_ERR_ARG. */
msim_status ms_solver_state_archive(ms_archive *bytes, ms_solver *solver, int in_use,
                                    msim_error *err);

/* Pass over the state of a solver for n unknowns of the same scene and options; MS_ARCHIVE_READ. */
void ms_solver_state_skip(ms_archive *bytes, const ms_solver *solver, int32_t n);

#endif
