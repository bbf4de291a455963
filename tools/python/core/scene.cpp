// scene.cpp - msim._core.Scene. Python has checked the shapes of all arrays.
#include "common.hpp"

static void create(Scene *self) {
  msim_error err;
  new (self) Scene();
  check(msim_scene_create(nullptr, &self->p, &err), err);
}

static void load(Scene *self, const char *path) {
  msim_error err;
  new (self) Scene();
  check(msim_scene_load(nullptr, path, &self->p, &err), err);
}

static void parse(Scene *self, const char *label, nb::bytes text) {
  msim_error err;
  new (self) Scene();
  check(msim_scene_parse(nullptr, label, text.c_str(), text.size(), &self->p, &err), err);
}

static void add_particles(Scene &s, Doubles x, nb::object v, Doubles mass) {
  msim_error err;
  check(msim_scene_add_particles(s.p, static_cast<int32_t>(mass.size()), x.data(), data_or_null(v),
                                 mass.data(), &err),
        err);
}

static void add_springs(Scene &s, Ints ij, Doubles k, nb::object rest, nb::object damping) {
  msim_error err;
  check(msim_scene_add_springs(s.p, static_cast<int32_t>(k.size()), ij.data(), k.data(),
                               data_or_null(rest), data_or_null(damping), &err),
        err);
}

static void add_angles(Scene &s, Ints ijk, Doubles k, nb::object rest, nb::object damping) {
  msim_error err;
  check(msim_scene_add_angles(s.p, static_cast<int32_t>(k.size()), ijk.data(), k.data(),
                              data_or_null(rest), data_or_null(damping), &err),
        err);
}

static void add_faces(Scene &s, Ints corners) {
  msim_error err;
  check(msim_scene_add_faces(s.p, static_cast<int32_t>(corners.size() / 3), corners.data(), &err),
        err);
}

static void pin(Scene &s, Ints particles) {
  msim_error err;
  check(msim_scene_pin(s.p, static_cast<int32_t>(particles.size()), particles.data(), &err), err);
}

// kind: MSIM_LAW_...; the number of the law
static int32_t add_law(Scene &s, int32_t kind, double half_width, double limit,
                       nb::object coefficients, nb::object stretch, nb::object force, int32_t n,
                       double break_strain, double break_force) {
  msim_error err;
  msim_law law{};
  law.size = sizeof law;
  law.kind = kind, law.n = n, law.half_width = half_width, law.limit = limit;
  law.coefficients = data_or_null(coefficients);
  law.stretch = data_or_null(stretch), law.force = data_or_null(force);
  law.break_strain = break_strain, law.break_force = break_force;
  int32_t index = 0;
  check(msim_scene_add_law(s.p, &law, &index, &err), err);
  return index;
}

static void edit(Scene &s, Ints removed_particles, Ints removed_springs, nb::object x, nb::object v,
                 nb::object mass, Ints ij, nb::object k, nb::object rest, nb::object damping,
                 nb::object law, Ints ijk, nb::object angle_k, nb::object angle_rest,
                 nb::object angle_damping) {
  msim_error err;
  msim_edit e =
      make_edit(removed_particles, removed_springs, x, v, mass, ij, k, rest, damping, law);
  e.nangles = static_cast<int32_t>(ijk.size() / 3);
  e.ijk = ijk.data(), e.angle_k = data_or_null(angle_k), e.angle_rest = data_or_null(angle_rest);
  e.angle_damping = data_or_null(angle_damping);
  check(msim_scene_edit(s.p, &e, &err), err);
}

static void set_law(Scene &s, Ints springs, int32_t law) {
  msim_error err;
  check(msim_scene_set_law(s.p, static_cast<int32_t>(springs.size()), springs.data(), law, &err),
        err);
}

static void copy_vector(const Doubles &from, double (&to)[3]) {
  for (size_t c = 0; c < 3; c++) to[c] = from.data()[c];
}

static void add_plane(Scene &s, Doubles normal, double offset, double restitution,
                      double friction) {
  msim_error err;
  msim_plane plane{};
  copy_vector(normal, plane.normal);
  plane.offset = offset, plane.restitution = restitution, plane.friction = friction;
  check(msim_scene_add_plane(s.p, &plane, &err), err);
}

// type: msim_collider_type
static void add_collider(Scene &s, int32_t type, bool inside, Doubles center, Doubles from,
                         Doubles to, double radius, Doubles extent, Doubles rotation,
                         double restitution, double friction) {
  msim_error err;
  msim_collider c{};
  c.size = sizeof c;
  c.type = type, c.inside = inside, c.radius = radius;
  c.restitution = restitution, c.friction = friction;
  copy_vector(center, c.center), copy_vector(from, c.from), copy_vector(to, c.to);
  copy_vector(extent, c.extent), copy_vector(rotation, c.rotation);
  check(msim_scene_add_collider(s.p, &c, &err), err);
}

