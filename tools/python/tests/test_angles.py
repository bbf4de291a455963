"""Angular springs: Scene.add_angles, and the key bending of ropes and cloths."""
import msim
import numpy as np
import pytest


def net(seed: int) -> msim.Scene:
    """Random particles, springs and angular springs, some straight or nearly so."""
    rng = np.random.default_rng(seed)
    n, m = 20, 30
    x = rng.uniform(size=(n, 3))
    x[1] = (x[0] + x[2]) / 2 + rng.normal(size=3) * 10.0 ** -rng.integers(1, 12)
    scene = msim.Scene()
    scene.add_particles(x, 0.5, rng.normal(size=(n, 3)))
    i = rng.integers(n, size=m)
    scene.add_springs(np.stack([i, (i + 1) % n], axis=1), 10, 0.1, 0.1)
    ijk = np.stack([2 + rng.permutation(n - 2)[:3] for _ in range(m)])
    rest = np.where(np.arange(m) % 2, np.pi, rng.uniform(0.1, 3, m))
    assert scene.add_angles([[0, 1, 2]], 0.3, damping=0) == range(1)
    assert scene.add_angles(ijk, rng.uniform(1, 5, m), rest, rng.uniform(0, 1, m)) == range(1, m + 1)
    return scene


def angles(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """By Kahan's formula, with complex arguments, too."""
    a, b = np.sqrt((p * p).sum(1)), np.sqrt((q * q).sum(1))
    u, v = p * b[:, None], q * a[:, None]
    return 2 * np.arctan(np.sqrt(((u - v) ** 2).sum(1)) / np.sqrt(((u + v) ** 2).sum(1)))


def forces(scene: msim.Scene) -> np.ndarray:
    """-dE/dx - damping dtheta/dt dtheta/dx, by complex steps in each coordinate, and springs."""
    i, j, k = scene.ijk.T
    x, v = scene.x, scene.v
    p, q = x[i] - x[j], x[k] - x[j]
    by = np.zeros((2, len(i), 3))
    for c in range(3):
        step = np.zeros(3, complex)
        step[c] = 1e-30j
        by[0, :, c] = angles(p + step, q).imag / 1e-30
        by[1, :, c] = angles(p, q + step).imag / 1e-30
    rate = (by[0] * (v[i] - v[j]) + by[1] * (v[k] - v[j])).sum(1)
    torque = scene.angle_k * (angles(p, q) - scene.angle_rest) + scene.angle_damping * rate
    total = np.zeros_like(x)
    for end, pull in ((i, by[0]), (k, by[1]), (j, -by[0] - by[1])):
        np.add.at(total, end, -torque[:, None] * pull)
    a, b = scene.ij.T
    d = x[b] - x[a]
    length = np.linalg.norm(d, axis=1)
    f = scene.k * (length - scene.rest) + scene.damping * (d * (v[b] - v[a])).sum(1) / length
    np.add.at(total, a, (f / length)[:, None] * d)
    np.add.at(total, b, -(f / length)[:, None] * d)
    return total


@pytest.mark.parametrize("seed", range(100))
def test_forces_of_random_nets(seed: int) -> None:
    scene = net(seed)
    h = 1e-3
    sim = msim.Sim(scene, integrator="symplectic-euler", h=h)
    start = scene.v
    sim.step()
    wanted = forces(scene)
    found = (sim.v - start) * 0.5 / h
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())


def test_energies_and_files() -> None:
    scene = net(0)
    i, j, k = scene.ijk.T
    theta = angles(scene.x[i] - scene.x[j], scene.x[k] - scene.x[j])
    a, b = scene.ij.T
    stretch = np.linalg.norm(scene.x[b] - scene.x[a], axis=1) - scene.rest
    wanted = ((scene.angle_k * (theta - scene.angle_rest) ** 2).sum()
              + (scene.k * stretch**2).sum()) / 2
    assert msim.Sim(scene, integrator="rk4", h=1e-3).energy.elastic == pytest.approx(wanted, 1e-12)
    again = msim.Scene.loads(scene.dumps())
    for name in ("ijk", "angle_k", "angle_rest", "angle_damping"):
        np.testing.assert_array_equal(getattr(again, name), getattr(scene, name))


def test_ropes_and_cloths_bend() -> None:
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_rope(11, (0, 0, 0), (1, 0, 0), mass=0.1, k=1e4, bending=50, pinned=[0, 1])
    scene.add_cloth((4, 3), (2, 0, 0), (0, 1, 0), (1, 0, 0), mass=1, k=10, bending=0.1)
    assert scene.nangles == 9 + 4 + 6 and np.all(scene.angle_rest == np.pi)
    sim = msim.Sim(scene, integrator="implicit-euler", h=0.05, t_end=5)
    sim.run()
    # a cantilever under its own weight: each joint, n = 1 to 9 from the tip, turns by
    # m g a (1 + ... + n)/k, and lowers the tip by n a times that
    turns = 0.1 / 11 * 9.81 * 0.1 / 50 * np.cumsum(np.arange(1, 10))
    assert -sim.x[10, 2] == pytest.approx((turns * 0.1 * np.arange(1, 10)).sum(), rel=0.01)


@pytest.mark.parametrize("ijk, keys, words", [
    ([[0, 1]], {"k": 1}, r"ijk must have the shape \(n, 3\)"),
    ([[0, 1, 9]], {"k": 1}, "refers to particle 9"),
    ([[0, 1, 0]], {"k": 1}, "has particle 0 twice"),
    ([[0, 1, 2]], {"k": [1, 2]}, "k must be one number, or one for each of 1 angles"),
    ([[0, 1, 2]], {"k": -1}, r"k\[0\] is -1"),
    ([[0, 1, 2]], {"k": 1, "rest": 4}, r"rest\[0\] is 4; it must lie in \[0, pi\]")])
def test_angles_that_are_refused(ijk: list[list[int]], keys: dict[str, float], words: str) -> None:
    scene = msim.Scene()
    scene.add_particles(np.eye(3), 1)
    with pytest.raises(msim.ArgumentError, match=words):
        scene.add_angles(ijk, **keys)
    assert scene.nangles == 0
