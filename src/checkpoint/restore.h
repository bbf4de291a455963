/* restore - put a sim into the state of a saved run (saved_run.h) */
#ifndef MS_RESTORE_H
#define MS_RESTORE_H

#include "checkpoint/saved_run.h"

/* Read a run that ms_saved_run_archive(), ms_saved_scene_write_changes(), _springs() and
 * ms_saved_run_archive_islands() have written, with the same fingerprint; on failure the sim stays
 * as it was. Its islands are read where they are if they fit, which neither analyzes nor allocates
 * but for a copy of them; else new ones are built. */
msim_status ms_restore_run(msim_sim *sim, ms_archive *b, msim_error *err);

/* Build the islands of a sim that has none yet, for solvers chosen for the springs of `chosen_for`
 * (NULL: of its scene), and put it into this run. After an error it must be destroyed. */
msim_status ms_restore_copy(msim_sim *copy, ms_scene *chosen_for, ms_archive *islands,
                            const ms_saved_run *r, msim_error *err);

#endif
