"""Edits of scenes and running sims, and springs that break, against NumPy."""
import msim
import numpy as np
import pytest
from conftest import network
from test_forces import accelerations


class Net:
    """A net in NumPy, moved by symplectic Euler: v' = v + h a(x, v), x' = x + h v'."""

    def __init__(self, scene):
        self.x, self.v, self.mass = scene.x.copy(), scene.v.copy(), scene.mass.copy()
        self.pinned, self.ij = scene.pinned.copy(), scene.ij.copy()
        self.k, self.rest, self.damping = scene.k.copy(), scene.rest.copy(), scene.damping.copy()
        self.gravity, self.drag = np.array(scene.gravity), scene.drag
        self.broken = np.zeros(len(self.k), bool)

    def step(self, h, threshold=np.inf):
        self.v = self.v + h * accelerations(self, self.x, self.v, self.gravity, self.drag, 0)
        self.x = self.x + h * self.v
        i, j = self.ij.T
        stretch = np.linalg.norm(self.x[j] - self.x[i], axis=1) - self.rest
        breaks = (stretch > threshold * self.rest) & ~(self.pinned[i] & self.pinned[j])
        self.broken |= breaks
        self.k[self.broken] = self.damping[self.broken] = 0

    def remove_springs(self, springs):
        self.ij = np.delete(self.ij, springs, axis=0)
        for name in ("k", "rest", "damping", "broken"):
            setattr(self, name, np.delete(getattr(self, name), springs))

    def remove_particles(self, particles):
        gone = np.zeros(len(self.x), bool)
        gone[particles] = True
        self.remove_springs(np.flatnonzero(gone[self.ij].any(axis=1)))
        self.ij = (np.cumsum(~gone) - 1)[self.ij]
        for name in ("x", "v", "mass", "pinned"):
            setattr(self, name, np.delete(getattr(self, name), particles, axis=0))

    def add_particles(self, x, mass, v):
        self.x, self.v = np.vstack([self.x, x]), np.vstack([self.v, v])
        self.mass = np.append(self.mass, mass)
        self.pinned = np.append(self.pinned, np.zeros(len(x), bool))

    def add_springs(self, ij, k, rest, damping):
        self.ij = np.vstack([self.ij, ij])
        self.k, self.rest = np.append(self.k, k), np.append(self.rest, rest)
        self.damping = np.append(self.damping, damping)
        self.broken = np.append(self.broken, np.zeros(len(k), bool))


def close(sim, net):
    assert len(sim) == len(net.x)
    assert sim.nsprings == len(net.k)
    np.testing.assert_allclose(sim.x, net.x, rtol=0, atol=1e-11 * np.abs(net.x).max())
    np.testing.assert_allclose(sim.v, net.v, rtol=0, atol=1e-10 * np.abs(net.v).max() + 1e-13)


def edit_both(rng, sim, net):
    change = rng.integers(5)
    n, m = len(net.x), len(net.k)
    pair = rng.choice(n, 2, replace=False)
    if change == 0 and m > 3:
        springs = rng.integers(m, size=2)
        sim.remove_springs(springs)
        net.remove_springs(springs)
    elif change == 1 and n > 4:
        particles = rng.integers(n, size=2)
        sim.remove_particles(particles)
        net.remove_particles(particles)
    elif change == 2:
        x, v, mass = rng.normal(size=(2, 3)), rng.normal(size=(2, 3)), rng.uniform(1, 2, 2)
        assert sim.add_particles(x, mass, v) == range(n, n + 2)
        net.add_particles(x, mass, v)
    elif change == 3:
        k, rest, damping = rng.uniform(1, 9, 1), rng.uniform(1, 2, 1), rng.uniform(0, 0.2, 1)
        assert sim.add_springs([pair], k, rest, damping) == range(m, m + 1)
        net.add_springs([pair], k, rest, damping)
    elif change == 4 and n > 4:
        gone = int(rng.integers(n))
        stays = [p for p in range(n) if p != gone][:2]
        x, mass = rng.normal(size=(1, 3)), rng.uniform(1, 2, 1)
        ij = [[stays[0], n], [n, stays[1]]]
        sim.edit(remove_particles=gone, x=x, mass=mass, ij=ij, k=3, rest=1)
        net.add_particles(x, mass, np.zeros((1, 3)))
        net.add_springs(ij, [3, 3], [1, 1], [0, 0])
        net.remove_particles([gone])


