/* ranks - run one scene in all processes that mpirun has started: who prints, and what all know
 *
 * Rank 0 alone prints and writes files. All ranks make the same calls of the library, so that what
 * decides on them, as the failure of one rank, is agreed on. In a program that mpirun has not
 * started, or alone, nothing is opened, and the functions do nothing. */
#ifndef CLI_RANKS_H
#define CLI_RANKS_H

#include "arguments.h"

/* Before anything is printed: mute all ranks but 0. */
void ranks_begin(void);

/* Open the plugin `mpi`. */
int ranks_open(const arguments *args);

/* Refuse command lines and files that differ between ranks, after ranks_open. status: of loading
 * the scene on this rank. *comm: for the options of the sim, NULL if there is one rank. Returns the
 * status that all share. */
int ranks_join(const arguments *args, int status, const msim_comm **comm);

/* The number of this rank, and how many there are: 0 and 1 before ranks_open and in one process */
int ranks_number(void);
int ranks_count(void);

/* 1: this process prints and writes files. */
int ranks_has_files(void);

/* The first status of any rank that is not 0, on all of them; rank 0 prints its message. */
int ranks_agree(int status);

/* The largest value of any rank */
double ranks_maximum(double value);

/* Wait for all ranks, and close what was opened. Returns the exit status. */
int ranks_end(int status);

#endif
