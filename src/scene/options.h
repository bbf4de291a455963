/* options - the table of all options: struct member, name, range, default and description */
#ifndef MS_OPTIONS_H
#define MS_OPTIONS_H

#include "base/text.h"

/* Get the option of this name; NULL: none. *number: whether its values are numbers. */
const msim_option_entry *ms_options_find(const char *name, int *number);

/* What the values of the i-th option are; neither a number nor one of the words of its entry's
 * `values`: any text. Numbers may also be one of these words. */
typedef struct ms_option_values {
  int is_number, is_whole, is_choice;
  double least;        /* of numbers, */
  int open;            /* which is excluded */
  const char *example; /* as JSON; NULL: the default */
} ms_option_values;
void ms_options_get_values(int32_t i, ms_option_values *values);

/* The accepted values as text for messages: "a | b | c" becomes "a, b or c". */
void ms_options_describe_values(const msim_option_entry *entry, size_t size, char *text);

/* Whether this option, whose values are numbers, also accepts the word `value`: "auto". */
int ms_options_accepts_word(const msim_option_entry *entry, const char *value);

/* Value of the i-th option in the form that msim_options_set takes; "" if it is not set. The text
 * is in *number or borrowed from opt. */
const char *ms_options_format_value(const msim_options *opt, int32_t i,
                                    ms_number_text_buffer *number);

/* 1: frames have times of their own, between steps: with error control and without `every`. */
int ms_options_have_frame_times(const msim_options *opt);

/* 1: fixed steps are made with the iterates of solves that reach their limit of iterations. */
int ms_options_accept_incomplete(const msim_options *opt);

/* Check all members by the table. What depends on the scene or a registry is checked later. */
msim_status ms_options_check(const msim_options *opt, msim_error *err);

/* Copy a caller's struct, which may be of an older size; members it lacks get their defaults. */
msim_status ms_options_copy(const msim_options *from, msim_options *to, msim_error *err);

#endif
