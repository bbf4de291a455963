"""Scenes: building them, what is refused, files, dicts, pickles."""
import copy
import json
import pickle

import msim
import numpy as np
import pytest


def test_particles_and_springs():
    scene = msim.Scene(name="two", gravity=(0, 0, -1), drag=0.5)
    assert scene.add_particles([[0, 0, 0], [1, 0, 0]], mass=2) == range(0, 2)
    assert scene.add_particles([[0, 1, 0]], mass=[3], v=[[1, 2, 3]]) == range(2, 3)
    assert scene.add_springs([[0, 1], [1, 2]], k=[10, 20], damping=0.1) == range(0, 2)
    scene.pin(0)
    assert len(scene) == 3 and scene.nsprings == 2 and scene
    assert scene.name == "two" and scene.drag == 0.5
    np.testing.assert_array_equal(scene.gravity, [0, 0, -1])
    np.testing.assert_array_equal(scene.mass, [2, 2, 3])
    np.testing.assert_array_equal(scene.v[2], [1, 2, 3])
    np.testing.assert_array_equal(scene.pinned, [True, False, False])
    np.testing.assert_array_equal(scene.ij, [[0, 1], [1, 2]])
    np.testing.assert_array_equal(scene.rest, [1, np.sqrt(2)])
    np.testing.assert_array_equal(scene.damping, [0.1, 0.1])
    assert repr(scene) == "<msim.Scene 'two': 3 particles, 2 springs, 0 planes, 0 faces>"


def test_an_empty_scene_is_true_and_empty():
    assert msim.Scene() and len(msim.Scene()) == 0


def test_objects():
    scene = msim.Scene()
    rope = scene.add_rope(5, (0, 0, 0), (1, 0, 0), mass=1, k=10, pinned=[0])
    cloth = scene.add_cloth((3, 4), (0, 0, 0), (0, 1, 0), (1, 0, 0), mass=1, k={"structural": 5})
    box = scene.add_lattice((2, 2, 2), (0, 0, 0), (1, 1, 1), mass=1, k=10)
    assert (rope, cloth, box) == (range(0, 5), range(5, 17), range(17, 25))
    assert scene.nsprings == 4 + 17 + 28 and len(scene.faces) == 12 + 12
    np.testing.assert_array_equal(scene.x[:5, 0], [0, 0.25, 0.5, 0.75, 1])
    scene.pin(rope)
    assert scene.pinned.sum() == 5


@pytest.mark.parametrize("name", ["corners", "first_row", "first_corners"])
def test_names_of_pinned_particles_are_those_of_scene_files(name):
    keys = {"origin": (0, 0, 0), "row": (0, 1, 0), "column": (1, 0, 0), "mass": 1, "k": 10,
            "pinned": name}
    scene = msim.Scene()
    scene.add_cloth((3, 4), **keys)
    tree = {"objects": [{"type": "cloth", "n": [3, 4], **keys}]}
    np.testing.assert_array_equal(scene.pinned, msim.Scene.from_dict(tree).pinned)


def test_numbers_of_numpy():
    scene = msim.Scene(drag=np.float32(0.5))
    scene.add_rope(np.int64(3), np.zeros(3), np.ones(3), mass=np.float32(1), k=np.int32(7))
    msim.Sim(scene, integrator="rk4", h=np.float64(1e-3)).step(np.int64(2))


def test_planes_and_faces():
    scene = msim.Scene()
    scene.add_particles(np.eye(3), mass=1)
    scene.add_faces([[0, 1, 2]])
    scene.add_plane((0, 0, 2), -1, restitution=0.5, friction=0.1)
    assert scene.planes == [msim.Plane((0, 0, 1), -0.5, 0.5, 0.1)]
    np.testing.assert_array_equal(scene.faces, [[0, 1, 2]])


