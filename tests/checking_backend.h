/* checking_backend - a solver backend that wraps another one, passes every call on, and checks the
 * contract of backend.h in both directions: the arguments of the host and the results of the
 * backend */
#ifndef CHECKING_BACKEND_H
#define CHECKING_BACKEND_H

#include "msim/backend.h"

/* A function table like `inner` with every call checked. It is valid until the next call of this
 * function: one inner backend at a time, any number of instances and threads. */
const msim_backend *checking_backend(const msim_backend *inner);

/* The violations found since the last call of this function: sentences that begin with "host: " or
 * "backend: ", one a line; "" if there are none. Call it only while no instance exists. */
const char *checking_report(void);

#endif
