/* Tests of meshes: which particles, springs and faces a surface gives, what is repaired and
 * counted, what is refused, want of memory, and files in a locale with a decimal comma. */
#define _DEFAULT_SOURCE /* mkdtemp */
#include <locale.h>
#include <stdio.h>
#include <unistd.h>

#include "meshes.h"
#include "scene_check.h"

static int has_spring(const msim_scene_view *view, int32_t i, int32_t j, double k) {
  int count = 0;
  for (int32_t e = 0; e < view->nsprings; e++)
    count += view->k[e] == k && ((view->ij[2 * e] == i && view->ij[2 * e + 1] == j) ||
                                 (view->ij[2 * e] == j && view->ij[2 * e + 1] == i));
  return count;
}

static double distance(const msim_scene_view *view, int32_t i, int32_t j) {
  double sum = 0;
  for (int c = 0; c < 3; c++) sum += pow(view->x[3 * i + c] - view->x[3 * j + c], 2);
  return sqrt(sum);
}

/*------------------------------------- surfaces -------------------------------------------------*/

static void a_cube_has_a_spring_along_each_edge(void **state) {
  (void)state;
  const int32_t pinned[2] = {0, 7};
  double x[24];
  place_cube(-1, 2, x);
  msim_scene *scene = make_started_scene();
  msim_mesh mesh = make_mesh(8, x, 12, cube_faces);
  mesh.npinned = 2, mesh.pinned = pinned;
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nparticles, 9);
  assert_int_equal(view.nsprings, 18); /* E = V + F - 2 */
  assert_int_equal(view.nfaces, 12);
  assert_memory_equal(view.x + 3, x, sizeof x);
  for (int i = 1; i < 9; i++) assert_true(view.mass[i] == 0.25);
  for (int i = 0; i < 9; i++) assert_int_equal(view.pinned[i], i == 1 || i == 8);
  for (int i = 0; i < 36; i++) assert_int_equal(view.faces[i], cube_faces[i] + 1);
  for (int i = 0; i < 36; i++) {
    const int32_t a = view.faces[i], b = view.faces[i / 3 * 3 + (i + 1) % 3];
    assert_int_equal(has_spring(&view, a, b, 100), 1);
  }
  for (int e = 0; e < 18; e++) {
    assert_true(view.rest[e] == distance(&view, view.ij[2 * e], view.ij[2 * e + 1]));
    assert_true(view.damping[e] == 0.5);
  }
  msim_scene_destroy(scene);
}

static void bends_join_the_vertices_opposite_an_edge(void **state) {
  (void)state;
  /* two triangles at the edge (0, 1), and a third one at the edge (1, 2) of one face */
  const double x[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -1, 1, 2, 2, 0};
  const int32_t faces[] = {0, 1, 2, 1, 0, 3, 1, 4, 2};
  msim_scene *scene = make_started_scene();
  msim_mesh mesh = make_mesh(5, x, 3, faces);
  mesh.bend = 7;
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  msim_scene_view view = view_of(scene);
  assert_int_equal(view.nsprings, 7 + 2);
  assert_int_equal(has_spring(&view, 1 + 2, 1 + 3, 7), 1);
  assert_int_equal(has_spring(&view, 1 + 0, 1 + 4, 7), 1);
  assert_int_equal(repairs_of(scene).open_edges, 5);
  mesh.k = 0;
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  view = view_of(scene);
  assert_int_equal(view.nsprings, 9 + 2);
  assert_int_equal(view.nparticles, 11);
  assert_int_equal(has_spring(&view, 6 + 2, 6 + 3, 7), 1);
  msim_scene_destroy(scene);
}

static void a_tetrahedron_bends_along_its_edges(void **state) {
  (void)state;
  const double x[12] = {1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1};
  const int32_t faces[12] = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2};
  msim_scene *scene = make_empty_scene();
  msim_mesh mesh = make_mesh(4, x, 4, faces);
  mesh.bend = 3, mesh.scale = 0.5, mesh.translate[2] = 10;
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nsprings, 12);
  for (int i = 0; i < 4; i++)
    for (int j = i + 1; j < 4; j++) {
      assert_int_equal(has_spring(&view, i, j, 100), 1);
      assert_int_equal(has_spring(&view, i, j, 3), 1);
    }
  for (int i = 0; i < 12; i++) assert_true(view.x[i] == 0.5 * x[i] + (i % 3 == 2 ? 10 : 0));
  msim_scene_destroy(scene);
}

