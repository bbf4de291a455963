"""Self-contact: a value of scenes, their files and dicts, and a sheet that another one stops."""
import copy
import pickle

import msim
import numpy as np
import pytest


def sheets():
    scene = msim.Scene()
    lower = scene.add_cloth((5, 5), [0, 0, 0], row=[0, 1, 0], column=[1, 0, 0], mass=1,
                            k={"structural": 100, "shear": 100})
    scene.pin(lower)
    upper = scene.add_cloth((4, 4), [0.2, 0.25, 0.3], row=[0, 0.4, 0], column=[0.4, 0, 0], mass=1,
                            k={"structural": 100, "shear": 100})
    return scene, lower, upper


def test_values_and_copies(tmp_path):
    scene, *_ = sheets()
    assert scene.self_contact == (0, 0)
    scene.set_self_contact(0.01, friction=0.3)
    assert scene.self_contact == (0.01, 0.3)
    for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        assert other.self_contact == (0.01, 0.3)
    scene.save(tmp_path / "a.json")
    assert msim.Scene.load(tmp_path / "a.json").self_contact == (0.01, 0.3)
    with pytest.raises(ValueError, match="thickness"):
        scene.set_self_contact(-1)


@pytest.mark.parametrize("thickness", [0, 0.01])
def test_a_sheet_is_stopped(thickness):
    scene, _, upper = sheets()
    scene.set_self_contact(thickness)
    sim = msim.Sim(scene, integrator="velocity-verlet", h=1e-3)
    x, v = np.array(sim.x), np.zeros_like(sim.v)
    v[list(upper), 2] = -20
    sim.set_state(x, v)
    sim.step(100)
    below = sim.x[list(upper), 2] < 0
    assert not below.any() if thickness else below.all()