static void add_rope(Scene &s, int32_t n, Doubles from, Doubles to, double mass, double k,
                     double damping, double bending, Ints pinned) {
  msim_error err;
  msim_rope rope{};
  rope.size = sizeof rope;
  rope.n = n, rope.mass = mass, rope.k = k, rope.damping = damping, rope.bending = bending;
  copy_vector(from, rope.from), copy_vector(to, rope.to);
  rope.npinned = static_cast<int32_t>(pinned.size()), rope.pinned = pinned.data();
  check(msim_scene_add_rope(s.p, &rope, &err), err);
}

// k: structural, shear, bend
static void add_cloth(Scene &s, int32_t rows, int32_t columns, Doubles origin, Doubles row,
                      Doubles column, double mass, Doubles k, double damping, double bending,
                      Ints pinned) {
  msim_error err;
  msim_cloth cloth{};
  cloth.size = sizeof cloth;
  cloth.rows = rows, cloth.columns = columns, cloth.mass = mass, cloth.damping = damping;
  cloth.bending = bending;
  copy_vector(origin, cloth.origin), copy_vector(row, cloth.row);
  copy_vector(column, cloth.column);
  cloth.k_structural = k.data()[0], cloth.k_shear = k.data()[1], cloth.k_bend = k.data()[2];
  cloth.npinned = static_cast<int32_t>(pinned.size()), cloth.pinned = pinned.data();
  check(msim_scene_add_cloth(s.p, &cloth, &err), err);
}

static void add_lattice(Scene &s, Ints n, Doubles origin, Doubles extent, double mass, double k,
                        double damping, Ints pinned) {
  msim_error err;
  msim_lattice lattice{};
  lattice.size = sizeof lattice;
  for (size_t c = 0; c < 3; c++) lattice.n[c] = n.data()[c];
  copy_vector(origin, lattice.origin), copy_vector(extent, lattice.extent);
  lattice.mass = mass, lattice.k = k, lattice.damping = damping;
  lattice.npinned = static_cast<int32_t>(pinned.size()), lattice.pinned = pinned.data();
  check(msim_scene_add_lattice(s.p, &lattice, &err), err);
}

// file or vertices and faces: None
static void add_mesh(Scene &s, nb::object file, nb::object vertices, nb::object faces, double scale,
                     Doubles translate, double mass, double k, double bend, double fill,
                     double damping, Ints pinned) {
  msim_error err;
  msim_mesh mesh{};
  mesh.size = sizeof mesh;
  std::string name;
  Doubles x;
  Ints corners;
  if (!file.is_none()) {
    name = nb::cast<std::string>(file);
    mesh.file = name.c_str();
  } else {
    x = nb::cast<Doubles>(vertices), corners = nb::cast<Ints>(faces);
    mesh.nvertices = static_cast<int32_t>(x.size() / 3), mesh.vertices = x.data();
    mesh.nfaces = static_cast<int32_t>(corners.size() / 3), mesh.faces = corners.data();
  }
  mesh.scale = scale, mesh.mass = mass, mesh.k = k, mesh.bend = bend, mesh.fill = fill;
  mesh.damping = damping;
  copy_vector(translate, mesh.translate);
  mesh.npinned = static_cast<int32_t>(pinned.size()), mesh.pinned = pinned.data();
  check(msim_scene_add_mesh(s.p, &mesh, &err), err);
}

static nb::dict mesh_repairs(const Scene &s) {
  msim_mesh_repairs r{};
  r.size = sizeof r;
  msim_scene_mesh_repairs(s.p, &r);
  nb::dict d;
  d["equal_vertices"] = r.equal_vertices, d["near_vertices"] = r.near_vertices;
  d["unused_vertices"] = r.unused_vertices, d["degenerate_faces"] = r.degenerate_faces;
  d["duplicate_faces"] = r.duplicate_faces, d["turned_faces"] = r.turned_faces;
  d["flat_faces"] = r.flat_faces, d["open_edges"] = r.open_edges;
  d["nonmanifold_edges"] = r.nonmanifold_edges;
  return d;
}

static msim_scene_view get(const Scene &s) {
  msim_scene_view w{};
  w.size = sizeof w;
  if (msim_scene_get(s.p, &w) != MSIM_OK) throw Failure{MSIM_ERR_ARG, "the scene is unusable"};
  return w;
}

