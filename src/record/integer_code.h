/* integer_code - writes a sequence of small integers as text of few characters
 *
 * Golomb-Rice codes (R. F. Rice, JPL Publication 79-22, 1979) in blocks of 64 integers. A block
 * begins with its parameter k in 6 bits. An integer r of `width` bits, in two's complement, is
 * mapped to z = 0, 1, 2, ... for r = 0, -1, 1, ...; its code is z >> k ones, a zero, and the k
 * lowest bits of z; for k = width it is the bits of z alone. Of all k the one with the shortest
 * block is chosen. Bits are written from the highest on, six to a character of the alphabet of
 * base64; the last character is filled up with zeros. */
#ifndef MS_INTEGER_CODE_H
#define MS_INTEGER_CODE_H

#include "record/frame_file.h"

enum { MS_INTEGER_BLOCK = 64 };

typedef struct ms_integer_code {
  ms_frame_file *file;
  int width; /* bits of an integer, at most 32 */
  int count; /* integers in the block */
  uint32_t block[MS_INTEGER_BLOCK];
  int nbits; /* bits that do not fill a character yet */
  uint32_t bits;
} ms_integer_code;

void ms_integer_code_begin(ms_integer_code *code, ms_frame_file *file, int width);
void ms_integer_code_put(ms_integer_code *code, uint32_t value); /* modulo 2^width */
void ms_integer_code_end(ms_integer_code *code);

/* The most characters that n integers take */
int64_t ms_integer_code_bound(int64_t n, int width);

#endif
