/* scene.h - scenes: particles, springs, planes, colliders, gravity, drag and forces; conventions:
 * msim.h */
#ifndef MSIM_SCENE_H
#define MSIM_SCENE_H

#include "msim/api.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct msim_scene msim_scene;

/* The half space n.x >= d. A particle that is outside at the end of a step, s = n.x - d < 0, is
 * reflected (Teschner): x -= (1 + e) s n, and if n.v < 0, with the impulse per unit mass J = -(1 +
 * e) n.v, v += J n, and the tangential velocity v_t is scaled by max(0, 1 - mu J/|v_t|). This is
 * repeated while the particle is outside any plane. Planes whose half spaces have no common point
 * are refused by msim_sim_create. With option collision = event the velocity changes in the same
 * way, at the position and time of the impact.
 *
 * This struct is fixed, as msim_scene_view.planes is an array of it: colliders of other shapes or
 * with other properties will get structs of their own. */
typedef struct msim_plane {
  double normal[3];   /* of any length but 0; normal and offset are divided by it */
  double offset;      /* m */
  double restitution; /* [0, 1] */
  double friction;    /* Coulomb's coefficient mu, >= 0 */
} msim_plane;

/* Shapes of colliders */
typedef enum msim_collider_type {
  MSIM_COLLIDER_SPHERE = 1,
  MSIM_COLLIDER_CAPSULE = 2,  /* a cylinder with half spheres at its ends */
  MSIM_COLLIDER_CYLINDER = 3, /* straight, with flat ends */
  MSIM_COLLIDER_BOX = 4,      /* a cuboid */
  /* The space below a surface of triangles through heights on a grid: two in each cell, divided by
   * the diagonal from (i, j) to (i + 1, j + 1). Beyond the grid the surface continues horizontally
   * with the heights of the border. */
  MSIM_COLLIDER_HEIGHTFIELD = 5,
  /* The points where samples of a signed distance on a grid, negative in the solid, and
   * interpolated trilinearly, are < 0. All samples at the border of the grid must be > 0. */
  MSIM_COLLIDER_SDF = 6
} msim_collider_type;

/* A solid, at rest or with a motion (msim_collider_motion), which particles cannot enter, or cannot
 * leave. With s, the signed distance of a particle from its surface, < 0 where the particle must
 * not be, and n = grad s, the particle is reflected as at a plane that touches the surface at the
 * point nearest to the particle. Where colliders and planes leave no room within reach, the
 * particle stays where it was before the step, at rest. With collision = event impacts are located,
 * and the particle rests on the surface or slides along it while the surface pushes, on a solid at
 * rest with n.a = -v.(dn/dx) v. Integrator `auto` refuses colliders that move. Members that a type
 * does not have are ignored. */
typedef struct msim_collider {
  size_t size;
  int32_t type;          /* msim_collider_type */
  int32_t inside;        /* 1: particles stay inside, as in a bowl; 0: they stay outside */
  double center[3];      /* m: sphere, box */
  double from[3], to[3]; /* m: the ends of the axis of a capsule or cylinder; not the same point */
  double radius;         /* m, > 0: sphere, capsule, cylinder */
  double extent[3];      /* m, > 0: edge lengths of a box, along x, y and z before its rotation */
  double rotation[3];    /* rad: of a box about its center: the axis, with the angle as length */
  double restitution;    /* [0, 1] */
  double friction;       /* Coulomb's coefficient mu, >= 0 */
  /* Later additions. */
  double origin[3];     /* m: of the grid of a height field or sdf, sample (0, 0, 0) at height 0 */
  double spacing[3];    /* m, > 0: of the grid along x, y and, of an sdf, z */
  int32_t n[3];         /* >= 2: samples along x, y and, of an sdf, z */
  const double *values; /* m: heights above the origin, n[0] n[1], that of (i, j) at i n[1] + j; or
                           signed distances, n[0] n[1] n[2], that of (i, j, k) at (i n[1] + j) n[2]
                           + k */
} msim_collider;

