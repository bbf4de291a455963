/* tables - the tables of --energies, --reactions and --springs: lines of text for each frame
 *
 * energies:  step,t,kinetic,elastic,gravitational,total,work; a line a frame
 * reactions: step,t,particle,fx,fy,fz; a line for each pinned particle, see msim_sim_reactions
 * springs:   step,t,spring,tension,elongation,strain; a line for each one, see msim_sim_springs
 *
 * t in s, energies in J, forces in N, elongations in m. Numbers have 17 digits, which give the same
 * bits when read. Each frame is in the file before the run goes on. */
#ifndef CLI_TABLES_H
#define CLI_TABLES_H

#include "../common/output.h"
#include "msim/msim.h"

typedef enum table_kind { TABLE_ENERGIES, TABLE_REACTIONS, TABLE_SPRINGS, NTABLES } table_kind;

typedef struct table {
  table_kind kind;
  const msim_scene *scene; /* not of energies */
  output_file start;       /* the table until table_start */
  FILE *stream;            /* NULL: no table */
  double *values;          /* memory for the numbers of a frame */
} table;

/* "energies", the flag and what its file holds */
const char *table_name(table_kind kind);

/* The first line of every such table, by which it is recognized. */
const char *table_title(table_kind kind);

/* Open a new table, under its temporary name. Prints errors. Call table_close in any case. */
int table_open(table *t, table_kind kind, const msim_scene *scene, const char *path);

/* Give the table its name. resumed: put the lines of an older table from before the sim's time into
 * it first, and then the present ones. Prints errors. */
int table_start(table *t, msim_sim *sim, int resumed);

/* Add the lines of the present state. Not without a table, nor where energies are not finite. */
msim_status table_write(table *t, msim_sim *sim, msim_error *err);

/* Accepts a table that is not open. */
void table_close(table *t);

#endif
