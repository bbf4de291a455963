/* contact_log - the contacts of an island in the step being made, for msim_sim_contacts (option
 * contacts) */
#ifndef MS_CONTACT_LOG_H
#define MS_CONTACT_LOG_H

#include "contact/impacts.h"
#include "physics/model.h"

/* A particle and the plane or collider that it touched */
typedef struct ms_touch {
  int32_t row;
  int32_t obstacle;           /* the plane, or nplanes + the collider */
  int32_t next;               /* of the same row in the log; -1: none */
  double point[3], normal[3]; /* m, and of unit length to the side of the particle */
  double dv[3];               /* m/s: the sum of the impulses on the particle, over its mass */
} ms_touch;

typedef struct ms_contact_log {
  int32_t n, capacity;
  int32_t lost;    /* touches beyond the capacity */
  double h;        /* s: length of the step */
  ms_touch *touch; /* capacity */
  int32_t *first;  /* nfree: the last touch of each row; -1: none */
} ms_contact_log;

/* NULL: out of memory. There is room for 3 obstacles at each particle, and 64 more. */
ms_contact_log *ms_contact_log_create(const ms_model *model);
void ms_contact_log_destroy(const ms_model *model, ms_contact_log *log);

/* Forget all touches: a step of h begins. Nullable: log. */
void ms_contact_log_clear(ms_contact_log *log, double h);

/* Add dv to the touch of a row and an obstacle, which is new or known. */
void ms_contact_log_add(ms_contact_log *log, int32_t row, int32_t obstacle, const double point[3],
                        const double normal[3], const double dv[3]);

/* Share dv among the obstacles of a set of planes, or tangent planes, at x: as sum J_i n_i, J_i >=
 * 0, and a rest, of friction, in proportion to mu_i J_i, or else to the first with J_i > 0. */
void ms_contact_log_share(ms_contact_log *log, int32_t row, const ms_plane_set *on,
                          const int32_t *obstacle, const double x[3], const double dv[3]);

/* Add the impulse that stops a row with velocity v to its last touch. */
void ms_contact_log_stop(ms_contact_log *log, int32_t row, const double v[3]);

#endif
