/* checking_backend - a backend around another one: passes every call on, and checks that the host
 * keeps what backend.h promises on the way in, and the backend on the way out. */
#ifndef CHECKING_BACKEND_H
#define CHECKING_BACKEND_H

#include "msim/backend.h"

/* A table like `inner`, with every call checked. It is valid until the next call of this: one inner
 * backend at a time, any number of instances and threads. */
const msim_backend *checking_backend(const msim_backend *inner);

/* What was found since it was asked last: sentences that begin with "host: " or "backend: ", one a
 * line; "" where all is well. Ask when no instance lives. */
const char *checking_report(void);

#endif
