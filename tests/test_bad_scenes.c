/* Tests of invalid scene files: each is refused with one message that names the file and the
 * key. */
#define _POSIX_C_SOURCE 200809L
#include <dirent.h>
#include <stdio.h>

#include "scene_check.h"

/* A file in the folder bad_scenes, and words that its message must contain. */
static const struct {
  const char *file, *words;
} cases[] = {
    {"syntax_missing_comma",
     "syntax_missing_comma.json:3:8: '}' expected near '\"name\"'; is a comma missing at line 2, "
     "column 12, "},
    {"syntax_truncated", ":1:38: "},
    {"syntax_trailing_text", ":5:3: end of file expected"},
    {"syntax_duplicate_key", "duplicate object key near"},
    {"syntax_nan", ":3:26: invalid token near 'NaN'"},
    {"syntax_infinity", "invalid token near 'Infinity'"},
    {"syntax_overflow", "real number overflow near '1e999'; numbers must be finite"},
    {"syntax_overflow_behind_comma", "overflow near '1e999'; numbers must be finite"},
    {"syntax_big_integer", "'; write so large a number with an exponent, like 1e20"},
    {"syntax_depth", "maximum parsing depth reached"},
    {"syntax_control_character", ":1:24: unexpected newline"},
    {"syntax_nul_character", "NUL"},
    {"syntax_single_quotes", ":1:2: "},
    {"syntax_comment", ":1:13: "},
    {"empty", "it is empty"},
    {"syntax_utf8", "unable to decode byte 0xff"},
    {"syntax_nul_byte", ":2:1: "},
    {"rope_no_from", "objects[0].from is missing; it must be an array of 3"},
    {"blank", ":3:0: "},
    {"root_array", "the scene is an array of 2; it must be an object"},
    {"version_missing", "msim is missing; it must be 1"},
    {"version_2", "msim is 2; it must be 1"},
    {"version_text", "msim is \"1\"; it must be 1"},
    {"version_real", "msim is 1.0; it must be 1"},
    {"no_particles", "it contains no particles"},
    {"no_particles_in_x", "it contains no particles"},
    {"unknown_key",
     "gravitiy is an unknown key (did you mean 'gravity'?); the keys are msim, name"},
    {"unknown_key_with_newline", "a b is an unknown key"},
    {"unknown_key_very_long", "... is an unknown key; the keys"},
    {"name_number", "name is 5; it must be a string"},
    {"gravity_number", "gravity is -9.81; it must be an array of 3"},
    {"gravity_short", "gravity is an array of 2; it must be an array of 3"},
    {"gravity_text", "gravity[1] is \"-9.81\"; it must be a finite number"},
    {"drag_negative", "drag is -0.5; it must be a finite number >= 0"},
    {"drag_null", "drag is null; it must be"},
    {"particles_array", "particles is an array of 1; it must be an object"},
    {"particles_unknown_key", "particles.masss is an unknown key (did you mean 'mass'?)"},
    {"particles_no_x", "particles.x is missing"},
    {"particles_no_mass", "particles.mass is missing"},
    {"x_flat", "particles.x[0] is 0; it must be an array of 3"},
    {"x_object", "particles.x is an object; it must be an array"},
    {"x_two_dimensions", "particles.x[1] is an array of 2; it must be an array of 3"},
    {"x_text", "particles.x[1][2] is \"2\"; it must be a finite number"},
    {"x_true", "particles.x[0][0] is true; it must be"},
    {"v_short", "particles.v is an array of 1; it must be an array of 3"},
    {"mass_zero", "particles.mass[2] is 0; it must be a finite number > 0"},
    {"mass_negative", "particles.mass is -2.5; it must be a finite number > 0"},
    {"mass_underflow", "particles.mass is 0.0; it must be a finite number > 0"},
    {"mass_short",
     "particles.mass is an array of 2; it must be a finite number > 0 for all particles, or an "
     "array of 3"},
    {"mass_text", "particles.mass is \"heavy\"; it must be"},
    {"pinned_number", "particles.pinned is 0; it must be an array"},
    {"pinned_out_of_range", "particles.pinned[1] is 3; it must be a whole number from 0 to 2"},
    {"pinned_negative", "particles.pinned[0] is -1; it must be"},
    {"pinned_real", "particles.pinned[0] is 1.5; it must be a whole number"},
    {"pinned_flags",
     "particles.pinned[0] is true; it must be a whole number from 0 to 2: list the indices of "
     "particles, not a flag for each"},
    {"syntax_decimal_comma",
     ":3:45: string or '}' expected near '0'; decimals are written with a point, 0.001"},
    {"syntax_last_comma", "; remove the comma before it, at line 3, column 56"},
    {"syntax_comment_hash", ":2:2: string or '}' expected near '#'; JSON has no comments"},
    {"syntax_key_without_quotes", "; keys are written in double quotes"},
    {"syntax_curly_quotes", "; keys and texts are written in straight double quotes"},
    {"syntax_true_of_python", "near 'True'; JSON writes true"},
    {"syntax_minus_infinity", "near '-'; numbers must be finite"},
    {"syntax_plus", "near '+'; numbers are written like 0.5, -2 or 1e-3"},
    {"syntax_no_leading_zero", "near '.'; numbers are written like"},
    {"syntax_fraction", "near '/'; numbers are written like"},
    {"syntax_hexadecimal", "near 'x'; numbers are written like"},
    {"syntax_missing_colon", "':' expected near '1'; a colon stands between a key and its value"},
    {"syntax_equals_sign", "':' expected near '='; a colon stands between"},
    {"syntax_missing_quote", "unexpected newline near '\"x,'; is the closing quote missing?"},
    {"syntax_byte_order_mark", "; save the file as UTF-8 without a byte order mark"},
    {"syntax_latin1", "unable to decode byte 0xdf near '\"Stra'; save the file as UTF-8"},
    {"syntax_yaml", "'[' or '{' expected near 'msim'; a scene is a JSON object and begins with {"},
    {"option_outside_run", "h is an unknown key here; it belongs into 'run'; the keys are"},
    {"gravity_quoted_comma",
     "gravity[2] is \"-9,81\"; it must be a finite number, without quotes and with a decimal "
     "point"},
    {"gravity_vector_of_objects", "gravity is an object; it must be an array of 3 numbers"},
    {"mass_with_unit",
     "particles.mass is \"1 kg\"; it must be a finite number > 0 for all particles, or an array of "
     "2, without quotes"},
    {"v_flat", "particles.v[0] is 0; it must be an array of 3 numbers"},
    {"v_one_row", "particles.v is an array of 1; it must be an array of 2 arrays of 3"},
    {"pinned_true", "particles.pinned is true; it must be an array of indices of particles"},
    {"rope_pinned_word",
     "objects[0].pinned is \"first\"; it must be an array of indices of particles"},
    {"cloth_pinned_word",
     "objects[0].pinned is \"first_corner\"; it must be an array of indices of particles, "
     "\"corners\", \"first_row\" or \"first_corners\""},
    {"ij_missing_pair", "springs.ij is missing; it must be an array of arrays of 2 indices"},
    {"faces_flat", "faces[0] is 0; it must be an array of 3 indices"},
    {"run_h_quoted_comma",
     "run.h is \"0,001\"; it must be a number > 0 or auto, without quotes and with a decimal "
     "point"},
    {"run_h_with_unit", "run.h is \"1 ms\"; it must be a number > 0 or auto, without quotes"},
    {"pinned_moving", "particles.pinned[1] is particle 1, whose velocity is not 0"},
    {"springs_array", "springs is an array of 1; it must be an object"},
    {"springs_unknown_key",
     "springs.length is an unknown key (did you mean 'rest'?); the keys are ij, k, rest, damping"},
    {"springs_no_ij", "springs.ij is missing"},
    {"springs_no_k", "springs.k is missing"},
    {"springs_no_particles",
     "springs.ij[0][0] is 0; it must be removed, because there are no particles"},
    {"ij_triple", "springs.ij[1] is an array of 3; it must be an array of 2"},
    {"faces_number", "faces is 3; it must be an array"},
    {"faces_pair", "faces[1] is an array of 2; it must be an array of 3"},
    {"faces_twice", "faces[0] has particle 1 twice"},
    {"ij_flat", "springs.ij[0] is 0; it must be an array of 2"},
    {"ij_out_of_range", "springs.ij[3][1] is 3; it must be a whole number from 0 to 2"},
    {"ij_huge", "springs.ij[0][1] is 4294967297; it must be"},
    {"ij_real", "springs.ij[0][1] is 1.0; it must be a whole number"},
    {"ij_itself", "springs.ij[1] connects particle 2 to itself"},
    {"k_negative", "springs.k[1] is -1000.0; it must be a finite number >= 0"},
    {"k_long", "springs.k is an array of 2; it must be"},
    {"rest_negative", "springs.rest is -1; it must be a finite number >= 0"},
    {"damping_negative", "springs.damping[0] is -1; it must be a finite number >= 0"},
    {"spring_too_long", "the length of springs.ij[0] is beyond the range of double"},
    {"planes_object", "planes is an object; it must be an array"},
    {"plane_number", "planes[0] is 3; it must be an object"},
    {"plane_unknown_key", "planes[1].mu is an unknown key"},
    {"plane_no_normal", "planes[1].normal is missing"},
    {"plane_no_offset", "planes[1].offset is missing"},
    {"plane_zero_normal", "planes[1].normal is 0; it must be a nonzero vector"},
    {"plane_bouncy", "planes[1].restitution is 1.1; it must be a number in [0, 1]"},
    {"plane_restitution_negative", "planes[1].restitution is -0.1"},
    {"plane_friction_negative", "planes[1].friction is -1; it must be a finite number >= 0"},
    {"plane_offset_overflow", "planes[1].offset / |normal| is not finite"},
    {"colliders_object", "colliders is an object; it must be an array"},
    {"collider_number", "colliders[0] is 3; it must be an object"},
    {"collider_no_type",
     "colliders[0].type is missing; it must be \"sphere\", \"capsule\", \"cylinder\""},
    {"collider_type_number", "colliders[0].type is 1; it must be \"sphere\""},
    {"collider_unknown_type",
     "colliders[0].type is \"shpere\"; it must be \"sphere\", \"capsule\", \"cylinder\", \"box\", "
     "\"heightfield\" or \"sdf\" (did you mean 'sphere'?)"},
    {"collider_unknown_key",
     "colliders[1].radius is an unknown key; the keys are type, center, size, rotation, "
     "restitution, friction, inside"},
    {"collider_no_center", "colliders[0].center is missing; it must be an array of 3"},
    {"collider_no_radius", "colliders[0].radius is missing"},
    {"collider_radius_zero", "colliders[0].radius is 0; it must be a finite number > 0"},
    {"collider_size_short", "colliders[0].size is an array of 2; it must be an array of 3"},
    {"collider_no_axis", "colliders[0].from and to are the same point"},
    {"collider_too_large",
     "colliders[0].from and to are so large that distances are beyond the range of double"},
    {"planes_constrain_text", "planes_constrain is \"yes\"; it must be true or false"},
    {"collider_inside_number", "colliders[0].inside is 1; it must be true or false"},
    {"collider_bouncy", "colliders[0].restitution is 2; it must be a number in [0, 1]"},
    {"collider_friction_negative",
     "colliders[0].friction is -0.1; it must be a finite number >= 0"},
    {"collider_motion_short", "colliders[0].motion.x is an array of 1; it must be an array of 2"},
    {"collider_motion_order", "colliders[0].motion.t[1] is 1; it must exceed t[0] = 1"},
    {"collider_motion_key", "colliders[0].motion.v is an unknown key; the keys are t, x, rotation"},
    {"collider_motion_too_far",
     "colliders[0].motion.x[1] contains -1e+300, whose square is beyond the range of double; use "
     "smaller numbers"},
    {"collider_turns_too_fast",
     "colliders[0].motion.rotation[1] is reached at a speed of 3e+200, whose square is beyond the "
     "range of double; use times t that lie further apart"},
    {"collider_heights_too_far",
     "colliders[0].origin, spacing, n or heights are so large that distances are beyond the range "
     "of double; use smaller numbers"},
    {"collider_heights_short",
     "colliders[0].heights is an array of 3; it must be an array of as many numbers as n says"},
    {"collider_heights_row", "colliders[0].n[0] is 1; it must be at least 2"},
    {"collider_sdf_open", "colliders[0].values[7] is 0 at the border of the grid; it must be > 0"},
    {"motion_too_far",
     "motions[0].x[1] contains 1e+300, whose square is beyond the range of double"},
    {"motion_too_fast", "motions[0].x[1] is reached at a speed of"},
    {"law_too_steep",
     "laws[0].stretch and force give a slope beyond the range of double; use smaller numbers"},
    {"objects_object", "objects is an object; it must be an array"},
    {"object_text", "objects[0] is \"rope\"; it must be an object"},
    {"object_no_type", "objects[0].type is missing"},
    {"object_type_number", "objects[0].type is 1; it must be"},
    {"object_unknown_type",
     "objects[0].type is \"clot\"; it must be \"rope\", \"cloth\", \"lattice\" or \"mesh\" (did "
     "you "
     "mean 'cloth'?)"},
    {"object_mesh", "objects[0].mass is missing; it must be a finite number > 0"},
    {"object_unknown_key", "objects[0].lenght is an unknown key"},
    {"second_object", "objects[1].k is -1; it must be a finite number >= 0"},
    {"rope_no_n", "objects[0].n is missing"},
    {"rope_n_zero", "objects[0].n is 0; it must be a whole number from 1"},
    {"rope_n_point", "objects[0].n is 5.0; it must be a whole number"},
    {"rope_n_real", "objects[0].n is 5.5; it must be a whole number"},
    {"rope_n_absurd", "objects[0].n gives 2000000000 particles; the limit is 715827882"},
    {"rope_mass_zero", "objects[0].mass is 0; it must be a finite number > 0"},
    {"rope_from_short", "objects[0].from is an array of 2; it must be an array of 3"},
    {"rope_too_far", "objects[0] extends beyond the range of double"},
    {"rope_pinned_out_of_range",
     "objects[0].pinned[1] is 5; it must be a whole number from 0 to 4"},
    {"rope_pinned_name", "objects[0].pinned[0] is \"corners\"; it must be a whole number"},
    {"cloth_n_number", "objects[0].n is 3; it must be an array of 2"},
    {"cloth_n_negative", "objects[0].n[1] is -4; it must be a whole number from 1"},
    {"cloth_n_absurd", "objects[0].n gives 4000000000000000000 particles"},
    {"cloth_k_shear_negative", "objects[0].k.shear is -5; it must be a finite number >= 0"},
    {"cloth_k_unknown_key", "objects[0].k.sheer is an unknown key (did you mean 'shear'?)"},
    {"cloth_pinned_name",
     "objects[0].pinned[1] is \"first_corner\"; it must be an index, \"corners\""},
    {"cloth_row_text", "objects[0].row[0] is \"1\"; it must be a finite number"},
    {"lattice_size_negative", "objects[0].size[1] is -1; it must be a finite number >= 0"},
    {"lattice_n_absurd", "objects[0].n gives 99035203"},
    {"lattice_k_object", "objects[0].k is an object; it must be"},
    {"lattice_mass_vanishes",
     "objects[0].mass is 4.94066e-324, which is 0 for each of 8 particles"},
    {"run_array", "run is an array of 1; it must be an object"},
    {"run_unknown", "run.t_endd: there is no option 't_endd' (did you mean 't_end'?)"},
    {"run_h_zero", "run.h is '0'; it must be a number > 0"},
    {"run_h_negative", "run.h is '-0.001'; it must be a number > 0"},
    {"run_h_text", "run.h is \"1e-3\"; it must be a number > 0"},
    {"run_h_true", "run.h is true; it must be a number > 0 or auto"},
    {"run_steps_real", "run.steps is '10.5'; it must be a whole number >= 0"},
    {"run_threads_huge", "run.threads is '3000000000'; it must be at most 2147483647"},
    {"run_solver_number", "run.solver is 3; it must be a string: name"},
    {"run_solver_object", "run.solver is an object; it must be a string: name"},
    {"run_integrator_empty", "run.integrator is ''; it must be a name"},
    {"run_jacobian_word", "run.jacobian is 'exakt'; it must be exact or clamp"},
    {"run_plugin_path", "run.plugin_path is not allowed in scene files"}};