@pytest.mark.parametrize("seed", range(40))
def test_random_edits_against_numpy(seed):
    rng = np.random.default_rng(seed)
    scene = network(rng)
    sim, net = msim.Sim(scene, integrator="symplectic-euler", h=1e-3), Net(scene)
    for _ in range(8):
        edit_both(rng, sim, net)
        if rng.integers(3) == 0:
            resumed = msim.Sim(scene, integrator="symplectic-euler", h=1e-3)
            resumed.loads(sim.dumps())
            sim = resumed if rng.integers(2) else sim.clone()
        for _ in range(int(rng.integers(1, 9))):
            sim.step()
            net.step(1e-3)
        close(sim, net)


@pytest.mark.parametrize("seed", range(40))
def test_breaking_nets_against_numpy(seed):
    rng = np.random.default_rng(seed)
    scene = network(rng)
    law = scene.add_law("linear", break_strain=0.05)
    scene.set_law(range(scene.nsprings), law)
    sim, net = msim.Sim(scene, integrator="symplectic-euler", h=1e-3), Net(scene)
    for _ in range(200):
        sim.step()
        net.step(1e-3, threshold=0.05)
        np.testing.assert_array_equal(sim.broken, net.broken)
    close(sim, net)
    assert sim.stats["broken"] == net.broken.sum()
    np.testing.assert_array_equal(sim.springs.tension[sim.broken], 0)


def test_scenes_are_edited_as_sims(cloth):
    """The edited scene makes the sim that the edit makes."""
    arguments = {"remove_particles": [5, 20], "remove_springs": [3, 3, 40], "x": [[0.5, 0.5, 1.5]],
                 "mass": 0.01, "ij": [[6, 64], [64, 7]], "k": [10, 20], "rest": 0.4,
                 "ijk": [[6, 64, 7], [0, 1, 2]], "angle_k": 0.01, "angle_rest": [2, np.pi]}
    sim = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    sim.edit(**arguments)
    cloth.edit(**arguments)
    fresh = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    sim.step(50)
    fresh.step(50)
    np.testing.assert_array_equal(sim.x, fresh.x)
    assert len(cloth) == 63 and cloth.nsprings == sim.nsprings


def test_views_of_edited_sims(cloth):
    """Views taken before stay readable, and new ones have the new shape."""
    sim = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    before, row = sim.x, sim.v[3]
    saved = sim.dumps()
    for _ in range(9):
        sim.add_particles(np.ones((100, 3)), 1)
    sim.step(3)
    assert before.shape == (64, 3) and np.isfinite(before).all() and np.isfinite(row).all()
    assert sim.x.shape == (964, 3)
    sim.loads(saved)
    assert sim.x.shape == (64, 3) and len(sim) == 64


def test_springs_are_broken_by_hand(cloth):
    sim = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    with pytest.raises(msim.ArgumentError, match="no law of the scene has break_strain"):
        sim.break_springs(0)
    cloth.set_law(0, cloth.add_law("tension", break_force=1e9))
    sim = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    sim.break_springs([2, 5, 2])
    assert np.flatnonzero(sim.broken).tolist() == [2, 5]
    assert sim.clone().stats["broken"] == 2


def test_messages(cloth):
    sim = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    for call, text in [
            (lambda: sim.remove_springs(9999), r"removed_springs\[0\] is 9999; there are"),
            (lambda: sim.edit(x=[[0, 0, 0]]), "both x and mass"),
            (lambda: sim.edit(ij=[[0, 1]]), "both ij and k"),
            (lambda: sim.add_springs([[0, 1]], 1, law=[1, 2]), "one for each of 1 springs"),
            (lambda: sim.add_springs([[0, 64]], 1), r"springs.ij\[0\] refers to particle 64"),
            (lambda: sim.add_springs([[0, 1]], [1, 2]), "k must be one number"),
            (lambda: sim.edit(ijk=[[0, 1, 2]]), "both ijk and angle_k"),
            (lambda: sim.add_angles([[0, 1, 64]], 1), r"angles.ijk\[0\] refers to particle 64"),
            (lambda: cloth.add_law("linear"), "set break_strain or break_force"),
            (lambda: cloth.add_law("tension", break_strain=-1), "break_strain is -1")]:
        with pytest.raises(msim.ArgumentError, match=text):
            call()
    assert sim.nsprings == cloth.nsprings