static nb::tuple counts(const Scene &s) {
  const msim_scene_view w = get(s);
  return nb::make_tuple(w.nparticles, w.nsprings, w.nplanes, w.nfaces, w.nangles);
}

// A copy of one array of the scene
static nb::object array(const Scene &s, const std::string &name) {
  const msim_scene_view w = get(s);
  const size_t n = static_cast<size_t>(w.nparticles), m = static_cast<size_t>(w.nsprings);
  if (name == "x") return copy(w.x, {n, 3});
  if (name == "v") return copy(w.v, {n, 3});
  if (name == "mass") return copy(w.mass, {n});
  if (name == "pinned") return copy(w.pinned, {n});
  if (name == "ij") return copy(w.ij, {m, 2});
  if (name == "k") return copy(w.k, {m});
  if (name == "rest") return copy(w.rest, {m});
  if (name == "damping") return copy(w.damping, {m});
  const size_t a = static_cast<size_t>(w.nangles);
  if (name == "ijk") return copy(w.ijk, {a, 3});
  if (name == "angle_k") return copy(w.angle_k, {a});
  if (name == "angle_rest") return copy(w.angle_rest, {a});
  if (name == "angle_damping") return copy(w.angle_damping, {a});
  if (name == "force") {
    const std::vector<double> none(w.force ? 0 : 3 * n);
    return copy(w.force ? w.force : none.data(), {n, 3});
  }
  if (name == "law" && !w.law) return copy(std::vector<int32_t>(m).data(), {m});
  if (name == "law") return copy(w.law, {m});
  return copy(w.faces, {static_cast<size_t>(w.nfaces), 3});
}

static nb::list planes(const Scene &s) {
  const msim_scene_view w = get(s);
  nb::list all;
  for (int32_t i = 0; i < w.nplanes; i++) {
    const msim_plane &p = w.planes[i];
    all.append(nb::make_tuple(nb::make_tuple(p.normal[0], p.normal[1], p.normal[2]), p.offset,
                              p.restitution, p.friction));
  }
  return all;
}

// n: of the samples, 2 or 3 numbers
static void add_samples(Scene &s, int32_t type, bool inside, Doubles origin, Doubles spacing,
                        Ints n, Doubles values, double restitution, double friction) {
  msim_error err;
  msim_collider c{};
  c.size = sizeof c;
  c.type = type, c.inside = inside, c.restitution = restitution, c.friction = friction;
  copy_vector(origin, c.origin);
  for (size_t i = 0; i < n.size(); i++) c.spacing[i] = spacing.data()[i], c.n[i] = n.data()[i];
  c.values = values.data();
  check(msim_scene_add_collider(s.p, &c, &err), err);
}

// origin, spacing and the array of samples; None if the collider has none
static nb::object samples(const Scene &s, int32_t collider) {
  const msim_collider &c = get(s).colliders[collider];
  if (!c.values) return nb::none();
  std::vector<size_t> shape{static_cast<size_t>(c.n[0]), static_cast<size_t>(c.n[1])};
  nb::list spacing;
  if (c.type == MSIM_COLLIDER_SDF) shape.push_back(static_cast<size_t>(c.n[2]));
  for (size_t i = 0; i < shape.size(); i++) spacing.append(c.spacing[i]);
  return nb::make_tuple(nb::make_tuple(c.origin[0], c.origin[1], c.origin[2]), nb::tuple(spacing),
                        copy(c.values, shape));
}

static nb::tuple triple(const double (&v)[3]) { return nb::make_tuple(v[0], v[1], v[2]); }

static nb::list colliders(const Scene &s) {
  const msim_scene_view w = get(s);
  nb::list all;
  for (int32_t i = 0; i < w.ncolliders; i++) {
    const msim_collider &c = w.colliders[i];
    all.append(nb::make_tuple(c.type, c.inside != 0, triple(c.center), triple(c.from), triple(c.to),
                              c.radius, triple(c.extent), triple(c.rotation), c.restitution,
                              c.friction));
  }
  return all;
}

// x: (nt, n, 3)
static void add_motion(Scene &s, Ints particles, Doubles t, Doubles x, bool cubic) {
  msim_error err;
  msim_motion m{};
  m.size = sizeof m;
  m.n = static_cast<int32_t>(particles.size()), m.particles = particles.data();
  m.nt = static_cast<int32_t>(t.size()), m.t = t.data(), m.x = x.data();
  m.interpolation = cubic ? MSIM_MOTION_CUBIC : MSIM_MOTION_LINEAR;
  check(msim_scene_add_motion(s.p, &m, &err), err);
}