enum { NCASES = sizeof cases / sizeof *cases };

static void assert_bad(const char *file, const char *words) {
  limited_allocator memory;
  const msim_allocator alloc = make_limited_allocator(&memory);
  char path[512];
  msim_error err = {0, ""};
  msim_scene *scene = (msim_scene *)&memory;
  snprintf(path, sizeof path, "%s/bad_scenes/%s.json", TEST_SOURCE_DIR, file);
  msim_status status = msim_scene_load(&alloc, path, &scene, &err);
  if (status >= 0 || !strstr(err.text, words) || !strstr(err.text, file))
    fail_msg("%s: status %d, \"%s\" does not say \"%s\"", file, (int)status, err.text, words);
  assert_int_equal(err.status, status);
  assert_null(scene);
  assert_null(strpbrk(err.text, "\n\r"));
  assert_int_equal(memory.live, 0);
}

static void each_is_refused(void **state) {
  (void)state;
  for (int i = 0; i < NCASES; i++) assert_bad(cases[i].file, cases[i].words);
}

static void every_bad_scene_is_tested(void **state) {
  (void)state;
  DIR *folder = opendir(TEST_SOURCE_DIR "/bad_scenes");
  int files = 0;
  assert_non_null(folder);
  for (struct dirent *entry; (entry = readdir(folder)) != NULL;) files += *entry->d_name != '.';
  closedir(folder);
  assert_int_equal(files, NCASES);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(each_is_refused),
                                     cmocka_unit_test(every_bad_scene_is_tested)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
