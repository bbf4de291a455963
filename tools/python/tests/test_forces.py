"""Forces on particles, and gravity, drag and forces that change during a run, against NumPy."""
import msim
import numpy as np
import pytest
from conftest import network


def accelerations(scene, x, v, gravity, drag, force):
    """F/m by the formulas of the manual, 0 where pinned."""
    total = scene.mass[:, None] * gravity - drag * v + force
    i, j = scene.ij.T
    d, w = x[j] - x[i], v[j] - v[i]
    length = np.linalg.norm(d, axis=1)[:, None]
    u = d / length
    pull = (scene.k[:, None] * (length - scene.rest[:, None])
            + scene.damping[:, None] * (u * w).sum(axis=1)[:, None]) * u
    np.add.at(total, i, pull)
    np.add.at(total, j, -pull)
    return np.where(scene.pinned[:, None], 0, total / scene.mass[:, None])


@pytest.mark.parametrize("seed", range(30))
def test_random_changes_against_numpy(seed):
    """Symplectic Euler: v' = v + h a(x, v), x' = x + h v'."""
    rng = np.random.default_rng(seed)
    scene = network(rng)
    n, h = len(scene), 1e-3
    gravity, drag, force = np.zeros(3), 0.0, np.zeros((n, 3))
    scene.gravity = gravity
    scene.drag = drag
    sim = msim.Sim(scene, integrator="symplectic-euler", h=h)
    x, v = scene.x.copy(), scene.v.copy()
    for _ in range(6):
        change = rng.integers(5)
        if change == 0:
            gravity = rng.normal(size=3)
            sim.set_gravity(gravity)
        elif change == 1:
            drag = rng.uniform()
            sim.set_drag(drag)
        elif change == 2:
            force = rng.normal(size=(n, 3))
            sim.set_forces(force)
        elif change == 3:
            force = np.zeros((n, 3))
            sim.set_forces(None)
        else:
            other = msim.Sim(scene, integrator="symplectic-euler", h=h)
            other.loads(sim.dumps())
            sim = other
        steps = int(rng.integers(1, 9))
        sim.step(steps)
        for _ in range(steps):
            v = v + h * accelerations(scene, x, v, gravity, drag, force)
            x = x + h * v
        np.testing.assert_allclose(sim.x, x, rtol=0, atol=1e-12 * np.abs(x).max())
        np.testing.assert_allclose(sim.v, v, rtol=0, atol=1e-11 * np.abs(v).max() + 1e-14)


def test_forces_of_scenes(pair):
    scene = msim.Scene.loads(pair.dumps())
    assert not scene.force.any()
    scene.force = [[0, 0, 0], [1, 2, 3]]
    again = msim.Scene.loads(scene.dumps())
    np.testing.assert_array_equal(again.force, [[0, 0, 0], [1, 2, 3]])
    with pytest.raises(msim.ArgumentError, match=r"force must have the shape \(2, 3\)"):
        scene.force = [1, 2, 3]
    with pytest.raises(msim.ArgumentError, match=r"particles.force\[1\] is nan"):
        scene.force = [[0, 0, 0], [np.nan, 0, 0]]


def test_work_is_the_change_of_energy(pair):
    sim = msim.Sim(pair, integrator="dop853", tol=1e-12, t_end=1)
    before = sim.energy
    sim.set_gravity([3, 1, 2])
    assert before.work == 0 != sim.energy.work
    assert sim.energy.total - sim.energy.work == pytest.approx(before.total, abs=1e-14)
    result = sim.run()
    assert result.work[0] == result.work[-1] == sim.energy.work


def test_motions(pair):
    scene = msim.Scene.loads(pair.dumps())
    scene.pin(0)
    pinned = [0]
    start = scene.x[pinned]
    t = [0, 0.5, 1]
    points = np.stack([start, start + [0, 0, 0.1], start + [0, 0.2, 0]])
    scene.add_motion(pinned, t, points)
    again = msim.Scene.loads(scene.dumps())
    sim = msim.Sim(again, integrator="dop853", tol=1e-12, t_end=1)
    before = sim.energy.total
    for frame in sim.frames():
        s = frame.t / 0.5
        where = points[0] + s * (points[1] - points[0]) if s <= 1 else \
            points[1] + (s - 1) * (points[2] - points[1])
        np.testing.assert_allclose(frame.x[pinned], where, rtol=0, atol=1e-14)
    assert sim.energy.work != 0
    assert sim.energy.total - sim.energy.work == pytest.approx(before, abs=1e-11)
    with pytest.raises(msim.ArgumentError, match=r"x must have the shape \(3, 1, 3\)"):
        scene.add_motion(pinned, t, points[:, 0])
    with pytest.raises(msim.ArgumentError, match="has a motion already"):
        scene.add_motion(pinned, t, points, cubic=True)


def test_handles(cloth):
    sim = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    start = sim.x[0].copy()
    sim.move_pinned(0, start + [0, 0, 0.1], 0.1)
    sim.step(50)
    np.testing.assert_allclose(sim.x[0], start + [0, 0, 0.05], rtol=0, atol=1e-13)
    sim.set_pinned(0)
    sim.step(10)
    np.testing.assert_allclose(sim.x[0], start + [0, 0, 0.05], rtol=0, atol=1e-13)
    sim.set_pinned([0], False)
    sim.step(100)
    assert np.abs(sim.x[0] - start - [0, 0, 0.05]).max() > 1e-3
    with pytest.raises(msim.ArgumentError, match="which is not pinned"):
        sim.move_pinned([0], [start], 1)