// x, rotation: (nt, 3)
static void set_collider_motion(Scene &s, int32_t collider, Doubles t, Doubles x,
                                nb::object rotation, bool cubic) {
  msim_error err;
  msim_collider_motion m{};
  m.size = sizeof m;
  m.collider = collider;
  m.nt = static_cast<int32_t>(t.size()), m.t = t.data(), m.x = x.data();
  m.rotation = data_or_null(rotation);
  m.interpolation = cubic ? MSIM_MOTION_CUBIC : MSIM_MOTION_LINEAR;
  check(msim_scene_set_collider_motion(s.p, &m, &err), err);
}

// t, x, rotation or None, cubic; None if the collider rests
static nb::object collider_motion(const Scene &s, int32_t collider) {
  msim_collider_motion m{};
  m.size = sizeof m;
  if (msim_scene_get_collider_motion(s.p, collider, &m) != MSIM_OK || m.nt == 0) return nb::none();
  const size_t nt = static_cast<size_t>(m.nt);
  return nb::make_tuple(copy(m.t, {nt}), copy(m.x, {nt, 3}),
                        m.rotation ? copy(m.rotation, {nt, 3}) : nb::object(nb::none()),
                        m.interpolation == MSIM_MOTION_CUBIC);
}

static nb::tuple gravity(const Scene &s) {
  const msim_scene_view w = get(s);
  return nb::make_tuple(w.gravity[0], w.gravity[1], w.gravity[2]);
}

static void set_gravity(Scene &s, Doubles g) {
  msim_error err;
  check(msim_scene_set_gravity(s.p, g.data(), &err), err);
}

static void set_drag(Scene &s, double drag) {
  msim_error err;
  check(msim_scene_set_drag(s.p, drag, &err), err);
}

static void set_self_contact(Scene &s, double thickness, double friction) {
  msim_error err;
  check(msim_scene_set_self_contact(s.p, thickness, friction, &err), err);
}

static void set_planes_constrain(Scene &s, bool constrain) {
  msim_error err;
  check(msim_scene_set_planes_constrain(s.p, constrain, &err), err);
}

static void set_forces(Scene &s, Doubles force) {
  msim_error err;
  check(msim_scene_set_forces(s.p, force.data(), &err), err);
}

static void set_name(Scene &s, const char *name) {
  msim_error err;
  check(msim_scene_set_name(s.p, name, &err), err);
}

static void save(const Scene &s, const char *path) {
  msim_error err;
  check(msim_scene_save(s.p, path, &err), err);
}

void bind_scene(nb::module_ &m) {
  nb::class_<Scene> scene(m, "Scene");
  bind_force(scene);
  scene.def("__init__", create)
      .def("__init__", load)
      .def("__init__", parse)
      .def("add_particles", add_particles, nb::arg(), nb::arg().none(), nb::arg())
      .def("add_springs", add_springs, nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none())
      .def("add_angles", add_angles, nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none())
      .def("add_faces", add_faces)
      .def("add_plane", add_plane)
      .def("add_collider", add_collider)
      .def("add_samples", add_samples)
      .def("samples", samples)
      .def("add_law", add_law, nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(),
           nb::arg().none(), nb::arg(), nb::arg(), nb::arg())
      .def("set_law", set_law)
      .def("edit", edit, nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(),
           nb::arg().none(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg().none(),
           nb::arg().none(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg().none())
      .def("add_rope", add_rope)
      .def("add_cloth", add_cloth)
      .def("add_lattice", add_lattice)
      .def("add_mesh", add_mesh, nb::arg().none(), nb::arg().none(), nb::arg().none(), nb::arg(),
           nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg())
      .def("mesh_repairs", mesh_repairs)
      .def("pin", pin)
      .def("save", save)
      .def("counts", counts)
      .def("array", [](const Scene &s, const char *name) { return array(s, name); })
      .def("planes", planes)
      .def("colliders", colliders)
      .def("gravity", gravity)
      .def("set_gravity", set_gravity)
      .def("drag", [](const Scene &s) { return get(s).drag; })
      .def("set_drag", set_drag)
      .def("self_contact",
           [](const Scene &s) {
             const msim_scene_view view = get(s);
             return nb::make_tuple(view.self_thickness, view.self_friction);
           })
      .def("set_self_contact", set_self_contact)
      .def("planes_constrain", [](const Scene &s) { return get(s).planes_constrain != 0; })
      .def("set_planes_constrain", set_planes_constrain)
      .def("set_forces", set_forces)
      .def("add_motion", add_motion)
      .def("set_collider_motion", set_collider_motion, nb::arg(), nb::arg(), nb::arg(),
           nb::arg().none(), nb::arg())
      .def("collider_motion", collider_motion)
      .def("name", [](const Scene &s) { return nb::str(get(s).name); })
      .def("set_name", set_name);
}