/* n particles on a straight line, with a spring between neighbours. */
typedef struct msim_rope {
  size_t size;
  int32_t n;             /* >= 1 */
  double from[3], to[3]; /* positions of the first and the last particle, m */
  double mass;           /* total mass of the rope, kg, > 0 */
  double k, damping;     /* N/m, N s/m; k = 0: no springs */
  int32_t npinned;
  const int32_t *pinned; /* npinned, indices within the object */
  int32_t law;           /* of its springs (msim_scene_add_law); 0: linear */
  double bending;        /* N m/rad^2: of an angular spring at each inner particle; 0: none */
} msim_rope;

/* rows x columns particles in a parallelogram; particle r * columns + c is at origin + r/(rows-1)
 * row + c/(columns-1) column. Springs of a particle lead to its neighbours right, down, down-right,
 * down-left, two to the right and two down; they are ordered by first particle. */
typedef struct msim_cloth {
  size_t size;
  int32_t rows, columns;                /* >= 1 */
  double origin[3], row[3], column[3];  /* m; row, column: edge vectors of the whole cloth */
  double mass;                          /* total mass of the cloth, kg, > 0 */
  double k_structural, k_shear, k_bend; /* N/m; 0: no such springs */
  double damping;                       /* N s/m, for each spring */
  int32_t npinned;
  const int32_t *pinned; /* npinned, indices within the object */
  int32_t law;           /* of its springs (msim_scene_add_law); 0: linear */
  double bending;        /* N m/rad^2: of angular springs along rows and columns; 0: none */
} msim_cloth;

/* n[0] x n[1] x n[2] particles in a box; particle (ix * n[1] + iy) * n[2] + iz. Springs along the
 * edges, the face diagonals and the body diagonals of each cell. */
typedef struct msim_lattice {
  size_t size;
  int32_t n[3];                /* >= 1 each */
  double origin[3], extent[3]; /* the corner of least coordinates; edge lengths, >= 0; m */
  double mass;                 /* total mass of the lattice, kg, > 0 */
  double k, damping;           /* N/m, N s/m; k = 0: no springs */
  int32_t npinned;
  const int32_t *pinned; /* npinned, indices within the object */
  int32_t law;           /* of its springs (msim_scene_add_law); 0: linear */
} msim_lattice;

/* Springs of one law at one moment, for msim_law_function. Members may be added at the end. */
typedef struct msim_law_batch {
  size_t size;
  int32_t n;
  const double *k, *rest; /* n: of each spring, N/m, m */
  const double *stretch;  /* n: e = l - rest, m */
  double *force;          /* n: f(e), N, > 0 if the spring pulls its ends together */
  double *slope;          /* n: df/de, N/m */
  double *energy;         /* n: the integral of f from 0 to e, J */
} msim_law_batch;

/* Computes force, slope and energy of all springs of a batch. They must depend on k, rest and
 * stretch alone. Several threads may call it at the same time. It must not call msim. */
typedef void msim_law_function(void *data, const msim_law_batch *batch);

enum {
  MSIM_LAW_LINEAR,      /* f = k e; law 0, and laws by which linear springs break */
  MSIM_LAW_TENSION,     /* f = k max(e, 0), as of a cable */
  MSIM_LAW_COMPRESSION, /* f = k min(e, 0), as of a buffer */
  MSIM_LAW_DEAD_BAND,   /* f = k (e - c), c = e limited to [-half_width, half_width]: slack */
  MSIM_LAW_POLYNOMIAL,  /* f = k (p(c) + p'(c) (e - c)), p(e) = sum of coefficients[i] e^(i+1), c =
                           e limited to [-limit, limit]: beyond it the force continues linearly */
  MSIM_LAW_TABLE,       /* f(stretch[i]) = force[i], between them the monotone cubic of Fritsch and
                           Carlson (1980), beyond them linear; k has no effect */
  MSIM_LAW_CALLBACK     /* f by `function` */
};

/* The elastic force f (N) of a spring as a function of its stretch e = l - rest (m); damping is not
 * affected. Members of other kinds must be 0. */
