"""Equilibrium and natural frequencies."""
import math

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
