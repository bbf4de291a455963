/* contact_set - the contact set: particles that rest on planes or slide along them (collision =
 * event)
 *
 * A particle is in contact if it touches a plane, does not separate from it and is pressed against
 * it: then n.v = 0, and the reaction of the plane keeps n.a = 0. The contact set follows from x, v
 * and the forces alone, so that steps need not carry it. Friction: while v = 0 the planes cancel
 * all of a if |a_t| <= mu N/m (the particle sticks); otherwise mu N acts against the motion. */
#ifndef MS_CONTACT_SET_H
#define MS_CONTACT_SET_H

#include "integrate/integrator.h"
#include "contact/moving_obstacles.h"
#include "contact/particle_path.h"
#include "physics/totals.h"

/* Flag in `cached_stage`, beside the method's cached-stage tag: `contact_hash` and `a` of
 * ms_contact_set belong to the present state. cached_stage = 0 discards both. */
enum { MS_CONTACTS_CACHED = 1 << 16 };

/* Rounding tolerance of a reaction per mass, relative to |a| */
#define MS_REACTION_TOLERANCE 1e-12

typedef struct ms_contact {
  int32_t row;      /* the unknown (particle) */
  int sticks;       /* v = 0, and the planes keep it so */
  int fixed;        /* at least as many planes as components: it cannot slide */
  int has_friction; /* a plane has friction */
  int bounces;      /* its bounces are so short that the particle path sums them */
  int has_solid;    /* a plane of `on` is tangent to a solid */
  double rebound;   /* m/s: n.v at the start of the substep, if it bounces */
  ms_plane_set on;  /* its planes, which are independent */
  double sliding_direction
      [3]; /* sliding direction at the start of the substep: of v, or of a if v = 0 */
  double friction_force[3]; /* friction force over mass at the start of the substep, if it slides */
  double stop;              /* s: friction alone would stop v in this time; v may turn as fast */
  double change;  /* share of the substep after which it is lifted, slips or stops, or MS_NOWHERE */
  int turns;      /* it turns sharply in the substep */
  double slowest; /* the share after which it is slowest, if it turns sharply, or MS_NOWHERE */

  ms_contact_frame frame; /* v and a above are relative to it */

  /* of prescribed normal velocities and friction (implicit_contact.h), else 0: */
  int is_prescribed; /* they are prescribed */
  int enters;        /* at the start it was not in contact, or not with all of its planes */
  double end[MS_MAX_TOUCHED_PLANES];   /* m: distances from its planes at the end of the step */
  double leave[MS_MAX_TOUCHED_PLANES]; /* m/s: velocities at which it then separates from them */
  int keeps;             /* it keeps its distances from its planes, which then do no work */
  int starts_slipping;   /* at rest at the start, where friction cannot hold it */
  int slipped;           /* it stuck in an earlier solve, and slips now */
  double friction;       /* m/s^2: sum of mu N/m, those of impulses (jump) included */
  double friction_speed; /* m/s: the friction force over mass is -friction v/lag */
  /* m/s^2: sum of mu J/(m h) of the impulses J that change its normal velocity */
  double impulse_friction;
  double least_jump; /* m/s^2: the smallest J/(m h) */
  double push[3];    /* m/s^2: the reaction to the free acceleration of the last force sweep */
  double impulse[3]; /* m/s: impulse over mass of the last solve that was kept */
} ms_contact;

/* A contact has at most so many planes that are tangent to solids. */
enum { MS_MAX_TANGENTS = MS_MAX_INDEPENDENT_PLANES };

/* State of a stepper under collision = event. The substep being made starts from s->x and s->v;
 * these point to x and v here once impacts or contacts have changed them. */
typedef struct ms_contact_set {
  double reach, merge; /* those of ms_collision_planes (impacts.h) */
  ms_obstacles near;   /* in scenes with colliders: tangent planes near the particle at hand */
  msim_plane *tangent; /* MS_MAX_TANGENTS for each unknown: those of contacts */
  int32_t *solid;      /* the same: index of the solid to which it is tangent */
  double *x, *v;
  const double *guess;      /* NULL, or that of the next linear solve */
  int continues;            /* 1: the next linear solve is one more of the same step */
  double draft_rtol;        /* 0, or the least tolerance of the next linear solve */
  int32_t most_iterations;  /* 0, or the most iterations of the next linear solve */
  int may_reject, rejected; /* 1: ask, or have asked, ms_stepper_is_rejected() */
  double *a, *a_end;        /* F/m without reactions, at the start and at the end of the substep */
  double *stage[2];         /* x and v of a stage of the dense output; scratch */
  double *begin[2];         /* if `moved`: x and v at the start of the last step without substeps;
                          in implicit_contact.h: [0] is v_next of the last solve */
  int moved;                /* impacts or contacts changed the state at the start of that step */
  int method_handles_contact; /* velocity Verlet follows particle paths itself (verlet_contact.h) */
  ms_totals *parts;           /* scratch for energies */
  int a_is_known;             /* a is that of s->x, s->v */
  double
      bounce_time; /* s: bounces that end within this time are summed (particle_path.h); 0: none */
  double bounce_reach;       /* m: ... if they reach no farther than this */
  double path_tolerance;     /* m: ms_stepper.path_tolerance; INFINITY without error control */
  int implicit;              /* the method solves equations, by a matrix without friction */
  ms_contact *contact;       /* ncontacts, with ascending rows */
  ms_constraint *constraint; /* the same contacts as constraints of the matrix */
  int32_t ncontacts;
  int others_have_contacts; /* 1: other ranks have contacts, by the last ms_contact_set_share() */
  int32_t *followed; /* nfollowed unknowns that followed paths of their own in the last substep */
  int32_t nfollowed;
  /* ms_contact_set_hash() at the end of the last step; 0: unknown, or no contact */
  uint64_t contact_hash;
  uint64_t contact_hash_next; /* the same of the step just made */
} ms_contact_set;