typedef struct msim_law {
  size_t size;
  int32_t kind;                /* MSIM_LAW_... */
  int32_t n;                   /* POLYNOMIAL: >= 1; TABLE: >= 2 */
  double half_width;           /* DEAD_BAND: m, >= 0 */
  double limit;                /* POLYNOMIAL: m, > 0 */
  const double *coefficients;  /* POLYNOMIAL: n; coefficients[i] in 1/m^i */
  const double *stretch;       /* TABLE: n, m, ascending */
  const double *force;         /* TABLE: n, N */
  msim_law_function *function; /* CALLBACK */
  void *data;                  /* CALLBACK: its first argument. Nullable. */
  double largest_slope;        /* CALLBACK: N/m, > 0: |df/de| and |f|/l are at most that */
  double energy_depth;         /* CALLBACK: J, >= 0: no energy is below -energy_depth */
  /* All kinds, also LINEAR; 0: never. After each step a spring breaks that exceeds one of them.
   * From then on it exerts no force, neither f nor damping, but keeps its index (msim_sim_broken).
   * Springs between two pinned particles do not break. */
  double break_strain; /* e/rest, > 0; without effect where rest = 0 */
  double break_force;  /* f, N, > 0 */
} msim_law;

/* What a force function depends on, and what it computes */
enum {
  MSIM_FORCE_TIME = 1,     /* it depends on t */
  MSIM_FORCE_VELOCITY = 2, /* it depends on v */
  MSIM_FORCE_JACOBIAN = 4  /* it computes dfdx and dfdv where they are not NULL */
};

/* The free particles of one island at one moment, for msim_force_evaluate. Members may be added at
 * the end. */
typedef struct msim_force_batch {
  size_t size;
  int32_t n;
  const int32_t *particles; /* n, ascending: their indices in the scene */
  double t;                 /* s: the time of the stage */
  const double *x;          /* 3n, m */
  const double *v;          /* 3n, m/s; NULL without MSIM_FORCE_VELOCITY */
  double *f;                /* 3n, N: the forces; 0 at the call */
  double *dfdx, *dfdv;      /* 9n, N/m, N s/m: df_i/dx_i and df_i/dv_i of each particle, 3 x 3, row
                               by row: [9i + 3a + b] = df_a/dx_b; 0 at the call. NULL: not wanted */
} msim_force_batch;

/* Computes the forces on the particles of a batch, beside those of gravity, drag and springs. They
 * must depend on the members of the batch alone, so that equal calls have equal results: methods
 * call it several times in a step, at the times of their stages, and again for steps that are
 * repeated. It is called from the thread that called msim, never from two at a time, and must not
 * call msim for this sim. Not 0: the step ends with MSIM_FORCE_FAILED. */
typedef int32_t msim_force_evaluate(void *data, const msim_force_batch *batch);

/* The potential energy (J) of n particles at x: a sum over particles, of functions of the position
 * of each. */
typedef double msim_force_potential(void *data, int32_t n, const int32_t *particles /* n */,
                                    const double *x /* 3n */);

/* A force that the program computes: wind, a magnet, the drag of a fluid, a controller. Members may
 * be added at the end.
 *
 * Islands, which no spring connects, are computed one after the other, small ones together: a call
 * has the free particles of one island, and those of the whole scene with skip.islands off. With a
 * force function scenes are never planar. Explicit and implicit methods keep their order. The
 * matrix of implicit methods contains -h dfdv - h^2 dfdx, of which it takes the symmetric part and
 * no eigenvalue below -m/2, or, clamped, below 0: where more is missing, as in a magnetic field, or
 * without MSIM_FORCE_JACOBIAN, Newton's method converges linearly, for small h. */
typedef struct msim_force_function {
  size_t size;
  uint32_t flags;   /* MSIM_FORCE_... */
  const char *name; /* 1 to 63 bytes, no line ends: checkpoints are refused by sims
                                      with a function of another name. Copied. */
  msim_force_evaluate *evaluate;
  msim_force_potential *potential; /* part of the gravitational energy; not with MSIM_FORCE_TIME.
                                      NULL: the work of the force is integrated, as `work` in
                                      msim_energy, with up to two more calls a step */
  void *data;                      /* first argument of both; valid as long as the scene and its
                                      sims are. Nullable. */
  double largest_stiffness;        /* N/m, >= 0: |dfdx| of any particle is at most that, and */
  double largest_damping; /* N s/m, >= 0: |dfdv|; for step-size limits and h = auto. 0: unknown */
} msim_force_function;

