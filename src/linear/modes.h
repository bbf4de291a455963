/* modes - the smoothest modes of each aggregate: eigenvectors of its stiffness-weighted graph */
#ifndef MS_MODES_H
#define MS_MODES_H

#include "layout/incidence.h"
#include "linear/aggregates.h"

/* Compute aggregates->weight: of each aggregate an orthonormal basis of the 4 lowest eigenvectors
 * of its Laplacian, the first of which is the translation, by 6 inverse iterations, which determine
 * their energies within a tenth. graph: the springs between unknowns */
msim_status ms_modes_compute(const ms_model *model, const ms_incidence *graph,
                             ms_aggregates *aggregates, msim_error *err);

#endif
