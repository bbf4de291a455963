/* options - the one table of options: struct member, name, range, default and sentence */
#ifndef MS_OPTIONS_H
#define MS_OPTIONS_H

#include "base/text.h"

/* The option of that name, NULL where there is none, and whether its values are numbers. */
const msim_option_entry *ms_option_find(const char *name, int *number);

/* Whether an option whose values are numbers takes this word too: "auto". */
int ms_option_is_word(const msim_option_entry *entry, const char *value);

/* The i-th option as msim_options_set takes it; "" where it was not given. The text is in `number`,
 * or elsewhere. */
const char *ms_option_value(const msim_options *opt, int32_t i, ms_number *number);

/* Check every member against the table. What needs the scene or a registry is checked later. */
msim_status ms_options_check(const msim_options *opt, msim_error *err);

/* A caller's struct of any size into ours, new members at their defaults. */
msim_status ms_options_copy(const msim_options *from, msim_options *to, msim_error *err);

#endif
