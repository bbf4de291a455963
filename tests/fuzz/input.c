#include "input.h"

#include <math.h>
#include <string.h>

static const uint8_t *bytes;
static size_t left;

void input_begin(const uint8_t *data, size_t size) {
  bytes = data;
  left = size;
}

unsigned input_next(void) {
  if (left == 0) return 0;
  left--;
  return *bytes++;
}

double input_number(void) {
  static const double all[] = {NAN, INFINITY, -INFINITY, 0, -0.0, 1, -1, 1e308, 1e-320, 1e-9};
  const unsigned pick = input_next();
  return pick < sizeof all / sizeof *all ? all[pick] : (double)pick / 100 - 1;
}

int64_t input_integer(void) {
  static const int64_t all[] = {INT64_MAX, INT64_MIN, INT64_MAX / 2 - 1, INT64_MIN / 2 + 1,
                                INT32_MAX, INT32_MIN, UINT32_MAX,        INT64_C(1) << 53};
  const unsigned pick = input_next(), n = sizeof all / sizeof *all;
  return pick < n ? all[pick] : (int64_t)pick - 20;
}

unsigned input_fault_bits(void) {
  const unsigned spoilt = input_next();
  return spoilt & 1 ? spoilt >> 1 | input_next() << 7 : 0;
}

msim_status input_status(const msim_host *host) {
  static const msim_status all[] = {
      MSIM_OK,         MSIM_NOT_CONVERGED, MSIM_NOT_FINITE,  MSIM_STOPPED, MSIM_ERR_ARG,
      MSIM_ERR_MEMORY, MSIM_ERR_NAME,      MSIM_ERR_BACKEND, -99,          77,
      MSIM_NOT_SPD};
  const unsigned pick = input_next();
  if (host && pick & 64) host->fail(host, "%s", "as the input says");
  return pick % 32 < sizeof all / sizeof *all ? all[pick % 32] : MSIM_OK;
}

const uint8_t *input_rest(size_t *size) {
  *size = left;
  return bytes;
}

typedef union word {
  double number;
  int64_t whole;
  uint8_t bytes[8];
} word;

void input_corrupt(uint8_t *at, size_t size) {
  enum { NUMBER, WHOLE, BIT, BYTES, NKINDS };
  while (left > 0 && size > 0) {
    const unsigned what = input_next(), low = input_next(), high = input_next();
    const size_t where = (low + (high << 8) + (what >> 6 << 16)) % size, room = size - where;
    size_t n = sizeof(word);
    word w = {.whole = 0};
    if (what % NKINDS == NUMBER) w.number = input_number();
    if (what % NKINDS == WHOLE) w.whole = input_integer();
    if (what % NKINDS == BYTES) {
      n = 1 + (what >> 2) % sizeof(word);
      for (size_t i = 0; i < sizeof w.bytes; i++) w.bytes[i] = (uint8_t)input_next();
    }
    if (what % NKINDS == BIT) at[where] ^= (uint8_t)(1u << input_next() % 8);
    else memcpy(at + where, w.bytes, n < room ? n : room);
  }
}
