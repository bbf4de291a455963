/* cluster_modes - the modes of clusters of aggregates, as combinations of those of aggregates */
#ifndef MS_CLUSTER_MODES_H
#define MS_CLUSTER_MODES_H

#include "linear/aggregates.h"

/* The affine functions on each cluster, in the modes of its aggregates, completed by the smoothest
 * combinations of these (modes.h), for the Laplacian P^T K P, K that of the springs between its
 * unknowns: modes, 16 of each aggregate, 4 at each of its modes, by columns; orthonormal in a
 * cluster. of: the cluster of each aggregate */
msim_status ms_cluster_modes_compute(const ms_model *model, const ms_aggregates *aggregates,
                                     const int32_t *of, int32_t n, const ms_buckets *members,
                                     float *modes, msim_error *err);

#endif
