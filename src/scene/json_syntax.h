/* json_syntax - messages for texts that are not JSON: what is wrong, where, and how to mend it */
#ifndef MS_JSON_SYNTAX_H
#define MS_JSON_SYNTAX_H

#include "scene/json_reader.h"

/* Refuse a text that jansson has refused with this error. */
msim_status ms_json_syntax_refuse(const ms_json_reader *r, const char *text, size_t length,
                                  const json_error_t *error);

#endif