/* How a motion connects its points */
enum {
  MSIM_MOTION_LINEAR = 0, /* straight lines; velocities jump at the given times */
  MSIM_MOTION_CUBIC = 1   /* Hermite's cubics with continuous velocities: at each time that of the
                             parabola through three points, at the first and the last one 0 */
};

/* A prescribed motion of n pinned particles through points at nt times: before the first and after
 * the last one they rest. Springs, damping, energies and error control follow it. */
typedef struct msim_motion {
  size_t size;
  int32_t n;
  const int32_t *particles; /* n, pinned, each in one motion at most */
  int32_t nt;               /* >= 1 */
  const double *t;          /* nt, s, increasing */
  const double *x;          /* nt x n x 3, m: the points of all particles at t[0], t[1], ... */
  int32_t interpolation;    /* MSIM_MOTION_... */
} msim_motion;

/* A prescribed motion of a collider through positions at nt times, connected as those of pinned
 * particles: before the first and after the last one it rests. A reflection takes the velocity of
 * the particle relative to that of the surface at the nearest point, linear and angular, and the
 * solid at the end of the step; its impulse J on the particle does the work J.u with that velocity
 * u of the surface. */
typedef struct msim_collider_motion {
  size_t size;
  int32_t collider;       /* its index */
  int32_t nt;             /* >= 1; 0: it rests (msim_scene_get_collider_motion) */
  const double *t;        /* nt, s, increasing */
  const double *x;        /* 3 nt, m: positions of `center` or `origin`, or of the middle of `from`
                             and `to` */
  const double *rotation; /* 3 nt, rad: rotation vectors about that point, after the rotation that
                             the collider has without motion. Nullable: it does not rotate */
  int32_t interpolation;  /* MSIM_MOTION_..., of x and of rotation vectors */
} msim_collider_motion;

/* Particles and springs to remove and to add, all at once. All indices are those before the edit;
 * the particles that it adds are numbered on from there, so that `ij` may refer to both. Afterwards
 * what stays comes first, in its order and without gaps, and what was added follows. */
typedef struct msim_edit {
  size_t size;
  int32_t nremoved_particles;
  const int32_t *removed_particles; /* with their springs, also angular ones, faces,
                                       motions, forces and pins */
  int32_t nremoved_springs;
  const int32_t *removed_springs;
  int32_t nparticles;    /* to add, as by msim_scene_add_particles */
  const double *x, *v;   /* 3 nparticles, m, m/s. Nullable: v (at rest). */
  const double *mass;    /* nparticles, kg, > 0 */
  int32_t nsprings;      /* to add, as by msim_scene_add_springs */
  const int32_t *ij;     /* 2 nsprings: particles that stay, or are added */
  const double *k;       /* nsprings, N/m, >= 0 */
  const double *rest;    /* nsprings, m. Nullable: the present distances. */
  const double *damping; /* nsprings, N s/m. Nullable: 0. */
  const int32_t *law;    /* nsprings: their laws. Nullable: linear. */
  /* Later additions. */
  int32_t nangles;             /* angular springs to add, as by msim_scene_add_angles */
  const int32_t *ijk;          /* 3 nangles: particles that stay, or are added */
  const double *angle_k;       /* nangles, N m/rad^2, >= 0 */
  const double *angle_rest;    /* nangles, rad. Nullable: the present angles. */
  const double *angle_damping; /* nangles, N m s/rad. Nullable: 0. */
} msim_edit;

