"""tools/peers: systems that msim is compared with compute its model, by methods of their order."""
import importlib
import sys

import msim
import numpy as np
import pytest
from conftest import ROOT

pytest.importorskip("scipy")
sys.path.append(str(ROOT / "tools/peers"))
import scenes  # noqa: E402
from methods import METHODS, Splitting  # noqa: E402


def run(acceleration, method, x, v, h, steps):
    """The method as its description has it."""
    if isinstance(method, Splitting):
        v = v + method.start * h * acceleration(x)
        for _ in range(steps):
            for kick, drift in zip(method.kick, method.drift, strict=True):
                v = v + kick * h * acceleration(x)
                x = x + drift * h * v
        return x
    for _ in range(steps):
        k = []
        for c, row in zip(method.c, method.AA, strict=True):
            shift = sum((a * k_j for a, k_j in zip(row, k)), 0 * x)
            k.append(acceleration(x + c * h * v + h * h * shift))
        x = x + h * v + h * h * sum(b * k_j for b, k_j in zip(method.bx, k, strict=True))
        v = v + h * sum(b * k_j for b, k_j in zip(method.bv, k, strict=True))
    return x


@pytest.mark.parametrize("name", METHODS)
def test_order(name):
    """On pendulums with several amplitudes."""
    def end(method, steps):
        x = np.linspace(0.5, 2, 9)
        return run(lambda x: -np.sin(x), METHODS[method], x, 0.3, 4 / steps, steps)

    def error(steps):
        return np.linalg.norm(end(name, steps) - exact)
    exact = end("DOP853", 200)
    steps = 8 if METHODS[name].order > 4 else 40
    order = np.log2(error(steps) / error(2 * steps))
    # the terms of order 8 of DOP853 are small beside those of order 9
    assert -0.2 < order - METHODS[name].order < 0.7


@pytest.fixture(scope="module", params=scenes.SCENES)
def moved(request):
    """A scene, in which particles are moved at random, and the accelerations by msim."""
    scene = scenes.build(request.param, 7)
    noise = 0.02 * np.random.default_rng(1).normal(size=scene.x.shape)
    x = scene.x + noise * ~scene.pinned[:, None]
    force = msim.Sim(scene, integrator="velocity-verlet", h=1e-4).force(x)
    return scene, x, force / scene.mass[:, None] * ~scene.pinned[:, None]


def peer_of(name, scene, dtype):
    """A peer, if its package is there."""
    package = name.split()[0]
    pytest.importorskip(package, reason=f"{package} (tools/peers/requirements.txt) is missing")
    more = {"numba grid": [scenes.grid_of(scene)], "scipy numba": [True]}.get(name, [])
    if name == "scipy numba":
        pytest.importorskip("numba")
    module = importlib.import_module(package + "_peer")
    return module.Peer(scenes.model_of(scene), dtype, *more)


@pytest.mark.parametrize("name", ["scipy", "scipy numba", "numba", "numba grid", "taichi", "warp",
                                  "jax"])
def test_accelerations(name, moved):
    scene, x, expected = moved
    # of a particle: 12 springs, whose terms k L/m cancel
    terms = 12 * (scenes.model_of(scene).kl.max() + 10)
    for dtype in (np.float64, np.float32)[:1 if name.startswith("scipy") else 2]:
        found = peer_of(name, scene, dtype).acceleration(x)
        assert np.abs(found - expected).max() < 8 * np.finfo(dtype).eps * terms


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["numba", "numba grid", "taichi", "warp", "jax"])
def test_runs(name, method):
    """From the state of the scene, with the steps of the description above."""
    scene = scenes.build("trampoline", 7)
    peers = {dtype: peer_of(name, scene, dtype) for dtype in (np.float64, np.float32)}
    with_numpy = peer_of("scipy", scene, np.float64)
    h = 0.2 / np.sqrt(scenes.model_of(scene).kw.max())
    expected = run(with_numpy.acceleration, METHODS[method], scene.x, scene.v, h, 20)
    for dtype, peer in peers.items():
        x, seconds = peer.run(METHODS[method], h, 20)
        assert seconds >= 0
        assert np.abs(x - expected).max() < 400 * np.finfo(dtype).eps


def test_solvers():
    """scipy_peer: DOP853 with an error control of 1e-10, against dop853 of msim."""
    scene = scenes.build("folding", 7)
    x, _ = peer_of("scipy", scene, np.float64).run("DOP853", 1e-10, 0.05)
    sim = msim.Sim(scene, integrator="dop853", tol=1e-12, t_end=0.05)
    assert np.abs(x - sim.run().x[-1]).max() < 1e-8
