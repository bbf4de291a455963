/* Tests of filled meshes: which points are inside, how they are tied, in closed forms. */
#include "meshes.h"
#include "scene_check.h"

static msim_scene *add_filled(int32_t nvertices, const double *x, int32_t nfaces,
                              const int32_t *faces, double spacing) {
  msim_scene *scene;
  msim_mesh mesh = make_mesh(nvertices, x, nfaces, faces);
  mesh.fill = spacing;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
  return scene;
}

/* Two cubes: the faces of the second one are turned if `inverted`. */
static void place_two(double low, double edge, int inverted, double x[48], int32_t faces[72]) {
  place_cube(0, 1, x);
  place_cube(low, edge, x + 24);
  memcpy(faces, cube_faces, sizeof cube_faces);
  for (int i = 0; i < 36; i += 3)
    for (int c = 0; c < 3; c++) faces[36 + i + c] = 8 + cube_faces[i + (inverted ? 2 - c : c)];
}

/* 1: all particles are in one component of the graph of springs. */
static int is_connected(const msim_scene_view *view) {
  int32_t *of = malloc((size_t)view->nparticles * sizeof *of);
  int all = 1;
  for (int32_t i = 0; i < view->nparticles; i++) of[i] = i;
  for (int changes = 1; changes;) {
    changes = 0;
    for (int32_t e = 0; e < view->nsprings; e++) {
      int32_t *a = &of[view->ij[2 * e]], *b = &of[view->ij[2 * e + 1]];
      changes |= *a != *b;
      if (*a < *b) *b = *a;
      else *a = *b;
    }
  }
  for (int32_t i = 0; i < view->nparticles; i++) all &= of[i] == 0;
  free(of);
  return all;
}

/*------------------------------------- points ---------------------------------------------------*/

/* A quarter of the edge apart there are 4^3 points, at half a spacing from the sides. */
static void a_cube_is_filled_to_its_sides(void **state) {
  (void)state;
  double x[24];
  place_cube(-1, 2, x);
  msim_scene *scene = add_filled(8, x, 12, cube_faces, 0.5);
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nparticles, 8 + 64);
  for (int i = 0; i < 64; i++) {
    const double at[3] = {-0.75 + 0.5 * (i / 16), -0.75 + 0.5 * (i / 4 % 4), -0.75 + 0.5 * (i % 4)};
    for (int c = 0; c < 3; c++) assert_close(view.x[3 * (8 + i) + c], at[c], 1e-15);
    assert_true(view.mass[8 + i] == 2.0 / 72);
  }
  /* the springs of a lattice: 3 (3 4^2) + 6 (3^2 4) + 4 3^3; vertices: 1 point within 1.5 spacings
   * and its 3 neighbours on edges of the lattice */
  const int32_t inner = 144 + 216 + 108;
  assert_int_equal(view.nsprings, 18 + inner + 8 * 4);
  assert_true(is_connected(&view));
  msim_scene_destroy(scene);
}

/* All points of the lattice at least half a spacing from the surface, within the sagitta of the
 * triangles: their number times the volume of a cell is that of a ball with the radius 1 - s/2, up
 * to half the diagonal of a cell. */
static void a_sphere_is_filled(void **state) {
  (void)state;
  enum { DEPTH = 4, N = 20 << 2 * DEPTH };
  static double x[9 * N];
  static int32_t faces[3 * N];
  for (int i = 0; i < 3 * N; i++) faces[i] = i;
  assert_int_equal(make_sphere(DEPTH, x), N);
  for (double s = 0.35; s > 0.06; s *= 0.7) {
    msim_scene *scene = add_filled(3 * N, x, N, faces, s);
    const msim_scene_view view = view_of(scene);
    const int32_t first = N / 2 + 2, n = view.nparticles - first;
    const double sagitta = 0.003, half_diagonal = sqrt(3) / 2 * s, pi = 3.141592653589793;
    const double low = 1 - s / 2 - sagitta - half_diagonal, high = 1 - s / 2 + half_diagonal;
    assert_true(n * s * s * s >= 4 * pi / 3 * low * low * low);
    assert_true(n * s * s * s <= 4 * pi / 3 * high * high * high);
    int32_t expected = 0;
    const int32_t side = (int32_t)floor(2 / s);
    for (int32_t p = 0; p < side * side * side; p++) {
      double r = 0;
      for (int c = 0, q = p; c < 3; c++, q /= side) r += pow((q % side - (side - 1) / 2.0) * s, 2);
      r = sqrt(r);
      expected += r <= 1 - s / 2 - sagitta;
      if (r > 1 - s / 2 - sagitta && r < 1 - s / 2) expected = INT32_MIN / 2; /* undecided */
    }
    if (expected >= 0) assert_int_equal(n, expected);
    assert_true(is_connected(&view));
    msim_scene_destroy(scene);
  }
}

