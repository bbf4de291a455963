/* The kernels of force_kernels.c in single precision, for each instruction set MS_ISA */
#define MS_SINGLE
#include "physics/force_kernels.c" /* NOLINT(bugprone-suspicious-include): the same source */
