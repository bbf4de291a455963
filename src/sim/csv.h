/* csv - the built-in recorder `csv`: text for spreadsheets and scripts.
 *
 * The first line is `step,t,particle,x,y,z,vx,vy,vz`; then one line a particle a frame. Numbers
 * have 17 digits, so reading them back gives the same bits, and a point whatever the locale. */
#ifndef MS_CSV_H
#define MS_CSV_H

#include "msim/recorder.h"

const msim_recorder_type *ms_recorder_csv(void);

#endif
