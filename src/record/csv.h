/* csv - the built-in recorder `csv`: writes trajectories as text for spreadsheets and scripts
 *
 * The first line is `step,t,particle,x,y,z,vx,vy,vz`; one line per particle and frame follows.
 * Numbers have 17 digits, which give the same bits when read, and a decimal point in every
 * locale. */
#ifndef MS_CSV_H
#define MS_CSV_H

#include "msim/recorder.h"

const msim_recorder_type *ms_csv_recorder_type(void);

#endif
