/* pvd - the built-in recorder `pvd`: writes trajectories for any version of ParaView
 *
 * run.pvd lists the frames, which are the files run_frames/000000.vtp, ... (vtp.h). It is created
 * with a line of blanks for each planned frame. A frame is added by writing its line, once its file
 * is complete: lines have a power of two bytes, so that none crosses a page of the file, and a run
 * that is killed leaves a valid file with the frames so far. Files in the folder that are not
 * frames of msim are never changed. */
#ifndef MS_PVD_H
#define MS_PVD_H

#include "msim/recorder.h"

const msim_recorder_type *ms_pvd_recorder_type(void);

#endif
