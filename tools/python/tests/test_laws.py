"""Laws of springs: Scene.add_law and set_law."""
import msim
import numpy as np
import pytest


def net(seed: int) -> tuple[msim.Scene, dict[str, int]]:
    rng = np.random.default_rng(seed)
    n, m = 30, 120
    scene = msim.Scene()
    scene.add_particles(rng.uniform(size=(n, 3)), 0.5)
    i = rng.integers(n, size=m)
    j = (i + rng.integers(1, n, size=m)) % n
    scene.add_springs(np.stack([i, j], axis=1), rng.uniform(10, 50, m), rng.uniform(0, 1, m))
    laws = {"linear": 0, "tension": scene.add_law("tension"),
            "compression": scene.add_law("compression"),
            "dead_band": scene.add_law("dead_band", half_width=0.1),
            "polynomial": scene.add_law("polynomial", coefficients=[1, -0.5, 3], limit=0.4),
            "table": scene.add_law("table", stretch=[-1, 0, 2], force=[-20, 0, 40])}
    assert list(laws.values()) == [0, 1, 2, 3, 4, 5]
    for number in laws.values():
        scene.set_law(np.arange(number, m, len(laws)), number)
    return scene, laws


def forces(scene: msim.Scene) -> np.ndarray:
    """By formulas written out; the table is linear, as its points are."""
    d = scene.x[scene.ij[:, 1]] - scene.x[scene.ij[:, 0]]
    length = np.linalg.norm(d, axis=1)
    e, k, law = length - scene.rest, scene.k, scene.law
    c = np.clip(e, -0.4, 0.4)
    p, slope = c - 0.5 * c**2 + 3 * c**3, 1 - c + 9 * c**2
    f = np.choose(law, [k * e, k * np.maximum(e, 0), k * np.minimum(e, 0),
                        k * (e - np.clip(e, -0.1, 0.1)), k * (p + slope * (e - c)), 20 * e])
    pull = (f / length)[:, None] * d
    total = np.zeros_like(scene.x)
    np.add.at(total, scene.ij[:, 0], pull)
    np.add.at(total, scene.ij[:, 1], -pull)
    return total


@pytest.mark.parametrize("seed", range(100))
def test_forces_of_random_nets(seed: int) -> None:
    scene, _ = net(seed)
    h = 1e-3
    sim = msim.Sim(scene, integrator="symplectic-euler", h=h)
    sim.step()
    wanted = forces(scene)
    np.testing.assert_allclose(sim.v * 0.5 / h, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())


def test_laws_survive_json_and_pickles() -> None:
    scene, laws = net(0)
    again = msim.Scene.loads(scene.dumps())
    assert np.array_equal(again.law, scene.law)
    assert again.add_law("tension") == len(laws)


def test_scenes_without_laws_have_law_0() -> None:
    scene = msim.Scene()
    scene.add_rope(4, (0, 0, 0), (1, 0, 0), mass=1, k=10)
    assert scene.law.tolist() == [0, 0, 0]


def test_bad_laws_are_refused() -> None:
    scene, _ = net(1)
    with pytest.raises(msim.ArgumentError, match="type is 'tensoin'"):
        scene.add_law("tensoin")
    with pytest.raises(msim.ArgumentError, match="same length"):
        scene.add_law("table", stretch=[0, 1], force=[1])
    with pytest.raises(msim.Error, match="half_width is set"):
        scene.add_law("tension", half_width=1)
    with pytest.raises(msim.Error, match="law is 9"):
        scene.set_law([0], 9)
