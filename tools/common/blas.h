/* blas - which kernels OpenBLAS, behind CHOLMOD, is to take */
#ifndef TOOLS_BLAS_H
#define TOOLS_BLAS_H

/* OpenBLAS 0.3.21 takes AMD's processors with AVX-512 for older ones without, and multiplies dense
 * matrices at half their speed. It reads OPENBLAS_CORETYPE when it is loaded: this sets it to
 * SkylakeX where the processor is such a one and the variable is not set. Before any plugin is
 * opened; in a static build OpenBLAS is there before main, and nothing changes.
 *
 * The kernels decide in which order CHOLMOD's supernodal factor sums, so its last bits differ
 * between them: a program of your own gets the bits of ours where it sets the same variable. */
void choose_blas_kernels(void);

#endif