def test_colliders():
    scene = msim.Scene()
    scene.add_particles(np.eye(3), mass=1)
    scene.add_sphere((0, 0, 1), 0.5, restitution=0.5)
    scene.add_capsule((0, 0, 1), (0, 2, 1), 0.5, friction=0.25)
    scene.add_cylinder((0, 0, 1), (0, 2, 1), 0.5, inside=True)
    scene.add_box((0, 0, 1), (1, 2, 3), (0, 0, 0.5))
    bar = {"from": (0, 0, 1), "to": (0, 2, 1), "radius": 0.5}
    elastic = {"restitution": 1, "friction": 0}
    assert scene.colliders == [
        {"type": "sphere", "center": (0, 0, 1), "radius": 0.5, "inside": False,
         "restitution": 0.5, "friction": 0},
        {"type": "capsule", **bar, "inside": False, "restitution": 1, "friction": 0.25},
        {"type": "cylinder", **bar, "inside": True, **elastic},
        {"type": "box", "center": (0, 0, 1), "size": (1, 2, 3), "rotation": (0, 0, 0.5),
         "inside": False, **elastic}]
    again = msim.Scene.loads(scene.dumps())
    assert again.colliders == scene.colliders
    assert msim.Scene.from_dict({"msim": 1, "particles": {"x": [[0, 0, 9]], "mass": 1},
                                 "colliders": scene.colliders}).colliders == scene.colliders


def test_colliders_that_move():
    scene = msim.Scene(gravity=(0, 0, -10))
    scene.add_particles([[0, 0, 0]], v=[[0, 0, 1]], mass=2)
    scene.add_box((0, 0, 0), (1, 1, 1), restitution=0)
    scene.set_collider_motion(0, [0, 1], [[0, 0, -0.5], [0, 0, 0.5]], cubic=False)
    motion = {"t": [0, 1], "x": [[0, 0, -0.5], [0, 0, 0.5]], "interpolation": "linear"}
    assert scene.colliders[0]["motion"] == motion
    again = msim.Scene.loads(scene.dumps())
    assert again.colliders == scene.colliders
    sim = msim.Sim(again, integrator="symplectic-euler", h=1e-3)
    sim.step(1000)
    np.testing.assert_allclose(sim.x, [[0, 0, 1]], rtol=0, atol=1e-11)
    assert sim.energy.work == pytest.approx(20, abs=1e-9)  # m g u t
    sim.move_collider(0, (0, 0, 1.5), 1, rotation=(0, 0, 1))
    sim.step(1000)
    np.testing.assert_allclose(sim.x, [[0, 0, 2]], rtol=0, atol=1e-11)
    turns = [[0, 0, 0], [0, 0, 1]]
    scene.set_collider_motion(0, [0, 1], [[0, 0, 0], [1, 0, 0]], turns, cubic=True)
    assert scene.colliders[0]["motion"]["rotation"] == turns
    with pytest.raises(msim.ArgumentError, match=r"x must have the shape \(2, 3\)"):
        scene.set_collider_motion(0, [0, 1], [[0, 0, 0]])
    with pytest.raises(msim.ArgumentError, match="there are 1 colliders"):
        sim.move_collider(1, (0, 0, 0), 1)


def test_height_fields_and_grids():
    scene = msim.Scene(gravity=(0, 0, -10))
    scene.add_particles([[0.1, 0, 2], [5, 0, 2]], mass=1)
    x = np.linspace(-2, 2, 9)
    scene.add_heightfield((-2, -2, 0), (0.5, 0.5), np.add.outer(0.1 * x ** 2, 0.2 * x ** 2),
                          restitution=0, friction=2)
    grid = np.meshgrid(*3 * [np.linspace(-1, 1, 11)], indexing="ij")
    scene.add_sdf((4, -1, -0.5), (0.2, 0.2, 0.2), np.sqrt(sum(c ** 2 for c in grid)) - 0.5,
                  restitution=0, friction=2)
    assert [c["type"] for c in scene.colliders] == ["heightfield", "sdf"]
    assert scene.colliders[0]["n"] == (9, 9) and len(scene.colliders[1]["values"]) == 1331
    again = msim.Scene.loads(scene.dumps())
    assert again.colliders == scene.colliders
    sim = msim.Sim(again, integrator="symplectic-euler", h=1e-3)
    sim.step(2000)
    np.testing.assert_allclose(sim.x, [[0.1, 0, 0.1 * 0.5 * 0.1], [5, 0, 1]], rtol=0, atol=0.01)
    with pytest.raises(msim.ArgumentError, match="samples along 2 axes"):
        scene.add_heightfield((0, 0, 0), (1, 1), [1, 2, 3])
    with pytest.raises(msim.ArgumentError, match="at the border of the grid"):
        scene.add_sdf((0, 0, 0), (1, 1, 1), np.zeros((2, 2, 2)))


