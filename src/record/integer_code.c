#include "record/integer_code.h"

static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

enum { PARAMETER_BITS = 6 };

static void put_bit(ms_integer_code *code, uint32_t bit) {
  code->bits = code->bits << 1 | bit;
  if (++code->nbits < 6) return;
  ms_frame_file_write(code->file, &digits[code->bits & 63], 1);
  code->nbits = 0;
}

/* The `count` lowest bits of a number */
static void put_bits(ms_integer_code *code, uint32_t number, int count) {
  while (count-- > 0) put_bit(code, number >> count & 1);
}

static uint32_t shift_right(uint32_t z, int k) { return k < 32 ? z >> k : 0; }

static void put_number(ms_integer_code *code, uint32_t z, int k) {
  if (k < code->width) {
    for (uint32_t ones = shift_right(z, k); ones > 0; ones--) put_bit(code, 1);
    put_bit(code, 0);
  }
  put_bits(code, z, k);
}

/* Bits of the block with the parameter k */
static uint64_t block_length(const ms_integer_code *code, int k) {
  uint64_t bits = (uint64_t)code->count * (uint64_t)(k + (k < code->width));
  for (int i = 0; i < code->count; i++) bits += shift_right(code->block[i], k);
  return bits;
}

static int best_parameter(const ms_integer_code *code) {
  int best = code->width;
  uint64_t least = block_length(code, best);
  for (int k = 0; k < code->width; k++) {
    const uint64_t length = block_length(code, k);
    if (length >= least) continue;
    least = length;
    best = k;
  }
  return best;
}

static void put_block(ms_integer_code *code) {
  const int k = best_parameter(code);
  put_bits(code, (uint32_t)k, PARAMETER_BITS);
  for (int i = 0; i < code->count; i++) put_number(code, code->block[i], k);
  code->count = 0;
}

void ms_integer_code_begin(ms_integer_code *code, ms_frame_file *file, int width) {
  *code = (ms_integer_code){.file = file, .width = width};
}

/* z = 2 r for r >= 0, -2 r - 1 for r < 0 */
void ms_integer_code_put(ms_integer_code *code, uint32_t value) {
  const uint32_t mask = UINT32_MAX >> (32 - code->width);
  const uint32_t negative = value >> (code->width - 1) & 1;
  code->block[code->count++] = (negative ? ~(value << 1) : value << 1) & mask;
  if (code->count == MS_INTEGER_BLOCK) put_block(code);
}

void ms_integer_code_end(ms_integer_code *code) {
  if (code->count > 0) put_block(code);
  while (code->nbits > 0) put_bit(code, 0);
}

int64_t ms_integer_code_bound(int64_t n, int width) {
  const int64_t blocks = (n + MS_INTEGER_BLOCK - 1) / MS_INTEGER_BLOCK;
  return (n * width + blocks * PARAMETER_BITS + 5) / 6;
}