/* The complete content of a scene; all pointers are borrowed. */
typedef struct msim_scene_view {
  size_t size;
  const char *name; /* never NULL */
  int32_t nparticles, nsprings, nplanes;
  const double *x, *v;              /* 3 nparticles */
  const double *mass;               /* nparticles */
  const uint8_t *pinned;            /* nparticles: 1 where pinned */
  const int32_t *ij;                /* 2 nsprings */
  const double *k, *rest, *damping; /* nsprings */
  const msim_plane *planes;         /* nplanes, with unit normals */
  double gravity[3];                /* m/s^2 */
  double drag;                      /* N s/m: the force -drag v acts on every particle */
  /* Later additions: written if `size` includes them. */
  int32_t nfaces;
  const int32_t *faces; /* 3 nfaces */
  int32_t nlaws;        /* laws 1 to nlaws, for msim_scene_get_law */
  const int32_t *law;   /* nsprings: the law of each spring; NULL: all are linear */
  const double *force;  /* 3 nparticles: constant forces, N; NULL: none */
  int32_t ncolliders;
  const msim_collider *colliders;            /* ncolliders, one every colliders->size bytes */
  int32_t nmotions;                          /* see msim_scene_get_motion */
  const msim_force_function *force_function; /* NULL: none */
  int32_t nangles;
  const int32_t *ijk;                                 /* 3 nangles */
  const double *angle_k, *angle_rest, *angle_damping; /* nangles: N m/rad^2, rad, N m s/rad */
  double self_thickness, self_friction;               /* m: of self-contact; 0: there is none */
  int32_t planes_constrain; /* 1 or 0, see msim_scene_set_planes_constrain */
} msim_scene_view;

/* Create an empty scene. Nullable: alloc (then malloc and free are used). */
MSIM_API msim_status msim_scene_create(const msim_allocator *alloc, msim_scene **scene,
                                       msim_error *err);

/* Read a scene file. The extension selects the importer: .h5 (plugin hdf5), or the plugin with the
 * name of the extension, see importer.h, in the folders of MSIM_PLUGIN_PATH or of msim. All other
 * files are JSON. Errors name the file and the line or key: MSIM_ERR_IO (cannot be read),
 * MSIM_ERR_ARG (cannot be a scene); plugin statuses. *scene is NULL then. Nullable: alloc. */
MSIM_API msim_status msim_scene_load(const msim_allocator *alloc, const char *path,
                                     msim_scene **scene, msim_error *err);

/* The same for one of several ranks that will simulate the scene together: of a file whose importer
 * reads parts of arrays, as that of .h5, each rank has only its rows, about 1/nranks of them. The
 * ranks pass their parts to msim_sim_create. For all other functions such a scene has no particles,
 * springs and faces; its gravity, drag, planes, colliders and options are those of the file, and
 * can be changed, alike on all ranks. Scenes with objects, laws, angular springs, motions or fewer
 * particles than ranks, and files of other formats, are read as a whole, as by msim_scene_load. Not
 * collective. Nullable: alloc. */
MSIM_API msim_status msim_scene_load_part(const msim_allocator *alloc, const char *path,
                                          int32_t rank, int32_t nranks, msim_scene **scene,
                                          msim_error *err);

/* As msim_scene_load, from memory; `label` replaces the file name in error messages, and files of
 * meshes are relative to its folder. Nullable: alloc. */
MSIM_API msim_status msim_scene_parse(const msim_allocator *alloc, const char *label,
                                      const char *text, size_t length, msim_scene **scene,
                                      msim_error *err);

/* Write the scene to a scene file in the format given by the extension, as above. Every number is
 * exact. JSON that was read, was not changed since and refers to no file of a mesh is written as it
 * was; else objects are expanded into particles and springs. MSIM_ERR_IO: cannot be written, and an
 * older file of that name is as it was; plugin statuses. */
MSIM_API msim_status msim_scene_save(const msim_scene *scene, const char *path, msim_error *err);

/* Sims made from the scene are not affected. Nullable: scene. */
MSIM_API void msim_scene_destroy(msim_scene *scene);

MSIM_API msim_status msim_scene_set_name(msim_scene *scene, const char *name, msim_error *err);
MSIM_API msim_status msim_scene_set_gravity(msim_scene *scene, const double gravity[3],
                                            msim_error *err);
MSIM_API msim_status msim_scene_set_drag(msim_scene *scene, double drag /* >= 0 */,
                                         msim_error *err);

/* Set a constant force on each particle, in N, beside those of gravity, drag and springs; pinned
 * particles do not feel it. Particles that are added later have none. Nullable: force (none). */
MSIM_API msim_status msim_scene_set_forces(msim_scene *scene,
                                           const double *force /* 3 nparticles */, msim_error *err);

