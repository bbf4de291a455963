/* saved_run - the parts of a run that a checkpoint and a clone contain, to be counted, written and
 * read (base/archive.h) */
#ifndef MS_SAVED_RUN_H
#define MS_SAVED_RUN_H

#include "base/archive.h"
#include "sim/sim.h"

/* What islands do not contain */
typedef struct ms_saved_run {
  ms_run_state run;
  double t0;
  double fps, t_end; /* with `every`: these number the frames */
  int64_t every;
  double solver_h; /* s: solvers were chosen for this h; 0: no solver, or none is saved */
  int32_t left_out;
  int32_t saves_last_step; /* 1: a frame lies inside the last step, which is saved, too */
  int32_t h_from_auto;     /* 1: h was chosen from the stability limit */
  int32_t other_springs;   /* 1: solvers were chosen for other springs */
  double tol, first_h;
  ms_method_choice choice;
  msim_stats stats;
  ms_energy_monitor monitor;
  ms_error_growth error_growth;
  int in_use; /* 1: islands are read into those of a sim that has made steps; not saved */
} ms_saved_run;

ms_saved_run ms_saved_run_collect(const msim_sim *sim);

/* To be called before a run is collected whose islands are written: compute the dense output of the
 * last step if it depends on contacts, which are not saved. No bit of the run changes. */
void ms_saved_run_prepare_islands(msim_sim *sim);

void ms_saved_run_archive(ms_archive *b, const msim_sim *sim, ms_saved_run *r);

/* All islands: state, method, solver, last good state. r: that of the run, which was read before.
 * After an error or with invalid bytes (ms_archive_failed) the sim must not be used. With b->rows
 * (rank_rows.h) the islands are those of one process, else those of this sim. */
msim_status ms_saved_run_archive_islands(ms_archive *b, msim_sim *sim, const ms_saved_run *r,
                                         msim_error *err);

/* The same bytes in new memory of the sim, b->data, to be freed by the caller; b then is ready for
 * reading. MSIM_ERR_MEMORY. */
msim_status ms_saved_run_pack_islands(msim_sim *sim, const ms_saved_run *r, ms_archive *b,
                                      msim_error *err);

#endif
