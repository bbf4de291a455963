"""Sims: live views and their lifetime, states, springs, forces, matrices, checkpoints."""
import copy
import gc
import pickle
import weakref

import msim
import numpy as np
import pytest
from conftest import network


def sim_of(scene, **options):
    return msim.Sim(scene, **{"integrator": "velocity-verlet", "h": 1e-3, **options})


def test_views_are_live_and_read_only(pair):
    sim = sim_of(pair)
    x, v = sim.x, sim.v
    address = x.__array_interface__["data"][0]
    start = x.copy()
    sim.step(10)
    assert sim.x is x and sim.v is v and not np.array_equal(x, start)
    sim.set_state(x=start + [0, 0, 1], t=0, step=0)  # leaves the plane of the scene
    sim.step()
    assert sim.x is x and x.__array_interface__["data"][0] == address
    assert x.shape == (2, 3) and x.dtype == np.float64 and x.flags.c_contiguous
    with pytest.raises(ValueError, match="read-only"):
        x[0] = 0
    with pytest.raises(ValueError):
        x.flags.writeable = True
    with pytest.raises(AttributeError):
        sim.x = start


def test_views_outlive_the_sim(cloth):
    views = []
    for _ in range(50):
        sim = sim_of(cloth)
        sim.step(3)
        views += [sim.x, sim.v[3:5], sim.x.T]
        last = sim.x.copy()
        died = weakref.ref(sim)
        del sim
        assert died() is None  # there is no reference cycle
    gc.collect()
    for i in range(0, len(views), 3):
        np.testing.assert_array_equal(views[i], last)


def test_sims_outlive_the_scene(pair):
    scene = copy.deepcopy(pair)
    sim = sim_of(scene)
    del scene
    gc.collect()
    sim.step(10)
    assert sim.nsteps == 10 and sim.t == pytest.approx(0.01)


def test_a_changed_scene_leaves_its_sims(pair):
    sim = sim_of(pair)
    pair.add_particles([[0, 0, 1]], mass=1)
    assert len(sim) == 2 and len(pair) == 3


@pytest.mark.parametrize("method", ["verlet", "velocity-verlet", "implicit-midpoint", "dop853"])
def test_steps_in_any_portions_give_the_same_bits(method, cloth):
    sims = [sim_of(cloth, integrator=method, steps=300) for _ in range(3)]
    sims[0].step(300)
    for _ in range(300):
        sims[1].step()
    for n in (0, 1, 7, 92, 200):
        sims[2].step(n)
    for sim in sims[1:]:
        np.testing.assert_array_equal(sim.x, sims[0].x)
        np.testing.assert_array_equal(sim.v, sims[0].v)


@pytest.mark.parametrize("n", [-1, 1.5, "2", None])
def test_numbers_of_steps_that_are_refused(pair, n):
    sim = sim_of(pair)
    with pytest.raises((TypeError, ValueError)):
        sim.step(n)
    assert sim.nsteps == 0


def test_states(pair):
    sim = sim_of(pair)
    sim.set_state(v=[[0, 1, 0], [0, -1, 0]], t=2, step=5)
    assert sim.t == 2 and sim.nsteps == 5
    np.testing.assert_array_equal(sim.v[0], [0, 1, 0])
    sim.set_state(x=sim.x, v=sim.v)  # views of the sim itself
    np.testing.assert_array_equal(sim.x, pair.x)
    for bad in (np.zeros(6), np.zeros((3, 3)), [[np.nan, 0, 0], [0, 0, 0]], "x"):
        with pytest.raises(msim.ArgumentError):
            sim.set_state(x=bad)
    assert sim.frame.step == 5


def test_the_velocity_of_verlet(pair):
    sim = sim_of(pair, integrator="verlet")
    sim.step(3)
    other = sim_of(pair, integrator="verlet")
    other.set_state(sim.x, sim.v, v_half=sim.v_half, t=sim.t, step=3)
    sim.step(100), other.step(100)
    np.testing.assert_array_equal(other.x, sim.x)
    assert sim_of(pair).v_half is None


def test_springs(pair):
    sim = sim_of(pair)
    sim.set_springs(k=20)
    assert sim.force()[0, 0] == pytest.approx(20 * 0.1)
    sim.set_springs(rest=[1.1])
    assert sim.force()[0, 0] == 0
    for bad in ({"k": [1, 2]}, {"k": -1}, {"rest": np.nan}):
        with pytest.raises(msim.ArgumentError):
            sim.set_springs(**bad)


def test_step_size(pair):
    sim = sim_of(pair)
    sim.h = 0.01
    assert sim.h == 0.01 and sim.plan.h == 0.01
    sim.h = "auto"
    assert sim.h > 0.1
    with pytest.raises(ValueError):
        sim.h = -2


