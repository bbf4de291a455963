"""Equilibrium and natural frequencies."""
import math
import signal
import threading
import time

import numpy as np
import pytest

import msim


def pendulum(length=2.0, k=1000.0, mass=0.5):
    scene = msim.Scene()
    scene.add_particles([[0, 0, 0], [0.3, 0.2, -length]], mass)
    scene.add_springs([[0, 1]], k, rest=length - mass * 10 / k)
    scene.pin([0])
    scene.gravity = [0, 0, -10]
    return scene


def test_equilibrium_and_modes_of_a_pendulum():
    sim = msim.Sim(pendulum(), integrator="rk4", h=1e-3)
    found = sim.equilibrium(1e-10)
    assert found.force <= 1e-10 and found.is_minimum and found.iterations > 0
    np.testing.assert_allclose(sim.x, [[0, 0, 0], [0, 0, -2]], atol=1e-9)
    assert not sim.v.any()
    modes = sim.modes(3)
    np.testing.assert_allclose(2 * math.pi * modes.frequency,
                               [math.sqrt(5), math.sqrt(5), math.sqrt(2000)], rtol=1e-9)
    assert modes.shape.shape == (3, 2, 3)
    u = modes.shape.reshape(3, 6)
    np.testing.assert_allclose(0.5 * u @ u.T, np.eye(3), atol=1e-9)


def test_errors():
    falling = msim.Scene()
    falling.add_particles([[0, 0, 0]], 1.0)
    falling.gravity = [0, 0, -10]
    sim = msim.Sim(falling, integrator="rk4", h=1e-3)
    with pytest.raises(msim.NotConvergedError, match="a force of 10 N moves"):
        sim.equilibrium(1e-9)
    with pytest.raises(msim.ArgumentError, match="ftol"):
        sim.equilibrium(0)
    with pytest.raises(msim.ArgumentError, match="from 1 to 3"):
        sim.modes(4)
    with pytest.raises(msim.ArgumentError, match="n must be"):
        sim.modes(0)


def hanging_cloth():
    scene = msim.Scene()
    scene.add_cloth((40, 40), (0, 0, 1), (0, 1, 0), (1, 0, 0), mass=1, k=100,
                    pinned="first_corners")
    scene.gravity = [0, 0, -10]
    return msim.Sim(scene, integrator="rk4", h=1e-3)


LONG = {"equilibrium": lambda sim: sim.equilibrium(1e-300, max_iterations=2**31 - 1),
        "modes": lambda sim: sim.modes(200)}


@pytest.mark.parametrize("call", LONG)
def test_ctrl_c_and_other_threads(call):
    """Other threads run meanwhile; the answer comes within 2 s, and the sim stays as it was."""
    sim, turns, ended = hanging_cloth(), [], threading.Event()

    def count():
        while not ended.wait(0.01):
            turns.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    thread = threading.Thread(target=count)
    thread.start()
    threading.Timer(0.5, ended.set).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        LONG[call](sim)
    assert 0.5 <= time.monotonic() - start < 2.5 and len(turns) > 10
    thread.join()
    np.testing.assert_array_equal(sim.x[:, 2], 1)
    sim.step(3)
    assert sim.nsteps == 3


@pytest.mark.parametrize("call", LONG)
def test_stop(call):
    sim = hanging_cloth()
    threading.Timer(0.5, sim.stop).start()
    with pytest.raises(msim.StoppedError, match="stopped on request"):
        LONG[call](sim)
    assert sim.modes(1).frequency[0] == 0


def test_exceptions_of_forces():
    """They reach the caller from the thread that computes."""
    scene = pendulum()

    def fail(t, particles, x, v):
        raise LookupError("no such force")

    scene.set_force(fail)
    sim = msim.Sim(scene, integrator="rk4", h=1e-3)
    with pytest.raises(LookupError, match="no such force"):
        sim.equilibrium(1e-9)
