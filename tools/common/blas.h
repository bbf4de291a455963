/* blas - select the kernels of OpenBLAS, which CHOLMOD calls */
#ifndef TOOLS_BLAS_H
#define TOOLS_BLAS_H

/* OpenBLAS 0.3.21 takes AMD's processors with AVX-512 for older ones without, and multiplies dense
 * matrices at half their speed. It reads OPENBLAS_CORETYPE when it is loaded: this sets it to
 * SkylakeX on such a processor, unless it is set. Call it before a plugin is opened; in a static
 * build OpenBLAS is loaded before main, and nothing changes.
 *
 * The kernels determine the order in which CHOLMOD's supernodal factor sums, and so its last bits:
 * a program that sets the same variable gets the bits of msim's programs. */
void blas_choose_kernels(void);

#endif
