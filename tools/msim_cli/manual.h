/* manual - the manual page msim_cli(1) */
#ifndef CLI_MANUAL_H
#define CLI_MANUAL_H

/* Print it for man (roff). Returns the exit status. */
int manual_print(void);

#endif
