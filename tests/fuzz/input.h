/* input - what the bytes of an input decide, one after the other; those that are spent are 0 */
#ifndef FUZZ_INPUT_H
#define FUZZ_INPUT_H

#include <stddef.h>
#include <stdint.h>

#include "msim/status.h"

void input_begin(const uint8_t *data, size_t size);
unsigned input_next(void);

/* Ends of what numbers can be, or something usual. */
double input_number(void);
int64_t input_whole(void);

/* Of a table, a bit for each member that is spoilt: half of all tables are good. */
unsigned input_spoilt(void);

/* Mostly success. Nullable: host, which is told why not. */
msim_status input_answer(const msim_host *host);

/* All bytes left, or NULL; *size of them. */
const uint8_t *input_rest(size_t *size);

/* Until nothing is left: bytes, a number or a flipped bit, somewhere. */
void input_spoil(uint8_t *at, size_t size);

#endif
