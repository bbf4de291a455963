/* comparison - `msim_cli explain` of a scene without an integrator: what four methods would cost in
 * it, and which one is recommended */
#ifndef CLI_COMPARISON_H
#define CLI_COMPARISON_H

#include "setup.h"

/* Print the table to stdout. Returns EXIT_OK, or EXIT_ERROR where all four are refused. */
int comparison_print(const setup *made);

#endif
