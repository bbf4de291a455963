/* rank_patches - the parts of a rank that have modes of their own (rank_modes.h)
 *
 * Where ranks share several bodies, affine motions of all unknowns of a rank are smooth motions of
 * none of these. A patch is what springs connect within a rank, and join with other ranks; where
 * there are more than MS_MOST_BODIES, the smallest share the last one. For what does not cross to
 * other ranks the coarse space of the rank suffices; if nothing does, the largest component is the
 * only patch, so that each rank has one at least.
 *
 * Coarse spaces of ranks end at their borders, so that what the patches cannot represent there has
 * to jump: that makes kappa of additive Schwarz methods without overlap proportional to the size of
 * patches (Toselli and Widlund 2005, ch. 3). So patches of aggregates are split, as far as the
 * matrix of all patches, which each rank factors, stays small. */
#ifndef MS_RANK_PATCHES_H
#define MS_RANK_PATCHES_H

#include "linear/aggregates.h"

enum { MS_MOST_PATCHES = 64, MS_MOST_BODIES = 8 }; /* of a rank */

/* Places of n items: item i at the position x of particle[i] in the scene */
typedef struct ms_rank_places {
  int32_t n, *particle;
  const double *x;
} ms_rank_places;

/* Set of[r], nfree numbers, to the patch of each own unknown, -1 for none. Returns the number of
 * patches, at least 1; 0 if memory is exhausted. */
int32_t ms_rank_patches_find(const ms_model *model, int32_t *of);

/* Split patches, each time the one with most items, across the longest side of its bounding box at
 * the mean coordinate, until it has few items, or a rank of `nranks` has enough patches. of: the
 * patch of each item, -1: none. Returns the number of patches. */
int32_t ms_rank_patches_split(int32_t npatches, int32_t nranks, ms_rank_places at, int32_t *of);

/* Let the affine functions v of n unknowns, or their parts in n modes, be orthonormal in each patch
 * (modes.h), and 0 where they depend on others, or without a patch. of: the patch of every `each`
 * of them; room: n */
void ms_rank_patches_orthonormalise(int32_t npatches, const int32_t *of, int32_t each, int32_t n,
                                    double (*v)[MS_MODES], double (*room)[MS_MODES]);

#endif