/* The contact of an unknown, or NULL. Call it with ascending rows and one *next, 0 at first. */
static inline ms_contact *ms_contact_set_lookup(const ms_contact_set *e, int32_t row,
                                                int32_t *next) {
  while (*next < e->ncontacts && e->contact[*next].row < row) ++*next;
  return *next < e->ncontacts && e->contact[*next].row == row ? &e->contact[(*next)++] : NULL;
}

/* Sets c->fixed and c->has_friction by the planes of the contact; dims: components of a vector. */
void ms_contact_set_classify(ms_contact *c, int32_t dims);

/* Index of the solid to which a plane of a contact is tangent; -1: it is no such plane */
int32_t ms_contact_set_find_solid(const ms_stepper *s, const msim_plane *plane);

/* Adds the plane that touches a solid at the point nearest to x to the planes of a contact. */
void ms_contact_set_add_tangent(ms_stepper *s, ms_contact *c, int32_t solid, const double x[3]);

/* The path (particle_path.h) of an unknown from s->x, s->v over s->h, with a = b0 */
ms_particle_path ms_contact_set_make_path(const ms_stepper *s, int32_t row, const double *b0,
                                          const double *b1);

/* The scene's planes, which a sim may change between steps */
ms_collision_planes ms_contact_set_planes(const ms_stepper *s);

/* After MSIM_ERR_MEMORY *events, or some of its members, are NULL, which destroy accepts. */
msim_status ms_contact_set_create(const ms_model *model, ms_contact_set **events, msim_error *err);
/* Ranks agree on the reach of the scene, of which each has a part; collective. A failure of the
 * communicator is kept for the next agreement. */
void ms_contact_set_connect(const ms_model *model, ms_contact_set *events);
void ms_contact_set_destroy(const ms_model *model, ms_contact_set *events);

/* As before the first step: nothing of the last one is known. Nullable: e. */
void ms_contact_set_forget(ms_contact_set *e);

/* If e->moved, stores the state at the start of the step just made. */
void ms_contact_set_save_start(ms_contact_set *e, ms_shape shape);

/* Records that the present contact set is also that of the end of the step. */
void ms_contact_set_record(ms_stepper *s);

/* The next substep starts where the last one ended: a = a_end. */
void ms_contact_set_shift_acceleration(ms_contact_set *e);

/* Accepts the step just made: s->cached_stage = s->cached_stage_next, with the `contact_hash` and
 * `a` that belong to it. */
void ms_contact_set_accept_step(ms_stepper *s);

/* Lets s->x, s->v point to copies in e->x, e->v, to be overwritten; `a` becomes unknown. */
void ms_contact_set_make_writable(ms_stepper *s);

/* Finds the contact set at s->x, s->v. First it puts particles outside on their planes, and lets
 * particles that move into planes bounce. Collective */
void ms_contact_set_update(ms_stepper *s);

/* Computes a, if the caller or another rank needs it and not all have it; returns 1 if it is
 * needed. Collective */
int ms_contact_set_require_acceleration(ms_stepper *s, int is_needed);

/* Determines on each rank whether others have contacts. Collective */
void ms_contact_set_share(ms_stepper *s);

/* Sets e->constraint, the constraints of the matrix, for a stage of coefficient ah (newton.h). */
void ms_contact_set_make_constraints(ms_stepper *s, double ah);

/* The free acceleration a = F(x, v)/m at t + c h, without reactions of planes; sets s->c = c */
void ms_contact_set_free_acceleration(ms_stepper *s, double c, const double *x, const double *v,
                                      double *a);

/* A hash of the contacts: their particles and planes, and which of them stick; 0: no contact */
uint64_t ms_contact_set_hash(const ms_stepper *s);

/* Adds reactions and friction of the planes to the results of a force sweep, which include a. */
void ms_contact_set_add_reactions(const ms_stepper *s, const ms_fused_step *sweep);

/* a = the acceleration at s->x, s->v, with reactions and friction of the planes that touch there,
 * between steps, by the tolerances of the last step. Collective */
void ms_contact_set_find_acceleration(ms_stepper *s, double *a);

/* Puts particles in contact on their planes, to the last bit, in x_next and v_next. */
void ms_contact_set_place(ms_stepper *s);

/* The smallest reaction per mass to the free acceleration a; < 0: a plane would have to pull */
double ms_contact_set_reaction(const ms_contact *c, const double a[3]);

#endif
