/* contacts - particles that rest on planes or slide along them, under collision = event
 *
 * A particle that touches a plane, does not leave it and is pressed on it is in contact: n.v = 0,
 * and the plane adds to its acceleration what keeps n.a = 0. Which particles are follows from x, v
 * and the forces alone, so there is nothing to carry from step to step. Friction: while v = 0 the
 * planes cancel all of a, if they can (|a_t| <= mu N), else they pull against the motion by mu
 * N. */
#ifndef MS_CONTACTS_H
#define MS_CONTACTS_H

#include "integrate/integrator.h"
#include "physics/path.h"
#include "physics/totals.h"

/* In `warm`, beside what the method notes there: the contacts at the end of the last step are
 * known, and the a of that state. So all that forgets the one forgets the other. */
enum { MS_NOTED = 1 << 16 };

/* A reaction, over |a|, that may be rounding. */
#define MS_PRESS 1e-12

typedef struct ms_contact {
  int32_t row;
  int sticks;      /* v = 0, and the planes keep it so */
  int fixed;       /* as many planes as components: nowhere to slide */
  int rubs;        /* there is friction */
  int bounces;     /* so shortly that its path sums the bounces */
  double rebound;  /* n.v at the start of the part, of what bounces */
  ms_touch on;     /* independent planes */
  double slide[3]; /* the direction of v at the start of the part, or where it will go; 0: sticks */
  double rub[3];   /* what friction adds to a at the start of the part, where it slides */
  double stop;     /* s: in that time it would stop v; it may turn as fast */
  double change;   /* the share of the part after which it is lifted, slips or stops, or half of a
                      part in which it turns; MS_NOWHERE: nothing of that */

  /* where normal velocities and friction are given, in constrain.h, else 0: */
  int is_given;
  int enters; /* it was not in contact at the start, or not with all of its planes */
  double end[MS_MOST_TOUCHED];   /* m: the distances from its planes at the end of the part */
  double leave[MS_MOST_TOUCHED]; /* m/s: the velocities at which it then leaves them */
  int slipped;                   /* it stuck in an earlier solve */
  double friction;               /* sum of mu N/m, m/s^2 */
  double lag;                    /* m/s: friction pulls by friction v/lag */
  double jump;       /* sum of mu J/(m h) of the impulses J that gave it its normal velocity */
  double least_jump; /* the smallest J/(m h) */
} ms_contact;

/* What a stepper has under collision = event: the part of the step that is being made starts from
 * s->x and s->v, which lie in x and v here once something was changed there. */
typedef struct ms_events {
  double reach, merge; /* of the walls */
  double *x, *v;
  double *a, *a_end; /* F/m at the start of the part and at its end, as if nothing rested */
  double *stage[2];  /* x and v of a stage of the interpolant */
  double *begin[2];  /* x and v that the last step in one part started from, where `moved` */
  int moved;         /* impacts or contacts changed the state at the start of that step */
  int replays;       /* velocity Verlet follows paths by itself */
  ms_totals *parts;  /* for energies */
  int known;         /* a is that of s->x, s->v */
  double sums;       /* s: bounces that end within are summed (path.h); 0: none */
  double jump;       /* m: ... unless they reach farther than that */
  int implicit;      /* the method solves equations, by a matrix without friction */
  ms_contact *contact;
  ms_hold *hold; /* the same for the matrix */
  int32_t ncontacts;
  int32_t *followed; /* nfollowed rows that took paths of their own in the last part */
  int32_t nfollowed;
  uint64_t held;      /* ms_contacts_sign() at the end of the last step; 0: unknown, or none */
  uint64_t held_next; /* the same of the step just made */
} ms_events;

/* The contact of a row, or NULL. Rows are asked for in ascending order; *next: 0 at first. */
static inline ms_contact *ms_contact_of(const ms_events *e, int32_t row, int32_t *next) {
  return *next < e->ncontacts && e->contact[*next].row == row ? &e->contact[(*next)++] : NULL;
}

/* Whether there is friction, and anywhere to slide, by the planes of the contact; dims: components
 * of a vector. */
void ms_contact_classify(ms_contact *c, int32_t dims);

/* The path of a row from s->x, s->v over s->h, by a = b0 */
ms_path ms_contacts_path(const ms_stepper *s, int32_t row, const double *b0, const double *b1);

/* The scene's planes; a sim may change its scene between steps. */
ms_walls ms_walls_of(const ms_stepper *s);

/* NULL members of `events` where memory ran out; destroy accepts that. */
msim_status ms_events_create(const ms_model *model, ms_events **events, msim_error *err);
void ms_events_destroy(const ms_model *model, ms_events *events);

/* Keep what the step in one part that was just made started from, if that is not s->x, s->v. */
void ms_contacts_keep_begin(ms_events *e, ms_shape shape);

/* The contacts that were found hold at the end of the step, too. */
void ms_contacts_note(ms_stepper *s);

/* The end of the part, where a_end was found, is the start of the next. */
void ms_contacts_know(ms_events *e);

/* The step just made is the last one: s->warm is warm_next from here on, and what belongs to it. */
void ms_contacts_advance(ms_stepper *s);

/* Let s->x, s->v lie in memory that may be written. */
void ms_contacts_own(ms_stepper *s);

/* At s->x, s->v: what lies outside is put on its plane, what runs into planes bounces, and the
 * contacts are found. */
void ms_contacts_find(ms_stepper *s);

/* What the matrix is to hold of them, for a stage of length ah */
void ms_contacts_hold(ms_stepper *s, double ah);

/* The free acceleration at x, v: as if nothing rested. */
void ms_contacts_free(ms_stepper *s, const double *x, const double *v, double *a);

/* Two of one sign hold the same particles in the same way; 0: nothing rests. */
uint64_t ms_contacts_sign(const ms_stepper *s);

/* What the planes add is added to the results of an evaluation, which has a. */
void ms_contacts_push(const ms_stepper *s, const ms_pass *pass);

/* Put what rests on its planes to the last bit in x_next, v_next, find the a of that state, and
 * whether contacts change in the part that ends there. */
void ms_contacts_finish(ms_stepper *s);

/* The least force of its planes, with a the acceleration of a contact as if nothing rested */
double ms_contact_reaction(const ms_contact *c, const double a[3]);

#endif