/* Vertical lines through vertices and edges of a cube that is refined in its middle planes */
static void lines_through_vertices_count_once(void **state) {
  (void)state;
  const double x[18] = {0, 0, 1, 0, 0, -1, 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0};
  const int32_t faces[24] = {0, 2, 3, 0, 3, 4, 0, 4, 5, 0, 5, 2,
                             1, 3, 2, 1, 4, 3, 1, 5, 4, 1, 2, 5};
  /* an octahedron, |x| + |y| + |z| <= 1; its distance inside is (1 - sum) / sqrt(3). With an odd
   * number of points along each axis, lines meet the vertices and the edges. */
  for (int n = 3; n < 40; n += 2) {
    const double s = 2 / (n + 0.5);
    int32_t expected = 0;
    for (int i = 0; i < n * n * n; i++) {
      const int at[3] = {i / n / n, i / n % n, i % n};
      double sum = 0;
      for (int c = 0; c < 3; c++) sum += fabs((at[c] - (n - 1) / 2) * s);
      expected += (1 - sum) / sqrt(3) >= s / 2;
    }
    msim_scene *scene = add_filled(6, x, 8, faces, s);
    assert_int_equal(view_of(scene).nparticles, 6 + expected);
    assert_true(expected > 0);
    msim_scene_destroy(scene);
  }
}

static void orientation_decides_on_cavities_only(void **state) {
  (void)state;
  int32_t faces[72];
  double x[48];
  /* inside out */
  place_two(0.25, 0.5, 1, x, faces);
  msim_scene *scene = add_filled(8, x + 24, 12, (const int32_t *)cube_faces, 0.125);
  assert_int_equal(view_of(scene).nparticles, 8 + 64);
  msim_scene_destroy(scene);
  for (int i = 36; i < 72; i++) faces[i] -= 8;
  scene = add_filled(8, x + 24, 12, faces + 36, 0.125);
  assert_int_equal(view_of(scene).nparticles, 8 + 64);
  msim_scene_destroy(scene);
  /* a cavity: 10^3 points less those inside it or near, 6^3 */
  place_two(0.25, 0.5, 1, x, faces);
  scene = add_filled(16, x, 24, faces, 0.1);
  assert_int_equal(view_of(scene).nparticles, 16 + 1000 - 216);
  msim_scene_destroy(scene);
  /* a part inside a part, with the same orientation: the surface of the inner one is left out:
   * points less than 0.05 from it, of a cube shell from 0.25 to 0.75 */
  place_two(0.25, 0.5, 0, x, faces);
  scene = add_filled(16, x, 24, faces, 0.1);
  assert_int_equal(view_of(scene).nparticles, 16 + 1000 - (216 - 64) + 0);
  msim_scene_destroy(scene);
}

/* Overlapping parts are one body; apart they stay apart, across any gap. */
static void parts_are_joined_where_they_overlap(void **state) {
  (void)state;
  int32_t faces[72];
  double x[48];
  place_two(0.5, 1, 0, x, faces);
  msim_scene *scene = add_filled(16, x, 24, faces, 0.1);
  msim_scene_view view = view_of(scene);
  assert_true(is_connected(&view));
  msim_scene_destroy(scene);
  place_two(1.01, 1, 0, x, faces);
  scene = add_filled(16, x, 24, faces, 0.25);
  view = view_of(scene);
  assert_false(is_connected(&view));
  for (int32_t e = 0; e < view.nsprings; e++)
    assert_int_equal(view.x[3 * view.ij[2 * e]] > 1.005, view.x[3 * view.ij[2 * e + 1]] > 1.005);
  msim_scene_destroy(scene);
  /* a part that contains no point is tied to the others */
  place_two(1.2, 0.05, 0, x, faces);
  scene = add_filled(16, x, 24, faces, 0.25);
  view = view_of(scene);
  assert_true(is_connected(&view));
  msim_scene_destroy(scene);
}

