/* scene_keys - the keys of scene files: what their values must be, and what they mean; the loader
 * reads by these tables, and the documentation is made from them */
#ifndef MS_SCENE_KEYS_H
#define MS_SCENE_KEYS_H

#include <stdint.h>

/* Valid ranges of numbers; all must be finite. */
typedef enum ms_range {
  MS_ANY,
  MS_NOT_NEGATIVE,
  MS_POSITIVE,
  MS_FRACTION,         /* [0, 1] */
  MS_POSITIVE_INTEGER, /* integer, 1 to INT32_MAX */
  MS_INDEX             /* integer, 0 to INT32_MAX */
} ms_range;

int ms_range_contains(ms_range range, double value);
const char *ms_range_text(ms_range range); /* "a finite number > 0" */

typedef enum ms_key_form {
  MS_NUMBERS,         /* a number, or an array of `count` numbers if that is above 1 */
  MS_NUMBER_EACH,     /* a number for all elements, or an array of one for each */
  MS_NUMBER_LIST,     /* an array of numbers, of any length */
  MS_ROWS,            /* an array of arrays of `count` numbers */
  MS_ROW_LISTS,       /* an array of arrays of arrays of `count` numbers */
  MS_INDICES,         /* an array of particle indices */
  MS_NAMED_INDICES,   /* the same; they, or the whole array, may be a name */
  MS_INDEX_ROWS,      /* an array of arrays of `count` particle indices */
  MS_NUMBER_OR_PARTS, /* a number, or an object with a number for each part */
  MS_TEXT,
  MS_VERSION, /* of the format */
  MS_TYPE,    /* of an object */
  MS_LAW_TYPE,
  MS_COLLIDER_TYPE,
  MS_FLAG,           /* true or false; 0 or 1 in files of importers */
  MS_FLAG_OR_NUMBER, /* true, false or a number; "true" in files of importers */
  MS_SECTION,        /* an object */
  MS_LIST            /* an array of objects */
} ms_key_form;

typedef struct ms_scene_key {
  const char *key;
  ms_key_form form;
  ms_range range; /* of its numbers */
  int32_t count;
  const char *preset;  /* the default as JSON, "" if none fits in; NULL: the key is required */
  const char *unit;    /* "" without */
  const char *doc;     /* one sentence */
  const char *example; /* a value as JSON */
} ms_scene_key;

/* In the order in which they are read: springs may connect particles of objects. */
enum {
  MS_KEY_MSIM,
  MS_KEY_NAME,
  MS_KEY_PARTICLES,
  MS_KEY_LAWS,
  MS_KEY_OBJECTS,
  MS_KEY_SPRINGS,
  MS_KEY_ANGLES,
  MS_KEY_FACES,
  MS_KEY_PLANES,
  MS_KEY_PLANES_CONSTRAIN,
  MS_KEY_COLLIDERS,
  MS_KEY_MOTIONS,
  MS_KEY_SELF_CONTACT,
  MS_KEY_RUN,
  MS_SECTIONS
};
extern const ms_scene_key ms_section_keys[MS_SECTIONS];

enum { MS_KEY_X, MS_KEY_V, MS_KEY_MASS, MS_KEY_PINNED, MS_KEY_FORCE, MS_PARTICLE_KEYS };
extern const ms_scene_key ms_particle_keys[MS_PARTICLE_KEYS];

enum { MS_KEY_IJ, MS_KEY_K, MS_KEY_REST, MS_KEY_DAMPING, MS_KEY_LAW, MS_SPRING_KEYS };
extern const ms_scene_key ms_spring_keys[MS_SPRING_KEYS];

enum { MS_KEY_IJK, MS_KEY_ANGLE_K, MS_KEY_ANGLE_REST, MS_KEY_ANGLE_DAMPING, MS_ANGLE_KEYS };
extern const ms_scene_key ms_angle_keys[MS_ANGLE_KEYS];

enum {
  MS_KEY_LAW_TYPE,
  MS_KEY_HALF_WIDTH,
  MS_KEY_COEFFICIENTS,
  MS_KEY_LIMIT,
  MS_KEY_STRETCH,
  MS_KEY_LAW_FORCE,
  MS_KEY_BREAK_STRAIN,
  MS_KEY_BREAK_FORCE,
  MS_LAW_KEYS
};
extern const ms_scene_key ms_law_keys[MS_LAW_KEYS];

enum { MS_KEY_NORMAL, MS_KEY_OFFSET, MS_KEY_RESTITUTION, MS_KEY_FRICTION, MS_PLANE_KEYS };
extern const ms_scene_key ms_plane_keys[MS_PLANE_KEYS];

enum { MS_KEY_SELF_THICKNESS, MS_KEY_SELF_FRICTION, MS_SELF_CONTACT_KEYS };
extern const ms_scene_key ms_self_contact_keys[MS_SELF_CONTACT_KEYS];

enum { MS_KEY_MOVED, MS_KEY_TIMES, MS_KEY_POINTS, MS_KEY_INTERPOLATION, MS_MOTION_KEYS };
extern const ms_scene_key ms_motion_keys[MS_MOTION_KEYS];

enum {
  MS_KEY_COLLIDER_TIMES,
  MS_KEY_COLLIDER_POINTS,
  MS_KEY_COLLIDER_ROTATION,
  MS_KEY_COLLIDER_INTERPOLATION,
  MS_COLLIDER_MOTION_KEYS
};
extern const ms_scene_key ms_collider_motion_keys[MS_COLLIDER_MOTION_KEYS];

/* Of each object; those of its type are in objects.h. Cloths also have names for their particles */
extern const ms_scene_key ms_type_key, ms_pinned_key, ms_cloth_pinned_key;

#endif
