/* kernels - the loops over half springs, one set for each instruction set. They form the same sums
 * in the same order: coefficients and products have the same bits in all sets, passes differ in the
 * last ones (ms_fma). */
#ifndef MS_KERNELS_H
#define MS_KERNELS_H

#include "physics/force.h"
#include "physics/step.h"

typedef struct ms_kernels {
  /* Groups [begin, end) of ms_pass_run. */
  int (*pass)(const ms_model *model, const ms_pass *pass, int32_t begin, int32_t end);
  void (*coefficients)(const ms_model *model, const double *x, double h, int clamp,
                       ms_coefficients *a);
  void (*apply)(const ms_model *model, const ms_coefficients *a, const double *x, double *y);
} ms_kernels;

/* The files compiled for each set name what they define so. */
#ifndef MS_ISA
#  define MS_ISA baseline
#endif
#define MS_JOIN_(name, isa) name##_##isa
#define MS_JOIN(name, isa)  MS_JOIN_(name, isa)
#define MS_FOR_ISA(name)    MS_JOIN(name, MS_ISA)
int MS_FOR_ISA(ms_pass)(const ms_model *model, const ms_pass *pass, int32_t begin, int32_t end);

/* The set of that name: baseline, avx2 or avx512. NULL: not built, or not for this CPU. */
const ms_kernels *ms_kernels_named(const char *isa);

/* The set that MSIM_ISA in the environment names, else the widest one for this CPU. */
const ms_kernels *ms_kernels_best(void);

#endif