/* Set the force that the program computes in each step. Refused by msim_sim_create with integrators
 * `auto`, `respa`, `takahashi-imada` and `verlet`, and by `rkn6` and `force-gradient` with
 * MSIM_FORCE_VELOCITY. Scene files cannot hold it. MSIM_ERR_ARG: a member is out of range.
 * Nullable: function (none). */
MSIM_API msim_status msim_scene_set_force_function(msim_scene *scene,
                                                   const msim_force_function *function,
                                                   msim_error *err);

/* Append n particles. Nullable: v (at rest). */
MSIM_API msim_status msim_scene_add_particles(msim_scene *scene, int32_t n,
                                              const double *x /* 3n */, const double *v /* 3n */,
                                              const double *mass /* n, > 0 */, msim_error *err);

/* Append n springs. With d = x_j - x_i, l = |d|, u = d/l, the force on i is k (l - rest) u +
 * damping (u . (v_j - v_i)) u, and the opposite one acts on j; no force if l = 0. k, rest and
 * damping must be >= 0. Nullable: rest (the present distance), damping (0). */
MSIM_API msim_status msim_scene_add_springs(msim_scene *scene, int32_t n,
                                            const int32_t *ij /* 2n */, const double *k /* n */,
                                            const double *rest /* n */,
                                            const double *damping /* n */, msim_error *err);

/* Add a law; *index becomes its number, from 1 on: law 0 is the linear one. Arrays are copied;
 * `function` and `data` must be valid as long as the scene, its sims and their checkpoints are.
 * Scenes with a law by which springs break are refused by msim_sim_create with integrators `auto`,
 * `respa` and `takahashi-imada`. MSIM_ERR_ARG: a member is out of range, or the law is linear and
 * springs do not break; MSIM_ERR_SIZE. Nullable: index. */
MSIM_API msim_status msim_scene_add_law(msim_scene *scene, const msim_law *law, int32_t *index,
                                        msim_error *err);

/* Give n springs the law of this number; 0: the linear one. Steps, bounds and energies follow it:
 * step-size limits use the largest |df/de|, which bounds |f|/l too where f <= 0 at l = 0; the exact
 * matrix contains f/l across springs and max(df/de, f/l) along them, the clamped one nothing below
 * 0: where df/de < f/l, Newton's method converges linearly. */
MSIM_API msim_status msim_scene_set_law(msim_scene *scene, int32_t n,
                                        const int32_t *springs /* n */, int32_t law,
                                        msim_error *err);

/* Get a law by its number, 0 to nlaws; set law->size first. Arrays are borrowed, valid as those of
 * msim_scene_get. MSIM_ERR_ARG: there is no such law. */
MSIM_API msim_status msim_scene_get_law(const msim_scene *scene, int32_t index, msim_law *law);

/* Append n angular springs, which resist bending and do not stretch. With theta the angle at
 * particle j between its edges to i and k, from 0 (they coincide) to pi (they are straight), the
 * elastic energy is E = k/2 (theta - rest)^2, and the forces are -dE/dx - damping dtheta/dt
 * dtheta/dx on i, j and k, without momentum and angular momentum (Allen and Tildesley 1987). They
 * are smooth where the edges are straight if rest = pi. For any other rest the direction of the
 * force is not defined at theta = pi, nor at theta = 0 unless rest = 0: there it is 0, as it is
 * where an edge has no length. k and damping must be >= 0, rest in [0, pi].
 * Edges need no spring. Step-size limits follow from the edges' lengths when the sim is made.
 * Refused by msim_sim_create with integrator `respa`, and damped ones where forces must not depend
 * on velocities. Nullable: rest (the present angle; exactly pi if that is straight up to the
 * rounding of coordinates), damping (0). */
MSIM_API msim_status msim_scene_add_angles(msim_scene *scene, int32_t n,
                                           const int32_t *ijk /* 3n, the vertex j second */,
                                           const double *k /* n, N m/rad^2 */,
                                           const double *rest /* n, rad */,
                                           const double *damping /* n, N m s/rad */,
                                           msim_error *err);

/* Append n faces, triangles of particles, which viewers draw: they have no mass and exert no force
 * but in self-contact.
 * Seen from outside, the corners of a closed surface are in counterclockwise order. Cloths and
 * lattices bring their own: two for each cell of a cloth and of each side of a lattice. */
