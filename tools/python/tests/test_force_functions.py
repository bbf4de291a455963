"""Forces that a program computes: Scene.set_force, against SciPy."""
import threading

import msim
import numpy as np
import pytest
from scipy.integrate import solve_ivp


def tree(seed: int, n: int = 12) -> msim.Scene:
    rng = np.random.default_rng(seed)
    scene = msim.Scene(gravity=rng.normal(size=3))
    scene.add_particles(rng.normal(size=(n, 3)), rng.uniform(0.5, 2, n), v=rng.normal(size=(n, 3)))
    ij = [(i, int(rng.integers(i))) for i in range(1, n)]
    scene.add_springs(ij, rng.uniform(5, 20, n - 1), damping=rng.uniform(0, 0.3))
    return scene


class Storm:
    """A magnet, quadratic drag in gusts, and a trap, with random numbers"""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed + 1000)
        self.field, self.wind, self.k = rng.normal(size=(3, 3))
        self.c, self.omega = rng.uniform(0.05, 0.3), rng.uniform(1, 5)

    def force(self, t, particles, x, v):
        u = self.wind * np.sin(self.omega * t) - v
        speed = np.linalg.norm(u, axis=1, keepdims=True)
        return np.cross(v, self.field) + self.c * speed * u - self.k**2 * x * (1 + particles[:, None])

    def jacobian(self, t, particles, x, v):
        u = self.wind * np.sin(self.omega * t) - v
        speed = np.linalg.norm(u, axis=1)[:, None, None]
        bx, by, bz = self.field
        magnet = np.array([[0, bz, -by], [-bz, 0, bx], [by, -bx, 0]])
        dfdv = magnet - self.c * (speed * np.eye(3) + u[:, :, None] * u[:, None, :] / speed)
        return -np.diag(self.k**2) * (1 + particles[:, None, None]), dfdv


def exact(scene: msim.Scene, storm: Storm, end: float) -> np.ndarray:
    n, i, j = len(scene), scene.ij[:, 0], scene.ij[:, 1]

    def rates(t, y):
        x, v = y.reshape(2, n, 3)
        d, w = x[j] - x[i], v[j] - v[i]
        length = np.linalg.norm(d, axis=1)
        u = d / length[:, None]
        pull = scene.k * (length - scene.rest) + scene.damping * np.sum(u * w, axis=1)
        f = storm.force(t, np.arange(n), x, v) + scene.mass[:, None] * np.array(scene.gravity)
        np.add.at(f, i, pull[:, None] * u)
        np.add.at(f, j, -pull[:, None] * u)
        return np.concatenate([v, f / scene.mass[:, None]]).ravel()

    y = np.concatenate([scene.x, scene.v]).ravel()
    return solve_ivp(rates, (0, end), y, method="DOP853", rtol=1e-11, atol=1e-11).y[:3 * n, -1]


@pytest.mark.parametrize("seed", range(100))
def test_random_scenes_follow_scipy(seed: int) -> None:
    methods = {"dop853": 1e-7, "rk4": 2e-6, "velocity-verlet": 5e-3, "implicit-midpoint": 5e-3,
               "tr-bdf2": 5e-3, "implicit-euler": 0.2, "linearly-implicit-euler": 0.2, "rkc": 5e-3}
    method, tolerance = list(methods.items())[seed % len(methods)]
    scene, storm = tree(seed), Storm(seed)
    scene.set_force(storm.force, time=True, velocity=True, jacobian=storm.jacobian)
    options = {"tol": 1e-9} if method == "dop853" else {"h": 0.005}
    sim = msim.Sim(scene, integrator=method, t_end=0.5, **options)
    while sim.t < 0.5 - 1e-12:
        sim.step()
    np.testing.assert_allclose(sim.x.ravel(), exact(scene, storm, 0.5), rtol=0, atol=tolerance)


def test_the_jacobian_is_that_of_the_matrix() -> None:
    scene = msim.Scene()
    scene.add_particles([[1, 2, 3], [4, 5, 6]], 2)
    scene.set_force(lambda t, p, x, v: -5 * x - 0.5 * v, velocity=True,
                    jacobian=lambda t, p, x, v: (-5, -0.5 * np.eye(3)))
    a = msim.Sim(scene, integrator="implicit-euler", h=0.1).matrix()
    np.testing.assert_allclose(a.toarray(), (2 + 0.05 + 0.05) * np.eye(6), rtol=1e-15)


def test_what_a_function_gets(cloth: msim.Scene) -> None:
    seen = []

    def wind(t, particles, x, v):
        seen.append((t, particles.copy(), x, v))
        return 0.1, 0, 0

    cloth.set_force(wind, time=True)
    sim = msim.Sim(cloth, integrator="symplectic-euler", h=0.01)
    at = sim.x.copy()
    sim.step()
    t, particles, x, v = seen[1]
    assert t == 0 and v is None and x.dtype == np.float64
    np.testing.assert_array_equal(particles, np.flatnonzero(~cloth.pinned))
    np.testing.assert_array_equal(x, at[particles])
    x[:] = 7  # a copy
    assert sim.x.max() < 2