def springs_force(scene, x, v):
    """The forces of the springs, gravity and drag, in NumPy."""
    force = scene.mass[:, None] * scene.gravity - scene.drag * v
    i, j = scene.ij.T
    d = x[j] - x[i]
    length = np.linalg.norm(d, axis=1)
    u = d / length[:, None]
    f = scene.k * (length - scene.rest) + scene.damping * np.sum(u * (v[j] - v[i]), axis=1)
    np.add.at(force, i, f[:, None] * u)
    np.subtract.at(force, j, f[:, None] * u)
    force[scene.pinned] = 0
    return force


def test_forces_against_numpy():
    scene = network()
    sim = sim_of(scene)
    random = np.random.default_rng(1)
    x, v = scene.x + random.normal(size=(12, 3)), random.normal(size=(12, 3))
    expected = springs_force(scene, x, v)
    np.testing.assert_allclose(sim.force(x, v), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(sim.force(), sim.force(sim.x, sim.v))
    with pytest.raises(msim.ArgumentError):
        sim.force(np.zeros((3, 3)))


def test_reactions_and_springs_against_numpy():
    scene = network()
    sim = sim_of(scene, h=1e-4)
    sim.step(30)
    i, j = scene.ij.T
    d, dv = sim.x[j] - sim.x[i], sim.v[j] - sim.v[i]
    length = np.linalg.norm(d, axis=1)
    rate = (d * dv).sum(axis=1) / length
    springs = sim.springs
    np.testing.assert_allclose(springs.tension, scene.k * (length - scene.rest)
                               + scene.damping * rate, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(springs.elongation, length - scene.rest, rtol=0, atol=1e-14)
    np.testing.assert_allclose(springs.strain, springs.elongation / scene.rest, rtol=1e-14)
    pull = springs.tension[:, None] * d / length[:, None]
    force = np.zeros_like(sim.x)
    np.add.at(force, i, pull)
    np.add.at(force, j, -pull)
    force += scene.mass[:, None] * np.array(scene.gravity) - scene.drag * sim.v
    pinned = np.asarray(scene.pinned, dtype=bool)
    np.testing.assert_allclose(sim.reactions[pinned], -force[pinned], rtol=1e-10, atol=1e-10)
    assert not sim.reactions[~pinned].any()


def test_islands_add_up_to_the_energy():
    scene = msim.Scene()
    scene.add_particles(x=[[0, 0, 0], [1, 0, 0], [0, 0, 2], [5, 0, 0]], mass=[1, 2, 3, 4],
                        v=[[0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 1]])
    scene.add_springs(ij=[[0, 1], [2, 0]], k=8, rest=[0.5, 2])
    scene.pin(0)
    sim = sim_of(scene)
    islands = sim.islands
    np.testing.assert_array_equal(islands.of, [3, 0, 1, 2])
    np.testing.assert_array_equal(islands.kinetic, [1, 0, 2, 0])
    np.testing.assert_array_equal(islands.elastic, [1, 0, 0, 0])
    sim.step(50)
    energy = sim.energy
    for name in ("kinetic", "elastic", "gravitational"):
        assert getattr(sim.islands, name).sum() == pytest.approx(getattr(energy, name), abs=1e-12)


def test_matrix_is_the_derivative_of_the_forces():
    pytest.importorskip("scipy")
    scene = network()
    h = 0.01
    sim = msim.Sim(scene, integrator="linearly-implicit-euler", h=h)
    free = ~scene.pinned
    rows = np.flatnonzero(np.repeat(free, 3))
    jacobian = np.empty((36, 36))
    for c in range(36):  # central differences
        step = np.zeros(36)
        step[c] = 1e-6
        step = step.reshape(12, 3)
        jacobian[:, c] = (sim.force(sim.x + step) - sim.force(sim.x - step)).ravel() / 2e-6
    i, j = scene.ij.T
    u = (scene.x[j] - scene.x[i]) / np.linalg.norm(scene.x[j] - scene.x[i], axis=1)[:, None]
    damping = -scene.drag * np.eye(36)
    for s, (p, q) in enumerate(scene.ij):
        block = scene.damping[s] * np.outer(u[s], u[s])
        for a, b, sign in ((p, p, -1), (q, q, -1), (p, q, 1), (q, p, 1)):
            damping[3 * a:3 * a + 3, 3 * b:3 * b + 3] += sign * block
    expected = np.diag(np.repeat(scene.mass, 3)) - h * damping - h * h * jacobian
    A = sim.matrix()
    assert A.shape == (33, 33) and A.format == "csr"
    np.testing.assert_allclose(A.toarray(), expected[np.ix_(rows, rows)], rtol=0, atol=1e-6)
    A.data[:] = 0  # a copy
    assert np.abs(sim.matrix().toarray()).max() > 0


def test_energy(cloth):
    sim = sim_of(cloth)
    sim.step(50)
    energy = sim.energy
    kinetic = 0.5 * np.sum(cloth.mass[:, None] * sim.v**2)
    assert energy.kinetic == pytest.approx(kinetic, rel=1e-12)
    assert energy.total == pytest.approx(sum(energy[:3]), rel=1e-12)
    np.testing.assert_allclose(energy.momentum, cloth.mass @ sim.v, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("method", ["verlet", "bdf2", "dop853"])
def test_checkpoints_continue_bit_by_bit(method, cloth, tmp_path):
    sim, other = (sim_of(cloth, integrator=method, t_end=1) for _ in range(2))
    sim.step(20)
    saved = sim.dumps()
    sim.save(tmp_path / "run.checkpoint")
    sim.step(20)
    other.load(tmp_path / "run.checkpoint")
    assert other.nsteps == 20 and other.dumps() == saved
    other.step(20)
    np.testing.assert_array_equal(other.x, sim.x)
    other.loads(saved)
    assert other.nsteps == 20
    for bad in (b"", saved[:-1], saved[:40] + b"x" + saved[41:]):
        with pytest.raises(msim.Error):
            other.loads(bad)
    with pytest.raises(TypeError):
        other.loads("text")


@pytest.mark.parametrize("method", ["verlet", "dop853", "bdf2"])
def test_clones_continue_bit_by_bit(method, cloth):
    options = {"tol": 1e-4, "t_end": 1} if method == "dop853" else {}
    sim = sim_of(cloth, integrator=method, **options)
    sim.step(7)
    copy = sim.clone()
    assert type(copy) is msim.Sim and len(copy) == len(sim)
    sim.step(5)
    assert copy.nsteps == 7
    copy.step(5)
    np.testing.assert_array_equal(sim.x, copy.x)
    assert sim.dumps() == copy.dumps()
    x = copy.x.copy()
    del sim
    np.testing.assert_array_equal(copy.x, x)


def test_clones_warn_on_their_own(pair):
    copy = sim_of(pair).clone()
    with pytest.warns(RuntimeWarning, match="stab"):
        copy.h = 10


def test_incomplete_steps_are_counted(cloth):
    options = {"integrator": "linearly-implicit-euler", "h": 0.05, "solver": "pcg",
               "solver_max_iterations": 1}
    with pytest.raises(msim.NotConvergedError):
        sim_of(cloth, **options).step(10)
    sim = sim_of(cloth, incomplete="accept", **options)
    sim.step(10)
    assert sim.stats["incomplete_steps"] > 0


def test_sims_are_not_pickled(pair):
    sim = sim_of(pair)
    for refused in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="checkpoint"):
            refused(sim)


def test_texts(cloth):
    sim = sim_of(cloth)
    assert "64 particles" in repr(sim) and sim.explain().startswith("advice        ")
    assert sim._repr_html_().startswith("<pre>&lt;msim.Sim")
    assert sim.stats["steps"] == 0 and sim.plan.integrator == "velocity-verlet"


def test_estimate(cloth):
    sim = sim_of(cloth, h=1e-3, steps=100)
    found = sim.estimate()
    assert (found.tried, found.steps, found.solves) == (4, 100, 0)
    sim.step(100)
    assert sim.stats["force_evaluations"] == found.force_evaluations and sim.estimate().steps == 0
    failing = sim_of(cloth, integrator="implicit-euler", h=0.1, steps=9, newton_max_iterations=1,
                     newton_retries=0)
    with pytest.raises(msim.NotConvergedError):
        failing.estimate()


def test_many_particles():
    n = 250_000
    scene = msim.Scene(gravity=(0, 0, -1))
    x = np.random.default_rng(0).normal(size=(n, 3))
    assert scene.add_particles(x, mass=1) == range(n)
    sim = sim_of(scene, h=0.5)
    sim.step(2)
    np.testing.assert_allclose(sim.x, x - [0, 0, 0.5], rtol=0, atol=1e-12)


def test_lists():
    assert "velocity-verlet" in {method.name for method in msim.integrators()}
    assert {"pcg"} <= {solver.name for solver in msim.solvers()}
    assert {"csv"} <= {recorder.name for recorder in msim.recorders()}
    assert {option.keyword for option in msim.options()} >= {"h", "tol", "solver_rtol"}
    assert isinstance(msim.importers(), list)