@pytest.mark.filterwarnings("ignore:particle .* inside")
@pytest.mark.parametrize("seed", range(100))
def test_a_moving_sphere_against_numpy(seed):
    """Symplectic Euler, then v - u is reflected, u = c' + omega x (R n), where s = |x - c| < R."""
    rng = np.random.default_rng(seed)
    n, h, radius = 30, 5e-3, 0.3 + 0.3 * rng.random()
    e, mu = rng.random(2)
    x, v, mass = rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, 3)), rng.uniform(1, 2, n)
    knots, centers = np.array([0, 0.2, 0.7]), rng.uniform(-1, 1, (3, 3))
    axis = rng.uniform(-1, 1, 3)
    angles = rng.uniform(-3, 3, 3)
    scene = msim.Scene(gravity=(0, 0, -3))
    scene.add_particles(x, v=v, mass=mass)
    scene.add_sphere((9, 9, 9), radius, restitution=e, friction=mu)
    scene.set_collider_motion(0, knots, centers, np.outer(angles, axis))
    sim = msim.Sim(scene, integrator="symplectic-euler", h=h, contacts="on")
    work = 0.0
    for step in range(1, 161):
        k = int(np.clip(np.searchsorted(knots, step * h - 1e-9) - 1, 0, 1))
        t, length = step * h, knots[k + 1] - knots[k]
        moves = t <= knots[-1] + 1e-9
        center = np.array([np.interp(t, knots, centers[:, c]) for c in range(3)])
        speed = (centers[k + 1] - centers[k]) / length * moves
        spin = axis * (angles[k + 1] - angles[k]) / length * moves
        v = v + h * np.array([0, 0, -3])
        x = x + h * v
        impulses = np.zeros((n, 3))
        for i in range(n):
            d = x[i] - center
            s = np.linalg.norm(d) - radius
            if s >= 0:
                continue
            normal = d / np.linalg.norm(d)
            u = speed + np.cross(spin, radius * normal)
            x[i] -= (1 + e) * s * normal
            relative = v[i] - u
            into = relative @ normal
            if into < 0:
                along = relative - into * normal
                size = np.linalg.norm(along)
                keep = max(0, 1 + mu * (1 + e) * into / size)
                impulses[i] = mass[i] * (u + keep * along - e * into * normal - v[i])
                v[i] += impulses[i] / mass[i]
                work += impulses[i] @ u
        sim.step(1)
        found = np.zeros((n, 3))
        found[sim.contacts["particle"]] = sim.contacts["impulse"]
        np.testing.assert_allclose(found, impulses, rtol=0, atol=1e-9)
        np.testing.assert_allclose(sim.x, x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sim.v, v, rtol=0, atol=1e-9)
    assert sim.energy.work == pytest.approx(work, abs=1e-9)
    assert work != 0 or seed > 0  # in some scenes no particle is hit


def test_contacts(falling):
    scene = msim.Scene(gravity=(0, 0, -10))
    scene.add_particles([[0, 0, 1], [1, 0, 0.001], [2, 0, 3]], mass=2)
    scene.add_plane((0, 0, 1), 0, restitution=0)
    scene.add_sphere((2, 0, 2), 1, restitution=0)
    sim = msim.Sim(scene, integrator="symplectic-euler", h=0.01, contacts="on")
    assert len(sim.contacts) == 0
    sim.step(10)
    found = sim.contacts
    assert found["particle"].tolist() == [1, 2]
    assert found["plane"].tolist() == [0, -1] and found["collider"].tolist() == [-1, 0]
    np.testing.assert_allclose(found["impulse"], [[0, 0, 0.2]] * 2, rtol=0, atol=1e-14)  # m g h
    np.testing.assert_allclose(found["point"], [[1, 0, 0], [2, 0, 3]], rtol=0, atol=1e-14)
    np.testing.assert_allclose(found["normal"], [[0, 0, 1]] * 2, rtol=0, atol=1e-14)
    with pytest.raises(msim.ArgumentError, match="contacts are not recorded"):
        msim.Sim(falling, integrator="symplectic-euler", h=0.01).contacts


