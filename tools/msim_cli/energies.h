/* energies - the table of --energies: a line of text with the energies of each frame
 *
 * The first line is `step,t,kinetic,elastic,gravitational,total`; t in s, energies in J. Numbers
 * have 17 digits, which give the same bits when read. Each line is in the file before the run goes
 * on. */
#ifndef CLI_ENERGIES_H
#define CLI_ENERGIES_H

#include "../common/output.h"
#include "msim/msim.h"

/* The beginning of every table, by which it is recognized. */
extern const char energies_beginning[];

typedef struct energies {
  output_file start; /* the table until energies_start */
  FILE *stream;      /* NULL: no table */
} energies;

/* Open a new table, under its temporary name. Prints errors. */
int energies_open(energies *table, const char *path);

/* Give the table its name. resumed: put the lines of an older table from before the sim's time into
 * it first, and then the present one. Prints errors. */
int energies_start(energies *table, msim_sim *sim, int resumed);

/* Add the line of the present state. Not without a table, nor where energies are not finite. */
msim_status energies_write(energies *table, msim_sim *sim, msim_error *err);

/* Accepts a table that is not open. */
void energies_close(energies *table);

#endif
