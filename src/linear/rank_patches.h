/* rank_patches - the parts of a rank that have modes of their own (rank_modes.h)
 *
 * Where ranks share several bodies, affine motions of all unknowns of a rank are smooth motions of
 * none of these. A patch is what springs connect within a rank, and join with other ranks; where
 * there are more than MS_MOST_PATCHES, the smallest share the last one. For what does not cross to
 * other ranks the coarse space of the rank suffices; if nothing does, the largest component is the
 * only patch, so that each rank has one at least. */
#ifndef MS_RANK_PATCHES_H
#define MS_RANK_PATCHES_H

#include "linear/aggregates.h"

enum { MS_MOST_PATCHES = 8 }; /* of a rank */

/* Set of[r], nfree numbers, to the patch of each own unknown, -1 for none. Returns the number of
 * patches, at least 1; 0 if memory is exhausted. */
int32_t ms_rank_patches_find(const ms_model *model, int32_t *of);

/* Let the affine functions v of n unknowns, or their parts in n modes, be orthonormal in each patch
 * (modes.h), and 0 where they depend on others, or without a patch. of: the patch of every `each`
 * of them; room: n */
void ms_rank_patches_orthonormalise(int32_t npatches, const int32_t *of, int32_t each, int32_t n,
                                    double (*v)[MS_MODES], double (*room)[MS_MODES]);

#endif
