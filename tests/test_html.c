/* Tests of the built-in recorder html from inside: the code of integers, lack of memory, a full
 * disk. test_html.py decodes pages. */
#define _POSIX_C_SOURCE 200809L

#include <signal.h>
#include <sys/resource.h>

#include "testing.h"
#include "sample_recording.h"
#include "record/html.h"
#include "record/integer_code.h"

static counting_host host;

/*------------------------------------- code of integers -----------------------------------------*/

typedef struct bit_reader {
  const char *text;
  int64_t at; /* bits read */
} bit_reader;

static uint32_t read_bits(bit_reader *r, int count) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  uint32_t number = 0;
  for (; count > 0; count--, r->at++) {
    const uint32_t digit = (uint32_t)(strchr(digits, r->text[r->at / 6]) - digits);
    number = number << 1 | (digit >> (5 - r->at % 6) & 1);
  }
  return number;
}

static uint32_t read_integer(bit_reader *r, int k, int width) {
  uint64_t high = 0;
  if (k < width)
    while (read_bits(r, 1)) high++;
  const uint32_t z = (uint32_t)(high << k) + read_bits(r, k);
  return z & 1 ? ~(z >> 1) : z >> 1;
}

/* Write integers and read them back; returns the number of characters. */
static size_t assert_round_trip(const uint32_t *values, int32_t n, int width) {
  static ms_frame_file file;
  static ms_integer_code code;
  size_t length = 0;
  const msim_recording what = {.path = "integers"};
  ms_frame_file_open(&file, &host.host, &what, "integers");
  ms_integer_code_begin(&code, &file, width);
  for (int32_t i = 0; i < n; i++) ms_integer_code_put(&code, values[i]);
  ms_integer_code_end(&code);
  assert_int_equal(ms_frame_file_end_frame(&file), MSIM_OK);
  assert_int_equal(ms_frame_file_close(&file), MSIM_OK);
  char *text = read_file("integers", &length);
  bit_reader r = {.text = text};
  const uint32_t mask = UINT32_MAX >> (32 - width);
  int k = 0;
  for (int32_t i = 0; i < n; i++) {
    if (i % MS_INTEGER_BLOCK == 0) k = (int)read_bits(&r, 6);
    assert_int_equal(read_integer(&r, k, width) & mask, values[i] & mask);
  }
  assert_int_equal(length, (r.at + 5) / 6);
  assert_true((int64_t)length <= ms_integer_code_bound(n, width));
  free(text);
  remove("integers");
  return length;
}

static void integers_of_all_sizes(void **state) {
  (void)state;
  enum { N = 1000 };
  uint32_t values[N], random = 1;
  const int widths[] = {8, 16, 32};
  host_init(&host);
  for (int w = 0; w < 3; w++)
    for (int bits = 0; bits <= widths[w]; bits++) {
      for (int i = 0; i < N; i++) {
        random = random * 1664525u + 1013904223u;
        const uint32_t size = bits ? random >> (32 - bits) : 0;
        values[i] = random & 64 ? size : ~size;
      }
      assert_round_trip(values, N, widths[w]);
      assert_round_trip(values, 1, widths[w]);
    }
  assert_round_trip(values, 0, 32);
}

static void small_integers_are_short(void **state) {
  (void)state;
  enum { N = 6400 };
  static uint32_t values[N];
  host_init(&host);
  assert_int_equal(assert_round_trip(values, N, 16), (N + 100 * 6 + 5) / 6); /* a bit each */
  for (int i = 0; i < N; i++) values[i] = (uint32_t)(i % 4 - 2); /* z < 4: 3 bits at most */
  assert_true(assert_round_trip(values, N, 16) <= (3 * N + 100 * 6 + 5) / 6);
}

/*------------------------------------- failures -------------------------------------------------*/

enum { LARGE = 4000000 };

static void init_sample(sample_trajectory *s, int32_t n, int64_t nframes) {
  static const uint8_t pinned[LARGE];
  host_init(&host);
  sample_init(s, "a.html", n, n == LARGE ? 0 : n / 2, nframes);
  s->what.pinned = pinned;
  s->what.title = "made up";
}

static void lack_of_memory(void **state) {
  (void)state;
  sample_trajectory s;
  void *self;
  for (int at = 1; at <= 2; at++) {
    init_sample(&s, 100, 3);
    host.fail_at = at;
    assert_int_equal(ms_html_recorder_type()->open(&host.host, &s.what, &self), MSIM_ERR_MEMORY);
    assert_non_null(strstr(host.sentence, "a.html: out of memory"));
    assert_true(self == NULL && host.live == 0);
    sample_free(&s);
  }
}

static void too_many_particles(void **state) {
  (void)state;
  sample_trajectory s;
  void *self;
  init_sample(&s, LARGE, 2);
  assert_int_equal(ms_html_recorder_type()->open(&host.host, &s.what, &self), MSIM_ERR_ARG);
  assert_non_null(strstr(host.sentence,
                         "a.html: 4000000 particles and 0 springs are too many for a "
                         "page, which is limited to 100 MB; record a .vtkhdf"));
  assert_int_equal(host.live, 0);
  sample_free(&s);
  remove("a.html");
}

static int64_t count_lines(const char *path) {
  char *text = read_file(path, NULL);
  const char *next = strstr(text, "id=\"recording\">\n");
  int64_t lines = -2; /* the mark's own and that of the scene */
  for (; (next = strchr(next, '\n')) != NULL; next++) lines++;
  const size_t length = strlen(text);
  assert_int_equal(text[length - 1], '\n');
  free(text);
  return lines;
}

static void a_full_disk_leaves_whole_frames(void **state) {
  (void)state;
  sample_trajectory s;
  void *self;
  size_t length = 0;
  const msim_recorder_type *html = ms_html_recorder_type();
  struct rlimit limit;
  init_sample(&s, 100, 1000);
  assert_int_equal(html->open(&host.host, &s.what, &self), MSIM_OK);
  free(read_file("a.html", &length));
  signal(SIGXFSZ, SIG_IGN);
  getrlimit(RLIMIT_FSIZE, &limit);
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = length + 5000;
  setrlimit(RLIMIT_FSIZE, &limit);
  int64_t good = 0;
  for (;; good++) {
    msim_frame frame = sample_frame(&s, good);
    if (html->write(self, &frame) != MSIM_OK) break;
  }
  limit.rlim_cur = before;
  setrlimit(RLIMIT_FSIZE, &limit);
  signal(SIGXFSZ, SIG_DFL);
  assert_in_range(good, 1, 20);
  assert_int_equal(html->close(self), MSIM_ERR_IO);
  assert_non_null(strstr(host.sentence, "a.html: cannot write the file: File too large"));
  assert_int_equal(count_lines("a.html"), good);
  assert_int_equal(host.live, 0);
  sample_free(&s);
  remove("a.html");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(integers_of_all_sizes),
      cmocka_unit_test(small_integers_are_short),
      cmocka_unit_test(lack_of_memory),
      cmocka_unit_test(too_many_particles),
      cmocka_unit_test(a_full_disk_leaves_whole_frames),
  };
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
