/* overhead - what the watch costs */
#ifndef BENCH_OVERHEAD_H
#define BENCH_OVERHEAD_H

/* Its share of the instructions of an explicit run at cloth 100, counted by callgrind with AVX2;
 * NAN where valgrind or msim_cli is not there. */
double watch_overhead(void);

#endif