/* Of triangles with vertices of their own: V - E + F = 2. */
static void spheres_of_single_triangles_are_joined(void **state) {
  (void)state;
  static double x[180 * 64];
  static int32_t faces[60 * 64];
  for (int i = 0; i < 60 * 64; i++) faces[i] = i;
  for (int depth = 0, n = 20; depth < 4; depth++, n *= 4) {
    assert_int_equal(make_sphere(depth, x), n);
    msim_scene *scene = make_empty_scene();
    const msim_mesh mesh = make_mesh(3 * n, x, n, faces);
    assert_ok(msim_scene_add_mesh(scene, &mesh, err));
    const msim_scene_view view = view_of(scene);
    assert_int_equal(view.nparticles, n / 2 + 2);
    assert_int_equal(view.nsprings, 3 * n / 2);
    assert_int_equal(view.nfaces, n);
    const msim_mesh_repairs r = repairs_of(scene);
    assert_int_equal(r.equal_vertices, 3 * n - (n / 2 + 2));
    assert_int_equal(r.near_vertices + r.unused_vertices + r.degenerate_faces + r.duplicate_faces +
                         r.turned_faces + r.flat_faces + r.open_edges + r.nonmanifold_edges,
                     0);
    /* particles are in the order in which faces use them first */
    assert_memory_equal(view.x, x, 9 * sizeof *x);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- repairs --------------------------------------------------*/

/* All defects at once: the cube remains, in the order of its vertices. */
static void defects_are_repaired_and_counted(void **state) {
  (void)state;
  double x[3 * 13] = {7, 7, 7}; /* of no face, far away */
  int32_t faces[3 * 16];
  place_cube(0, 1, x + 3);
  for (int i = 0; i < 36; i++) faces[i] = cube_faces[i] + 1;
  memcpy(x + 27, x + 3, 3 * sizeof *x); /* 9: at the place of 1, that is corner 0 */
  x[30] = x[31] = x[32] = 1 + 1e-6;     /* 10: near corner 7, within 1e-6 sqrt(3) */
  x[33] = 1 + 2e-6, x[34] = x[35] = 0;  /* 11: not near corner 1 */
  x[36] = x[37] = x[38] = 0.5;          /* 12: of a degenerate face only */
  faces[0] = 9;                         /* instead of 1 */
  faces[34] = 10;                       /* instead of 8 */
  const int32_t turned = faces[3];
  faces[3] = faces[4], faces[4] = turned;
  const int32_t more[12] = {1, 9, 12, 12, 12, 3, 3, 2, 1, 2, 3, 11};
  memcpy(faces + 36, more, sizeof more);
  msim_scene *scene = make_empty_scene();
  const msim_mesh mesh = make_mesh(13, x, 16, faces);
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  const msim_scene_view view = view_of(scene);
  const msim_mesh_repairs r = repairs_of(scene);
  assert_int_equal(r.unused_vertices, 2);
  assert_int_equal(r.equal_vertices, 1);
  assert_int_equal(r.near_vertices, 1);
  assert_int_equal(r.degenerate_faces, 2);
  assert_int_equal(r.duplicate_faces, 1);
  assert_int_equal(r.turned_faces, 1);
  assert_int_equal(r.nonmanifold_edges, 1); /* (1, 2), corners 0 and 1 ... */
  assert_int_equal(r.open_edges, 2);
  assert_int_equal(view.nparticles, 9);
  assert_memory_equal(view.x, x + 3, 24 * sizeof *x);
  assert_memory_equal(view.x + 24, x + 33, 3 * sizeof *x);
  assert_int_equal(view.nfaces, 13);
  assert_int_equal(view.nsprings, 20);
  for (int i = 0; i < 36; i += 3) { /* the orientation of the cube */
    int32_t same = 0;
    for (int t = 0; t < 3; t++)
      same |= view.faces[i] == cube_faces[i + t] &&
              view.faces[i + 1] == cube_faces[i + (t + 1) % 3] &&
              view.faces[i + 2] == cube_faces[i + (t + 2) % 3];
    assert_true(same);
  }
  msim_scene_destroy(scene);
}

/* Vertex 2 is near 0 and 1, which are not near each other: it is merged with 0, on whichever side
 * that is. */
static void the_first_of_near_vertices_stays(void **state) {
  (void)state;
  const int32_t faces[] = {0, 3, 4, 1, 3, 5, 2, 3, 5};
  for (int run = 0; run < 24; run++) {
    const int axis = run % 3, first = run / 3 % 2;
    double x[18] = {[9] = 1, [13] = 1, [17] = 1};
    x[3 * first + axis] = 2e-6, x[6 + axis] = 1e-6;
    for (int v = 0; v < 3; v++) x[3 * v + (axis + 1) % 3] = 1e-5 * run;
    msim_scene *scene = make_empty_scene();
    const msim_mesh mesh = make_mesh(6, x, 3, faces);
    assert_ok(msim_scene_add_mesh(scene, &mesh, err));
    assert_int_equal(repairs_of(scene).near_vertices, 1);
    assert_int_equal(repairs_of(scene).duplicate_faces, 0);
    msim_scene_destroy(scene);
  }
}

static void flat_faces_stay(void **state) {
  (void)state;
  const double x[] = {0, 0, 0, 2, 0, 0, 1, 1e-7, 0, 1, 1, 0};
  const int32_t faces[] = {0, 1, 2, 0, 2, 3, 2, 1, 3};
  msim_scene *scene = make_empty_scene();
  const msim_mesh mesh = make_mesh(4, x, 3, faces);
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  assert_int_equal(repairs_of(scene).flat_faces, 1);
  assert_int_equal(view_of(scene).nfaces, 3);
  msim_scene_destroy(scene);
}

/* The tolerance is relative, whatever the size. */
static void tolerances_scale(void **state) {
  (void)state;
  for (int power = -250; power <= 290; power += 60) {
    const double unit = pow(10, power);
    const double x[] = {0, 0, 0, unit, 0,    0,           0, unit, 0, 0.7e-6 * unit,
                        0, 0, 0, 0,    unit, 3e-6 * unit, 0, 0};
    const int32_t faces[] = {0, 1, 2, 3, 2, 1, 5, 1, 4};
    msim_scene *scene = make_empty_scene();
    const msim_mesh mesh = make_mesh(6, x, 3, faces);
    if (power < 150) assert_ok(msim_scene_add_mesh(scene, &mesh, err));
    else msim_scene_add_mesh(scene, &mesh, NULL);
    if (power < 150) assert_int_equal(repairs_of(scene).near_vertices, 1);
    if (power < 150) assert_int_equal(repairs_of(scene).duplicate_faces, 1);
    msim_scene_destroy(scene);
  }
}

static void one_sided_surfaces_cannot_be_filled(void **state) {
  (void)state;
  enum { N = 9 }; /* a Moebius strip of N quadrilaterals */
  double x[6 * N];
  int32_t faces[6 * N];
  for (int i = 0; i < N; i++) {
    const double a = 2 * 3.141592653589793 * i / N;
    for (int side = 0; side < 2; side++) {
      const double w = (side - 0.5) * 0.4, r = 1 + w * cos(a / 2);
      x[6 * i + 3 * side] = r * cos(a), x[6 * i + 3 * side + 1] = r * sin(a);
      x[6 * i + 3 * side + 2] = w * sin(a / 2);
    }
    const int32_t p = 2 * i, q = 2 * i + 1, s = i + 1 < N ? 2 * i + 2 : 1,
                  t = i + 1 < N ? 2 * i + 3 : 0;
    const int32_t two[6] = {p, q, t, p, t, s};
    memcpy(faces + 6 * i, two, sizeof two);
  }
  msim_scene *scene = make_empty_scene();
  msim_mesh mesh = make_mesh(2 * N, x, 2 * N, faces);
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  assert_true(repairs_of(scene).turned_faces <= N);
  assert_int_equal(repairs_of(scene).open_edges, 2 * N);
  mesh.fill = 0.1;
  assert_refused(scene, msim_scene_add_mesh(scene, &mesh, err),
                 "mesh.fill needs a closed surface, but of the 36 edges 18 are open");
  msim_scene_destroy(scene);
}

/*------------------------------------- refusals -------------------------------------------------*/

#define REFUSE(member, bad, words)                                  \
  do {                                                              \
    msim_mesh object = mesh;                                        \
    object.member = bad;                                            \
    assert_refused(s, msim_scene_add_mesh(s, &object, err), words); \
  } while (0)

static void bad_meshes_are_refused(void **state) {
  (void)state;
  double x[24], bad[24];
  int32_t faces[36], twice[36] = {0};
  place_cube(0, 1, x);
  memcpy(faces, cube_faces, sizeof faces);
  memcpy(bad, x, sizeof bad);
  msim_scene *s = make_started_scene();
  const msim_mesh mesh = make_mesh(8, x, 12, faces);
  REFUSE(nvertices, 0, "mesh.nvertices is 0; it must be from 1 to 715827882");
  REFUSE(nfaces, -1, "mesh.nfaces is -1");
  REFUSE(nfaces, INT32_MAX / 3 + 1, "mesh.nfaces is 715827883");
  REFUSE(vertices, NULL, "mesh.vertices or mesh.faces is NULL, and so is mesh.file");
  REFUSE(nvertices, 7, "mesh.faces[3] refers to vertex 7; there are 7 vertices");
  faces[5] = -1;
  REFUSE(k, 1, "mesh.faces[1] refers to vertex -1");
  faces[5] = 3;
  bad[7] = NAN;
  REFUSE(vertices, bad, "mesh.vertices[2] is nan; it must be finite");
  bad[7] = 1e308;
  REFUSE(vertices, bad, "mesh extends beyond the range of double");
  REFUSE(faces, twice, "mesh has no face but degenerate ones");
  msim_scene_destroy(s);
}

static void bad_members_are_refused(void **state) {
  (void)state;
  double x[24];
  const int32_t pinned[1] = {8};
  place_cube(0, 1, x);
  msim_scene *s = make_started_scene();
  const msim_mesh mesh = make_mesh(8, x, 12, cube_faces);
  REFUSE(scale, -1, "mesh.scale is -1; it must be a finite number > 0");
  REFUSE(scale, NAN, "mesh.scale is nan");
  REFUSE(translate[1], INFINITY, "mesh.translate[1] is inf");
  REFUSE(mass, 0, "mesh.mass is 0");
  REFUSE(mass, 1e-323, "mesh.mass is 9.88131e-324, which is 0 for each of 8 particles");
  REFUSE(k, -1, "mesh.k is -1");
  REFUSE(bend, NAN, "mesh.bend is nan");
  REFUSE(damping, -2, "mesh.damping is -2");
  REFUSE(fill, -0.5, "mesh.fill is -0.5; it must be a finite number > 0");
  REFUSE(fill, 10, "mesh.fill is 10 m, and no point of this lattice is inside the surface");
  REFUSE(fill, 1e-4, "mesh.fill is 0.0001 m: more than 715827882 points");
  REFUSE(fill, 1e-320, "mesh.fill is 9.99989e-321 m: more than 715827882 points");
  REFUSE(law, 1, "mesh.law is 1; the scene has laws 0");
  REFUSE(npinned, 1, "mesh.pinned is NULL");
  REFUSE(file, "no/such.file",
         "mesh.file: no/such.file: no importer reads such files; meshes are .obj, .stl, .ply, "
         ".gltf or "
         ".glb files: unknown importer 'file': ");
  msim_mesh pinning = mesh;
  pinning.npinned = 1, pinning.pinned = pinned;
  assert_refused(s, msim_scene_add_mesh(s, &pinning, err),
                 "mesh.pinned[0] is 8; it must be a whole number from 0 to 7");
  assert_refused(s, msim_scene_add_mesh(s, NULL, err), "mesh is NULL");
  msim_error why;
  pinning.size = 8;
  assert_int_equal(msim_scene_add_mesh(s, &pinning, &why), MSIM_ERR_SIZE);
  msim_mesh_repairs r = {.size = 0};
  assert_int_equal(msim_scene_mesh_repairs(s, &r), MSIM_ERR_SIZE);
  assert_int_equal(msim_scene_mesh_repairs(NULL, &r), MSIM_ERR_ARG);
  msim_scene_destroy(s);
}

/*------------------------------------- memory ---------------------------------------------------*/

/* Each allocation in turn fails: the scene is as before, and nothing leaks. */
static void meshes_survive_want_of_memory(void **state) {
  (void)state;
  double x[24];
  limited_allocator s;
  place_cube(0, 1, x);
  const msim_allocator alloc = make_limited_allocator(&s);
  msim_mesh mesh = make_mesh(8, x, 12, cube_faces);
  mesh.fill = 0.3, mesh.bend = 1;
  int failures = 0;
  for (int least = 0;; least++, failures++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(&alloc, &scene, err));
    s.remaining = least;
    const msim_status status = msim_scene_add_mesh(scene, &mesh, NULL);
    s.remaining = -1;
    const msim_scene_view view = view_of(scene);
    if (status) {
      assert_int_equal(status, MSIM_ERR_MEMORY);
      assert_int_equal(view.nparticles + view.nsprings + view.nfaces, 0);
      assert_int_equal(repairs_of(scene).turned_faces, 0);
    }
    msim_scene_destroy(scene);
    assert_int_equal(s.live, 0);
    if (!status) break;
  }
  assert_true(failures > 30);
}

/*------------------------------------- files ----------------------------------------------------*/

static msim_scene *make_scene_of_file(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  msim_scene *scene = make_empty_scene();
  msim_mesh mesh = make_mesh(0, NULL, 0, NULL);
  mesh.file = path;
  assert_true(file && fputs(text, file) >= 0 && fclose(file) == 0);
  msim_error why;
  const msim_status status = msim_scene_add_mesh(scene, &mesh, &why);
  remove(path);
  require(status != MSIM_ERR_NAME, "the importer assimp");
  if (status) fail_msg("%s", why.text);
  return scene;
}

static void a_decimal_comma_changes_no_file(void **state) {
  (void)state;
  static const char *const files[][2] = {
      {"a.obj", "v 0.25 0 0\nv 0.5 0 0\nv 0 0.5 0\nf 1 2 3\n"},
      {"a.stl",
       "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0.25 0 0\nvertex 0.5 0 0\n"
       "vertex 0 0.5 0\nendloop\nendfacet\nendsolid a\n"},
      {"a.ply",
       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
       "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
       "end_header\n0.25 0 0\n0.5 0 0\n0 0.5 0\n3 0 1 2\n"}};
  static const double x[9] = {0.25, 0, 0, 0.5, 0, 0, 0, 0.5, 0};
  char folder[] = "/tmp/msim_test_XXXXXX";
  assert_true(mkdtemp(folder) && chdir(folder) == 0);
  require(setlocale(LC_NUMERIC, "de_DE.UTF-8") != NULL, "the locale de_DE.UTF-8");
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = make_scene_of_file(files[i][0], files[i][1]);
    const msim_scene_view view = view_of(scene);
    assert_int_equal(view.nparticles, 3);
    assert_memory_equal(view.x, x, sizeof x);
    msim_scene_destroy(scene);
  }
  assert_string_equal(localeconv()->decimal_point, ","); /* the locale of the host is unchanged */
  setlocale(LC_NUMERIC, "C");
  assert_true(chdir("/") == 0 && rmdir(folder) == 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_cube_has_a_spring_along_each_edge),
                                     cmocka_unit_test(bends_join_the_vertices_opposite_an_edge),
                                     cmocka_unit_test(a_tetrahedron_bends_along_its_edges),
                                     cmocka_unit_test(spheres_of_single_triangles_are_joined),
                                     cmocka_unit_test(defects_are_repaired_and_counted),
                                     cmocka_unit_test(the_first_of_near_vertices_stays),
                                     cmocka_unit_test(flat_faces_stay),
                                     cmocka_unit_test(tolerances_scale),
                                     cmocka_unit_test(one_sided_surfaces_cannot_be_filled),
                                     cmocka_unit_test(bad_meshes_are_refused),
                                     cmocka_unit_test(bad_members_are_refused),
                                     cmocka_unit_test(meshes_survive_want_of_memory),
                                     cmocka_unit_test(a_decimal_comma_changes_no_file)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
