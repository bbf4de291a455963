/* watch_overhead - measures the cost of the energy monitor (option `watch`) */
#ifndef BENCH_WATCH_OVERHEAD_H
#define BENCH_WATCH_OVERHEAD_H

/* Its share of the instructions of an explicit run of a 100 x 100 cloth, counted by callgrind with
 * AVX2; NAN without valgrind or msim_cli. */
double watch_overhead(void);

#endif
