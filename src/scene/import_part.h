/* import_part - lets a rank read its rows of the arrays of a scene file, and nothing of the others'
 */
#ifndef MS_IMPORT_PART_H
#define MS_IMPORT_PART_H

#include "scene/import_nodes.h"

/* Limit the columns of a scene to the section of part->rank, one of part->nranks (section.h), and
 * set its other members but rows. 0: the scene has to be read as a whole, because it has objects,
 * laws, angular springs, motions, fewer particles than ranks, or arrays whose sizes do not fit;
 * nothing is limited. */
int ms_import_part_select(ms_import_nodes *in, ms_scene_part *part);

/* The scene that was read becomes one without particles, beside its part; takes over the rows. */
msim_status ms_import_part_detach(msim_scene *scene, const ms_scene_part *part, msim_error *err);

#endif