def test_exceptions_are_raised_by_the_step(pair: msim.Scene) -> None:
    class Broken(Exception):
        pass

    fails = [False]

    def force(t, particles, x, v):
        if fails[0]:
            raise Broken("the controller")
        return np.zeros_like(x)

    for method in ("velocity-verlet", "implicit-euler", "dop853"):
        pair.set_force(force)
        sim = msim.Sim(pair, integrator=method, t_end=1, h=0.01)
        sim.step(3)
        at, fails[0] = sim.x.copy(), True
        with pytest.raises(Broken, match="the controller"):
            sim.step(5)
        fails[0] = False
        np.testing.assert_array_equal(sim.x, at)
        sim.step(5)
        assert sim.x[0, 0] != at[0, 0]


def test_nan_is_reported(pair: msim.Scene) -> None:
    pair.set_force(lambda t, p, x, v: np.where(p[:, None] == 1, np.nan, x), name="broken")
    sim = msim.Sim(pair, integrator="rk4", h=0.01)
    with pytest.raises(msim.NotFiniteError, match="particle 1: force function 'broken' returned"):
        sim.step()


def test_sims_are_refused_in_functions(pair: msim.Scene) -> None:
    sims = []
    pair.set_force(lambda t, p, x, v: sims[0].x if sims else x)
    sims.append(msim.Sim(pair, integrator="rk4", h=0.01))
    with pytest.raises(msim.ArgumentError, match="a force function must not use a sim"):
        sims[0].step()
    sims.clear()


def test_potentials_and_work(pair: msim.Scene) -> None:
    for potential in (None, lambda p, x: 2 * np.sum(x * x)):
        pair.set_force(lambda t, p, x, v: -4 * x, potential=potential)
        sim = msim.Sim(pair, integrator="dop853", tol=1e-11, t_end=1)
        start = sim.energy
        assert start.gravitational == pytest.approx(2 * 1.1**2 if potential else 0)
        while sim.t < 1:
            sim.step()
        end = sim.energy
        assert end.total - end.work == pytest.approx(start.total, rel=1e-9)
        assert (end.work == 0) == bool(potential)


def test_checkpoints_compare_names(pair: msim.Scene) -> None:
    def spring(t, p, x, v):
        return -x

    pair.set_force(spring)
    saved = msim.Sim(pair, integrator="rk4", h=0.01).dumps()
    pair.set_force(spring, name="other")
    with pytest.raises(msim.ArgumentError, match="the force function is other .* and spring "):
        msim.Sim(pair, integrator="rk4", h=0.01).loads(saved)
    with pytest.raises(msim.UnsupportedError, match="force function 'other' is part of the program"):
        pair.dumps()
    pair.set_force(None)
    assert "springs" in pair.dumps()


def test_functions_outlive_their_scene(pair: msim.Scene) -> None:
    scene = msim.Scene.loads(pair.dumps())
    scene.set_force(lambda t, p, x, v: -x)
    sim = msim.Sim(scene, integrator="rk4", h=0.01)
    copy = sim.clone()
    del scene, sim
    copy.step(10)


def test_threads() -> None:
    scenes = [tree(seed) for seed in range(4)]
    found: dict[int, np.ndarray] = {}

    def work(seed: int) -> None:
        storm = Storm(seed)
        scenes[seed].set_force(storm.force, time=True, velocity=True)
        sim = msim.Sim(scenes[seed], integrator="rk4", h=0.01)
        sim.step(100)
        found[seed] = sim.x.copy()

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    together = dict(found)
    for seed in range(4):
        work(seed)
        np.testing.assert_array_equal(found[seed], together[seed])


@pytest.mark.parametrize("change, sentence", [
    (dict(function=3), "function must be a function; found 3"),
    (dict(jacobian=1), "jacobian must be a function; found 1"),
    (dict(name=5), "name must be a text; found 5"),
    (dict(name=""), "name of the force function is empty"),
    (dict(largest_stiffness=-1), "largest_stiffness is -1"),
    (dict(time=True, potential=lambda p, x: 0), "potential is set, but the force depends on time"),
])
def test_bad_arguments(pair: msim.Scene, change: dict, sentence: str) -> None:
    arguments = {"function": lambda t, p, x, v: x, **change}
    with pytest.raises(msim.ArgumentError, match=sentence):
        pair.set_force(arguments.pop("function"), **arguments)


@pytest.mark.parametrize("function, jacobian, sentence", [
    (lambda t, p, x, v: x[:1], None, "must return an array of shape"),
    (lambda t, p, x, v: "no", None, "force must hold real numbers"),
    (lambda t, p, x, v: x, lambda t, p, x, v: 0, "jacobian must return a pair"),
    (lambda t, p, x, v: x, lambda t, p, x, v: (x, 0), r"df/dx must be a number, or have the shape"),
])
def test_bad_results(pair: msim.Scene, function, jacobian, sentence: str) -> None:
    pair.set_force(function, jacobian=jacobian)
    sim = msim.Sim(pair, integrator="implicit-euler", h=0.01)
    with pytest.raises(msim.ArgumentError, match=sentence):
        sim.step()