/* Two octahedra with a narrow gap across (1, 1, 1): neighbours on diagonals of the lattice are in
 * different parts, and no spring connects them. */
static void no_spring_crosses_a_gap(void **state) {
  (void)state;
  const double one[18] = {0, 0, 1, 0, 0, -1, 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0};
  const int32_t corners[24] = {0, 2, 3, 0, 3, 4, 0, 4, 5, 0, 5, 2,
                               1, 3, 2, 1, 4, 3, 1, 5, 4, 1, 2, 5};
  double x[36];
  int32_t faces[48];
  for (int i = 0; i < 18; i++) x[i] = one[i], x[18 + i] = one[i] + 0.68;
  for (int i = 0; i < 24; i++) faces[i] = corners[i], faces[24 + i] = corners[i] + 6;
  for (double s = 0.25; s > 0.08; s *= 0.93) {
    msim_scene *scene = add_filled(12, x, 16, faces, s);
    const msim_scene_view view = view_of(scene);
    for (int32_t e = 0; e < view.nsprings; e++) {
      double sum[2] = {0, 0};
      for (int end = 0; end < 2; end++)
        for (int c = 0; c < 3; c++) sum[end] += view.x[3 * view.ij[2 * e + end] + c];
      assert_int_equal(sum[0] > 1.02, sum[1] > 1.02);
    }
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- ties -----------------------------------------------------*/

/* Each vertex of a random body is held by its nearest points: all within 1.5 spacings, at least 4.
 */
static void vertices_are_tied_to_the_nearest_points(void **state) {
  (void)state;
  enum { DEPTH = 3, N = 20 << 2 * DEPTH, V = N / 2 + 2 };
  static double x[9 * N];
  static int32_t faces[3 * N];
  unsigned seed = 5;
  for (int i = 0; i < 3 * N; i++) faces[i] = i;
  for (int run = 0; run < 20; run++) {
    assert_int_equal(make_sphere(DEPTH, x), N);
    const double a = 1 + uniform(&seed), b = 0.3 + uniform(&seed), s = 0.1 + 0.1 * uniform(&seed);
    for (int i = 0; i < 3 * N; i++) {
      x[3 * i] *= a, x[3 * i + 1] *= b;
      x[3 * i + 1] += 0.4 * x[3 * i] * x[3 * i];
    }
    msim_scene *scene = add_filled(3 * N, x, N, faces, s);
    const msim_scene_view view = view_of(scene);
    assert_true(is_connected(&view));
    for (int32_t v = 0; v < V; v++) {
      double longest = 0;
      int32_t tied = 0, near = 0, nearer = 0;
      for (int32_t e = 0; e < view.nsprings; e++)
        if (view.ij[2 * e] == v && view.ij[2 * e + 1] >= V)
          tied++, longest = fmax(longest, view.rest[e]);
      for (int32_t p = V; p < view.nparticles; p++) {
        double d = 0;
        for (int c = 0; c < 3; c++) d += pow(view.x[3 * p + c] - view.x[3 * v + c], 2);
        near += sqrt(d) <= 1.5 * s * (1 + 1e-12), nearer += sqrt(d) <= longest * (1 - 1e-12);
      }
      assert_true(tied >= near && tied >= 4);
      assert_true(nearer < tied);
    }
    msim_scene_destroy(scene);
  }
}

/* A pyramid with a square base of edge 2 at z = -1, whose apex is vertex 0 */
static msim_scene *add_pyramid(double top) {
  static const int32_t faces[18] = {0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1, 1, 4, 2, 2, 4, 3};
  const double x[15] = {0, 0, top, -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1};
  return add_filled(5, x, 6, faces, 2. / 9);
}

/* det(sum(u u^T) / n) of the unit vectors u along the ties of the apex but for the last `without`
 * of these; *n: their number */
static double find_support(const msim_scene_view *view, int32_t without, int32_t *n) {
  double m[3][3] = {{0}};
  *n = -without;
  for (int32_t e = 0; e < view->nsprings; e++)
    *n += view->ij[2 * e] == 0 && view->ij[2 * e + 1] >= 5;
  for (int32_t e = 0, found = 0; found < *n; e++) {
    const double *end = view->x + 3 * view->ij[2 * e + 1],
                 weight = 1 / (pow(view->rest[e], 2) * *n);
    if (view->ij[2 * e] != 0 || view->ij[2 * e + 1] < 5) continue;
    found++;
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) m[i][j] += weight * (end[i] - view->x[i]) * (end[j] - view->x[j]);
  }
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

/* The nearest points lie in a column below the apex, which is tied to as few of them as resist
 * forces in all directions, with a determinant of at least 1e-3. Those of a spire never do. */
static void an_apex_is_held_in_all_directions(void **state) {
  (void)state;
  int32_t n;
  for (double top = 0.6; top < 1.15; top += 0.1) {
    msim_scene *scene = add_pyramid(top);
    const msim_scene_view view = view_of(scene);
    assert_true(find_support(&view, 0, &n) >= 1e-3);
    assert_true(n > 4);
    assert_true(find_support(&view, 1, &n) < 1e-3);
    msim_scene_destroy(scene);
  }
  msim_scene *spire = add_pyramid(9);
  const msim_scene_view view = view_of(spire);
  assert_true(find_support(&view, 0, &n) < 1e-3);
  assert_int_equal(n, 4);
  msim_scene_destroy(spire);
}

/* A vertex far from all points, as a damaged file may have: its lattice is very long, but all of it
 * is searched in less than a moment; whole shells of offsets would take hours. */
static void a_far_vertex_is_tied_at_once(void **state) {
  (void)state;
  double x[24];
  place_cube(0, 1, x);
  x[0] = -3000;
  msim_scene *scene = add_filled(8, x, 12, cube_faces, 0.2);
  const msim_scene_view view = view_of(scene);
  int32_t n = 0;
  double least = INFINITY;
  for (int32_t e = 0; e < view.nsprings; e++) n += view.ij[2 * e] == 0 && view.ij[2 * e + 1] >= 8;
  for (int32_t p = 8; p < view.nparticles; p++) least = fmin(least, view.x[3 * p]);
  assert_true(is_connected(&view));
  assert_int_equal(n, 4);
  for (int32_t e = 0; e < view.nsprings; e++)
    if (view.ij[2 * e] == 0 && view.ij[2 * e + 1] >= 8)
      assert_true(view.x[3 * view.ij[2 * e + 1]] <= least + 3 * 0.2 * (1 + 1e-9));
  msim_scene_destroy(scene);
}

/* MSIM_FILL_AUTO: a sixth of the shortest edge of the bounding box */
static void the_spacing_follows_from_the_bounding_box(void **state) {
  (void)state;
  double x[24];
  place_cube(0, 1, x);
  for (int i = 0; i < 8; i++) x[3 * i] *= 3;
  msim_scene *scene = add_filled(8, x, 12, cube_faces, MSIM_FILL_AUTO);
  assert_int_equal(view_of(scene).nparticles, 8 + 18 * 6 * 6);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_cube_is_filled_to_its_sides),
                                     cmocka_unit_test(a_sphere_is_filled),
                                     cmocka_unit_test(lines_through_vertices_count_once),
                                     cmocka_unit_test(orientation_decides_on_cavities_only),
                                     cmocka_unit_test(parts_are_joined_where_they_overlap),
                                     cmocka_unit_test(no_spring_crosses_a_gap),
                                     cmocka_unit_test(vertices_are_tied_to_the_nearest_points),
                                     cmocka_unit_test(an_apex_is_held_in_all_directions),
                                     cmocka_unit_test(a_far_vertex_is_tied_at_once),
                                     cmocka_unit_test(the_spacing_follows_from_the_bounding_box)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
