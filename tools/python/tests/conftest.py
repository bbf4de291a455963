"""Scenes that the tests share."""
from pathlib import Path

import msim
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def pair():
    """Two particles and a stretched spring."""
    scene = msim.Scene()
    scene.add_particles([[0, 0, 0], [1.1, 0, 0]], mass=1)
    scene.add_springs([[0, 1]], k=10, rest=1)
    return scene


@pytest.fixture
def cloth():
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_cloth((8, 8), origin=(0, 0, 1), row=(0, 1, 0), column=(1, 0, 0), mass=0.2, k=200,
                    damping=0.02, pinned="first_corners")
    return scene


@pytest.fixture
def falling():
    """A particle above a plane."""
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_particles([[0, 0, 1]], mass=1)
    scene.add_plane((0, 0, 1), restitution=0.5)
    return scene


def network(seed=0, n=12):
    """Particles at random, each tied to the next three, damped."""
    random = np.random.default_rng(seed)
    scene = msim.Scene(gravity=(0, 0, -9.81), drag=0.1)
    scene.add_particles(random.normal(size=(n, 3)), mass=random.uniform(1, 2, n))
    ij = [(i, (i + j) % n) for i in range(n) for j in (1, 2, 3)]
    scene.add_springs(ij, k=random.uniform(50, 100, len(ij)), rest=random.uniform(0.5, 1, len(ij)),
                      damping=0.3)
    scene.pin(0)
    return scene
