/* The kernels of pcg_kernels.c in single precision, for each instruction set MS_ISA */
#define MS_SINGLE
#include "linear/pcg_kernels.c" /* NOLINT(bugprone-suspicious-include): the same source */
