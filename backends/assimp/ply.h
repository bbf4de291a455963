/* ply - whether a PLY file has what its header states (Turk, The PLY Polygon File Format, 1994) */
#ifndef MSIM_ASSIMP_PLY_H
#define MSIM_ASSIMP_PLY_H

#include "msim/importer.h"

/* libassimp 5.2 returns faces of zeros for those that a truncated file lacks, ignores those beyond
 * the stated number, reads damaged headers forever, and makes room for all elements and corners
 * that a file states. Succeeds for files that do not begin as PLY do. */
msim_status assimp_ply_check(const msim_host *host, const char *path);

#endif
