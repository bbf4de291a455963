#include "scene/scene_keys.h"

#include <math.h>
#include <stddef.h>

int ms_range_contains(ms_range range, double value) {
  if (!isfinite(value)) return 0;
  switch (range) {
    case MS_NOT_NEGATIVE:
      return value >= 0;
    case MS_POSITIVE:
      return value > 0;
    case MS_FRACTION:
      return value >= 0 && value <= 1;
    case MS_POSITIVE_INTEGER:
      return value >= 1 && value <= INT32_MAX && value == floor(value);
    case MS_INDEX:
      return value >= 0 && value <= INT32_MAX && value == floor(value);
    case MS_ANY:
    default:
      return 1;
  }
}

const char *ms_range_text(ms_range range) {
  static const char *const texts[] = {[MS_ANY] = "a finite number",
                                      [MS_NOT_NEGATIVE] = "a finite number >= 0",
                                      [MS_POSITIVE] = "a finite number > 0",
                                      [MS_FRACTION] = "a number in [0, 1]",
                                      [MS_POSITIVE_INTEGER] = "a whole number from 1 to 2147483647",
                                      [MS_INDEX] = "a whole number from 0 on"};
  return texts[range];
}

const ms_scene_key ms_section_keys[MS_SECTIONS] = {
    {"msim", MS_VERSION, MS_ANY, 1, NULL, "", "version of this format", "1"},
    {"name", MS_TEXT, MS_ANY, 1, "\"\"", "", "name of the scene, for reports", "\"a pendulum\""},
    {"particles", MS_SECTION, MS_ANY, 1, "", "", "particles, listed one by one",
     "{\"x\": [[0, 0, 2], [0.5, 0, 2]], \"mass\": 1}"},
    {"laws", MS_LIST, MS_ANY, 1, "[]", "",
     "laws of springs other than f = k e, numbered from 1; law 0, the linear one, may stand first",
     "[{\"type\": \"linear\"}, {\"type\": \"tension\"}]"},
    {"objects", MS_LIST, MS_ANY, 1, "", "",
     "ropes, cloths and lattices, whose particles and springs follow those that are listed",
     "[{\"type\": \"rope\", \"n\": 3, \"from\": [0, 0, 0], \"to\": [1, 0, 0], \"mass\": 1, \"k\": "
     "100}]"},
    {"springs", MS_SECTION, MS_ANY, 1, "", "",
     "springs, listed one by one; with d = x_j - x_i, l = |d| and u = d/l the force on particle i "
     "is k (l - rest) u + damping (u . (v_j - v_i)) u, and the opposite on particle j",
     "{\"ij\": [[0, 1]], \"k\": 500}"},
    {"angles", MS_SECTION, MS_ANY, 1, "", "",
     "angular springs, which resist bending and do not stretch; theta, the angle at j between its "
     "edges to i and k, from 0 to pi where they are straight, has the elastic energy k/2 (theta - "
     "rest)^2 and the damping torque damping dtheta/dt",
     "{\"ijk\": [[0, 1, 2]], \"k\": 0.1}"},
    {"faces", MS_INDEX_ROWS, MS_ANY, 3, "[]", "",
     "triangles of particles [i, j, k] that viewers draw, besides those of cloths and lattices; "
     "they affect the motion in self_contact only",
     "[[0, 1, 2]]"},
    {"planes", MS_LIST, MS_ANY, 1, "[]", "",
     "half spaces normal . x >= offset, inside which all particles stay",
     "[{\"normal\": [0, 0, 1], \"offset\": 0}]"},
    {"planes_constrain", MS_FLAG, MS_ANY, 1, "", "",
     "whether implicit methods with long steps hold particles at planes by their matrix, as at "
     "colliders, also with collision = reflect; default: whether an object is a mesh",
     "true"},
    {"colliders", MS_LIST, MS_ANY, 1, "[]", "",
     "solids outside which, or inside which, all particles stay",
     "[{\"type\": \"sphere\", \"center\": [0, 0, 1], \"radius\": 0.5}]"},
    {"motions", MS_LIST, MS_ANY, 1, "[]", "",
     "prescribed motions of pinned particles, which are at their first point before the first "
     "time, and at the last one after the last time",
     "[{\"particles\": [0], \"t\": [0, 1], \"x\": [[[0, 0, 2]], [[0, 0, 3]]]}]"},
    {"self_contact", MS_SECTION, MS_ANY, 1, "", "",
     "faces and ropes do not pass through each other and themselves; default: they do",
     "{\"thickness\": 0.005, \"friction\": 0.3}"},
    {"run", MS_SECTION, MS_ANY, 1, "{}", "",
     "options of the run, which those on the command line replace",
     "{\"integrator\": \"velocity-verlet\", \"h\": 1e-3, \"t_end\": 2}"}};

