/* constraint_weight - the weight of a constraint (force.h) over the largest diagonal element of its
 * row: large enough for Newton's method to take the row as fixed, small enough for single precision
 */
#ifndef MS_CONSTRAINT_WEIGHT_H
#define MS_CONSTRAINT_WEIGHT_H

#define MS_CONSTRAINT_WEIGHT 1e4

#endif
