/* refusal - what an option or a feature excludes, and what to use instead */
#ifndef MS_REFUSAL_H
#define MS_REFUSAL_H

#include "base/error.h"

typedef struct ms_refusal {
  const char *what, *remedy; /* NULL: it excludes nothing */
} ms_refusal;

/* MSIM_ERR_UNSUPPORTED if there is something: "SUBJECT not support WHAT; REMEDY, or OTHERWISE" */
static inline msim_status ms_refusal_report(ms_refusal r, const char *subject,
                                            const char *otherwise, msim_error *err) {
  if (!r.what) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_UNSUPPORTED, "%s not support %s; %s, or %s", subject, r.what,
                      r.remedy, otherwise);
}

#endif