const ms_scene_key ms_particle_keys[MS_PARTICLE_KEYS] = {
    {"x", MS_ROWS, MS_ANY, 3, NULL, "m", "positions at the start", "[[0, 0, 2], [0.5, 0, 2]]"},
    {"v", MS_ROWS, MS_ANY, 3, "", "m/s", "velocities at the start; default: 0",
     "[[0, 0, 0], [1, 0, 0]]"},
    {"mass", MS_NUMBER_EACH, MS_POSITIVE, 1, NULL, "kg", "masses", "0.5"},
    {"pinned", MS_INDICES, MS_ANY, 1, "[]", "",
     "indices, from 0, of the particles that never move; their velocities must be 0", "[0]"},
    {"force", MS_ROWS, MS_ANY, 3, "", "N",
     "constant forces beside gravity, drag and springs; default: 0", "[[0, 0, 0], [0, 0, 1.5]]"}};

const ms_scene_key ms_spring_keys[MS_SPRING_KEYS] = {
    {"ij", MS_INDEX_ROWS, MS_ANY, 2, NULL, "",
     "pairs [i, j] of particles that springs connect; particles of objects count, too",
     "[[0, 1], [1, 2]]"},
    {"k", MS_NUMBER_EACH, MS_NOT_NEGATIVE, 1, NULL, "N/m", "spring constants", "500"},
    {"rest", MS_NUMBER_EACH, MS_NOT_NEGATIVE, 1, "", "m",
     "rest lengths; default: the lengths at the start", "0.4"},
    {"damping", MS_NUMBER_EACH, MS_NOT_NEGATIVE, 1, "0", "N s/m", "damping constants", "0.1"},
    {"law", MS_NUMBER_EACH, MS_INDEX, 1, "0", "",
     "numbers of laws: 0 is linear; i is element i of `laws`, counted from 1 unless the first one "
     "is linear and has no other key",
     "1"}};

const ms_scene_key ms_angle_keys[MS_ANGLE_KEYS] = {
    {"ijk", MS_INDEX_ROWS, MS_ANY, 3, NULL, "",
     "particles [i, j, k] of each angle, the vertex j in the middle; particles of objects count, "
     "too",
     "[[0, 1, 2]]"},
    {"k", MS_NUMBER_EACH, MS_NOT_NEGATIVE, 1, NULL, "N m/rad^2", "bending stiffnesses", "0.1"},
    {"rest", MS_NUMBER_EACH, MS_NOT_NEGATIVE, 1, "", "rad",
     "rest angles, at most pi; default: the angles at the start, exactly pi where edges are "
     "straight",
     "1.5"},
    {"damping", MS_NUMBER_EACH, MS_NOT_NEGATIVE, 1, "0", "N m s/rad", "damping constants",
     "0.001"}};

const ms_scene_key ms_law_keys[MS_LAW_KEYS] = {
    {"type", MS_LAW_TYPE, MS_ANY, 1, NULL, "",
     "type of law, for the elastic force f, > 0 if the spring pulls, at the stretch e = l - rest: "
     "linear, f = k e; tension, f = k max(e, 0); compression, f = k min(e, 0); dead_band, f = k (e "
     "- c), c = e limited to half_width; polynomial, f = k sum of coefficients[i] e^(i+1); table, "
     "the monotone cubic through points",
     "\"tension\""},
    {"half_width", MS_NUMBERS, MS_NOT_NEGATIVE, 1, "", "m",
     "dead_band: no force while |e| is below it", "0.01"},
    {"coefficients", MS_NUMBER_LIST, MS_ANY, 1, "", "1/m^i",
     "polynomial: those of e, e^2, e^3, ..., over k", "[1, 0, 50]"},
    {"limit", MS_NUMBERS, MS_POSITIVE, 1, "", "m",
     "polynomial: where |e| is above it, the force continues linearly", "0.2"},
    {"stretch", MS_NUMBER_LIST, MS_ANY, 1, "", "m", "table: values of e, ascending, at least 2",
     "[-0.1, 0, 0.1]"},
    {"force", MS_NUMBER_LIST, MS_ANY, 1, "", "N",
     "table: f at these; beyond them it is linear; k has no effect", "[-10, 0, 5]"},
    {"break_strain", MS_NUMBERS, MS_NOT_NEGATIVE, 1, "0", "",
     "any type, also linear: a spring with e/rest above it breaks, and exerts no force from then "
     "on; "
     "0: never",
     "0.2"},
    {"break_force", MS_NUMBERS, MS_NOT_NEGATIVE, 1, "0", "N",
     "any type, also linear: a spring with f above it breaks; 0: never", "50"}};