MSIM_API msim_status msim_scene_add_faces(msim_scene *scene, int32_t n,
                                          const int32_t *corners /* 3n */, msim_error *err);

/* Let surfaces, the faces of the scene and ropes, not pass through each other or themselves:
 * neighbours stay `thickness` (m) apart, and slide with Coulomb's friction. thickness 0: they pass
 * through each other. With fixed steps, collision = reflect and surfaces that do not intersect at
 * the start, which msim_sim_create checks. */
MSIM_API msim_status msim_scene_set_self_contact(msim_scene *scene, double thickness,
                                                 double friction, msim_error *err);

MSIM_API msim_status msim_scene_add_plane(msim_scene *scene, const msim_plane *plane,
                                          msim_error *err);

/* With constrain != 0 implicit methods with steps above the vibrations of springs (h omega > 2)
 * hold particles at planes inside their matrix, as at colliders, also with collision = reflect;
 * else particles are mirrored one by one, which adds energy to stiff bodies. [0; 1 from
 * msim_scene_add_mesh on] */
MSIM_API msim_status msim_scene_set_planes_constrain(msim_scene *scene, int32_t constrain,
                                                     msim_error *err);

/* MSIM_ERR_ARG if a member is out of its range. */
MSIM_API msim_status msim_scene_add_collider(msim_scene *scene, const msim_collider *collider,
                                             msim_error *err);

/* Prescribe the motion of a collider, in place of one that it has. From the start of a run on, its
 * position is that of the motion, whatever `center`, `from` and `to` are. */
MSIM_API msim_status msim_scene_set_collider_motion(msim_scene *scene,
                                                    const msim_collider_motion *motion,
                                                    msim_error *err);

/* Get the motion of a collider; set motion->size first. Valid as msim_scene_get says. */
MSIM_API msim_status msim_scene_get_collider_motion(const msim_scene *scene, int32_t collider,
                                                    msim_collider_motion *motion);

/* Pin n particles: their positions stay constant. Their velocity must be 0. */
MSIM_API msim_status msim_scene_pin(msim_scene *scene, int32_t n, const int32_t *particles /* n */,
                                    msim_error *err);

/* Prescribe a motion of pinned particles. From the start of a run on, their positions are those of
 * the motion, whatever x is. Refused by msim_sim_create with integrators `auto`, `respa` and
 * `takahashi-imada`. */
MSIM_API msim_status msim_scene_add_motion(msim_scene *scene, const msim_motion *motion,
                                           msim_error *err);

/* Get motion i, from 0 to nmotions - 1; set motion->size first. Valid as msim_scene_get says. */
MSIM_API msim_status msim_scene_get_motion(const msim_scene *scene, int32_t i, msim_motion *motion);

/* Remove and add particles and springs. Faces stay unless one of their particles is removed.
 * Removed indices may occur twice. MSIM_ERR_ARG: an index is out of range, or a spring to add,
 * also an angular one, has a particle that is removed; MSIM_ERR_SIZE. */
MSIM_API msim_status msim_scene_edit(msim_scene *scene, const msim_edit *edit, msim_error *err);

MSIM_API msim_status msim_scene_add_rope(msim_scene *scene, const msim_rope *rope, msim_error *err);
MSIM_API msim_status msim_scene_add_cloth(msim_scene *scene, const msim_cloth *cloth,
                                          msim_error *err);
MSIM_API msim_status msim_scene_add_lattice(msim_scene *scene, const msim_lattice *lattice,
                                            msim_error *err);

/* Get the complete content of the scene; set view->size first. Valid until the next call that
 * changes the scene, or fails to. */
MSIM_API msim_status msim_scene_get(const msim_scene *scene, msim_scene_view *view);

/* Describe scene files by a JSON schema (draft 2020-12), with "unit" and "values" (in words) of
 * each key: at most `capacity` bytes of it, a zero included. Returns its length without the zero.
 * Nullable if capacity is 0: to. */
MSIM_API size_t msim_scene_schema(char *to, size_t capacity);

#ifdef __cplusplus
}
#endif
#endif
