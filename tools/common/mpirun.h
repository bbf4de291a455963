/* mpirun - what the environment of mpirun tells a program before it opens a communicator */
#ifndef TOOLS_MPIRUN_H
#define TOOLS_MPIRUN_H

/* 1: mpirun has started this program, and may have started several processes. */
int mpirun_may_be_several(void);

/* The number of processes that mpirun has started; 0: unknown */
int mpirun_size(void);

/* The rank of this process, 0 if there is one. */
int mpirun_rank(void);

/* Before anything is printed: stdout of all ranks but 0 goes to /dev/null. */
void mpirun_mute(void);

#endif