const ms_scene_key ms_plane_keys[MS_PLANE_KEYS] = {
    {"normal", MS_NUMBERS, MS_ANY, 3, NULL, "",
     "vector that points to the side of the particles; its length, not 0, divides normal and "
     "offset",
     "[0, 0, 1]"},
    {"offset", MS_NUMBERS, MS_ANY, 1, NULL, "m",
     "distance of the plane from the origin, along the normal", "-0.5"},
    {"restitution", MS_NUMBERS, MS_FRACTION, 1, "1", "",
     "ratio of the normal speeds after and before an impact; 1: elastic", "0.5"},
    {"friction", MS_NUMBERS, MS_NOT_NEGATIVE, 1, "0", "", "coefficient of Coulomb friction",
     "0.3"}};

const ms_scene_key ms_self_contact_keys[MS_SELF_CONTACT_KEYS] = {
    {"thickness", MS_NUMBERS, MS_POSITIVE, 1, NULL, "m",
     "distance that surfaces keep; where they are closer than twice that at the start, half of it",
     "0.005"},
    {"friction", MS_NUMBERS, MS_NOT_NEGATIVE, 1, "0", "", "coefficient of Coulomb friction",
     "0.3"}};

const ms_scene_key ms_motion_keys[MS_MOTION_KEYS] = {
    {"particles", MS_INDICES, MS_ANY, 1, NULL, "",
     "indices of pinned particles, each in one motion at most", "[0, 3]"},
    {"t", MS_NUMBER_LIST, MS_ANY, 1, NULL, "s", "increasing times", "[0, 1.5]"},
    {"x", MS_ROW_LISTS, MS_ANY, 3, NULL, "m", "the points of all these particles at each time",
     "[[[0, 0, 2], [1, 0, 2]], [[0, 0, 3], [1, 0, 3]]]"},
    {"interpolation", MS_TEXT, MS_ANY, 1, "\"linear\"", "",
     "linear: straight lines between points; cubic: Hermite's cubics with continuous velocities, "
     "at each time that of the parabola through three points, at both ends 0",
     "\"cubic\""}};

const ms_scene_key ms_collider_motion_keys[MS_COLLIDER_MOTION_KEYS] = {
    {"t", MS_NUMBER_LIST, MS_ANY, 1, NULL, "s", "increasing times", "[0, 1.5]"},
    {"x", MS_ROWS, MS_ANY, 3, NULL, "m",
     "positions of the center, or of the middle of the axis, at each time",
     "[[0, 0, 1], [1, 0, 1]]"},
    {"rotation", MS_ROWS, MS_ANY, 3, "", "rad",
     "rotation vectors about that point at each time, after the rotation of the collider; without "
     "them it does not rotate",
     "[[0, 0, 0], [0, 0, 3.14]]"},
    {"interpolation", MS_TEXT, MS_ANY, 1, "\"linear\"", "", "as of motions of pinned particles",
     "\"cubic\""}};

const ms_scene_key ms_type_key = {"type", MS_TYPE, MS_ANY,           1,
                                  NULL,   "",      "type of object", "\"rope\""};

const ms_scene_key ms_pinned_key = {
    "pinned",
    MS_INDICES,
    MS_ANY,
    1,
    "[]",
    "",
    "indices within the object, from 0, of the particles that never move",
    "[0]"};

const ms_scene_key ms_cloth_pinned_key = {
    "pinned",
    MS_NAMED_INDICES,
    MS_ANY,
    1,
    "[]",
    "",
    "particles that never move: indices within the object, from 0, or names of groups",
    "\"corners\""};
