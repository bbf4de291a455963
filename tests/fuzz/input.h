/* input - reads values from the bytes of a fuzzer's input, one after the other; zeros when none are
 * left */
#ifndef FUZZ_INPUT_H
#define FUZZ_INPUT_H

#include <stddef.h>
#include <stdint.h>

#include "msim/status.h"

void input_begin(const uint8_t *data, size_t size);
unsigned input_next(void);

/* Limits of the type and special values, or an ordinary number. */
double input_number(void);
int64_t input_integer(void);

/* One bit for each member of a function table that is to be wrong; 0 for half of all tables. */
unsigned input_fault_bits(void);

/* A status, mostly success; with an error message to host, if any and if the input says so. */
msim_status input_status(const msim_host *host);

/* The bytes that are left; *size: their number. */
const uint8_t *input_rest(size_t *size);

/* Overwrite bytes or numbers or flip bits at random places, until no input is left. */
void input_corrupt(uint8_t *at, size_t size);

#endif
