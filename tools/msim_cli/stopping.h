/* stopping - Ctrl-C and other signals end a computation early */
#ifndef CLI_STOPPING_H
#define CLI_STOPPING_H

#include "msim/msim.h"

/* From now on the first signal stops the sim. Signals that the caller ignores, as `nohup` and `&`
 * do, stay ignored. */
void stopping_catch_signals(msim_sim *sim);

int stopping_is_asked(void);

/* To be called before the sim is destroyed. */
void stopping_forget_sim(void);

#endif
