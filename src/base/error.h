/* error - failures: set the message of an msim_error and return its status */
#ifndef MS_ERROR_H
#define MS_ERROR_H

#include <stdarg.h>

#include "msim/msim.h"

#if defined(__GNUC__)
#  define MS_PRINTF(string, first) __attribute__((format(printf, string, first)))
#else
#  define MS_PRINTF(string, first)
#endif

/* Length of messages, with the terminating zero: the rest of msim_error.text is reserved. */
enum { MS_ERROR_LENGTH = 988 };

/* Set err and return status. Nullable: err. */
msim_status ms_error_set(msim_error *err, msim_status status, const char *format, ...)
    MS_PRINTF(3, 4);
msim_status ms_error_vset(msim_error *err, msim_status status, const char *format, va_list args);

/* The same for a failed allocation: "out of memory for WHAT". */
msim_status ms_error_set_memory(msim_error *err, const char *what);

/* Status of a failed file operation, by its errno. */
msim_status ms_error_io_status(int number);

/* Clear err and return MSIM_OK. Nullable: err. */
msim_status ms_error_clear(msim_error *err);

#endif