def test_a_particle_rests_in_a_bowl():
    scene = msim.Scene(gravity=(0, 0, -10))
    scene.add_particles([[0.6, 0, 0]], mass=1)
    scene.add_sphere((0, 0, 0), 1, inside=True, restitution=0, friction=0.5)
    sim = msim.Sim(scene, integrator="velocity-verlet", h=1e-3, t_end=8)
    sim.run()
    np.testing.assert_allclose(np.linalg.norm(sim.x), 1, rtol=1e-12)
    assert abs(sim.x[0, 0]) < 0.5 and sim.x[0, 2] < -0.86  # within the cone of friction


@pytest.mark.parametrize("add, words", [
    (lambda s: s.add_sphere((0, 0, 0), 0), "radius is 0; it must be a finite number > 0"),
    (lambda s: s.add_sphere((0, 0), 1), "center must be three numbers"),
    (lambda s: s.add_box((0, 0, 0), (1, -1, 1)), r"size\[1\] is -1; it must be"),
    (lambda s: s.add_capsule((1, 0, 0), (1, 0, 0), 1), "from and to are the same point"),
    (lambda s: s.add_cylinder((1, 0, 0), (2, 0, 0), "wide"), "radius must be a number")])
def test_colliders_that_are_refused(add, words):
    scene = msim.Scene()
    with pytest.raises(msim.ArgumentError, match=words):
        add(scene)
    assert scene.colliders == []


@pytest.mark.parametrize("x", [np.zeros((2, 3), np.float32), np.zeros((2, 3), int),
                               np.zeros((4, 6))[::2, ::2], np.asfortranarray(np.zeros((2, 3))),
                               np.zeros((2, 3), ">f8"), [[0, 0, 0], (0, 0, 0)]])
def test_any_real_array_is_taken(x):
    x = np.asarray(x)
    x.flags.writeable = False
    scene = msim.Scene()
    assert scene.add_particles(x, mass=1) == range(2)


@pytest.mark.parametrize("x", [np.zeros(3), np.zeros((2, 2)), np.zeros((1, 2, 3)), "text", None,
                               [[1j, 0, 0]], [[0, 0, np.nan]], [[0, 0, np.inf]],
                               [["a", "b", "c"]], [[object()] * 3]])
def test_positions_that_are_refused(x):
    scene = msim.Scene()
    with pytest.raises(ValueError) as refused:
        scene.add_particles(x, mass=1)
    assert isinstance(refused.value, msim.ArgumentError) and len(scene) == 0


@pytest.mark.parametrize("ij", [[[0, 2]], [[0, -1]], [[0, 0]], [[0.0, 1.0]], [0, 1], [[0, 1, 1]],
                                [[0, 2**31]], [[True, "x"]]])
def test_springs_that_are_refused(pair, ij):
    with pytest.raises(msim.ArgumentError):
        pair.add_springs(ij, k=1)
    assert pair.nsprings == 1


@pytest.mark.parametrize("keys", [{"k": [1, 2]}, {"k": -1}, {"k": np.nan}, {"k": 1, "rest": -1},
                                  {"k": 1, "damping": [[1]]}, {"k": "stiff"}])
def test_values_of_springs_that_are_refused(pair, keys):
    with pytest.raises(msim.ArgumentError):
        pair.add_springs([[0, 1]], **keys)
    assert pair.nsprings == 1


def test_no_springs_and_no_pins_are_fine(pair):
    assert pair.add_springs([], k=1) == range(1, 1)
    pair.pin([])


