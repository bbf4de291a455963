/* standard - standard files and signals of the programs */
#ifndef TOOLS_STANDARD_H
#define TOOLS_STANDARD_H

/* Call first in main: what is printed cannot end up in another file, and no failed write is a
 * signal. */
void standard_begin(void);

/* Call last in main: reports errors of buffered output. Returns `status`, or EXIT_ERROR. */
int standard_end(int status);

#endif