@pytest.mark.parametrize("call", [
    lambda s: s.pin(-1), lambda s: s.pin(2), lambda s: s.pin(0.5), lambda s: s.pin([[0]]),
    lambda s: s.add_plane((0, 0, 0)), lambda s: s.add_plane((0, 1)),
    lambda s: s.add_plane((0, 0, 1), restitution=2), lambda s: s.add_faces([[0, 1, 2]]),
    lambda s: s.add_rope(2, (0, 0, 0), (1, 0, 0), mass="heavy", k=1),
    lambda s: s.add_cloth((2, 2), (0, 0, 0), (1, 0, 0), (0, 1, 0), mass=1, k=[1, 2, 3]),
    lambda s: s.add_rope(0, (0, 0, 0), (1, 0, 0), mass=1, k=1),
    lambda s: s.add_rope(-3, (0, 0, 0), (1, 0, 0), mass=1, k=1),
    lambda s: s.add_rope(2, (0, 0, 0), (1, 0, 0), mass=1, k=1, pinned="corners"),
    lambda s: s.add_cloth((2,), (0, 0, 0), (1, 0, 0), (0, 1, 0), mass=1, k=1),
    lambda s: s.add_cloth(4, (0, 0, 0), (1, 0, 0), (0, 1, 0), mass=1, k=1),
    lambda s: s.add_cloth((2, 2), (0, 0, 0), (1, 0, 0), (0, 1, 0), mass=1, k={"sheer": 1}),
    lambda s: s.add_cloth((2, 2), (0, 0, 0), (1, 0, 0), (0, 1, 0), mass=1, k=1, pinned="edge"),
    lambda s: s.add_lattice((2, 2, 2.5), (0, 0, 0), (1, 1, 1), mass=1, k=1),
    lambda s: setattr(s, "gravity", 9.81), lambda s: setattr(s, "gravity", (0, 0, np.nan)),
    lambda s: setattr(s, "drag", -1)])
def test_calls_that_are_refused(pair, call):
    before = pair.dumps()
    with pytest.raises(msim.ArgumentError):
        call(pair)
    assert pair.dumps() == before


def test_dicts_with_arrays():
    tree = {"gravity": np.array([0, 0, -9.81]),
            "particles": {"x": np.zeros((2, 3)) + [[0], [1]], "mass": np.float64(2)},
            "springs": {"ij": np.array([[0, 1]]), "k": 10}, "run": {"h": 0.01, "integrator": "rk4"}}
    scene = msim.Scene.from_dict(tree)
    assert len(scene) == 2 and msim.Sim(scene).plan.integrator == "rk4"
    with pytest.raises(msim.ArgumentError, match="springs.ij"):
        msim.Scene.from_dict({**tree, "springs": {"ij": [[0, 5]], "k": 1}})
    with pytest.raises(msim.ArgumentError, match="complex"):
        msim.Scene.from_dict({"gravity": 1j})


def test_files_and_text_keep_every_bit(tmp_path, cloth):
    path = tmp_path / "cloth.json"
    cloth.save(path)
    for other in (msim.Scene.load(path), msim.Scene.load(str(path)),
                  msim.Scene.loads(cloth.dumps()), msim.Scene.loads(cloth.dumps().encode()),
                  pickle.loads(pickle.dumps(cloth)), copy.deepcopy(cloth)):
        for name in ("x", "v", "mass", "pinned", "ij", "k", "rest", "damping", "faces", "gravity"):
            np.testing.assert_array_equal(getattr(other, name), getattr(cloth, name))
    assert json.loads(cloth.dumps())["msim"] == 1


def test_files_that_are_refused(tmp_path, pair):
    with pytest.raises(OSError, match="no_such") as error:
        msim.Scene.load(tmp_path / "no_such.json")
    assert error.value.status == msim.Status.ERR_IO
    with pytest.raises(ValueError, match="my scene"):
        msim.Scene.loads('{"msim": 1,', "my scene")
    with pytest.raises(OSError):
        pair.save(tmp_path / "no folder" / "scene.json")


def test_arrays_of_a_scene_are_copies(pair):
    x = pair.x
    pair.add_particles([[0, 0, 5]], mass=1)
    assert x.shape == (2, 3) and pair.x.shape == (3, 3) and not x.flags.writeable
