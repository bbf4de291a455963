"""The notebook and the Python of the pages run as they stand, and measure what they say."""
import ast
import json
import re
import warnings

import msim
import numpy as np
import pytest
from conftest import ROOT

NOTEBOOK = ROOT / "docs/notebooks/exercises.ipynb"


def cells():
    return json.loads(NOTEBOOK.read_text())["cells"]


@pytest.fixture(scope="module")
def exercises():
    """The names that the notebook has defined at its end, and its figures."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    names = {"__name__": "exercises"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")       # of explicit Euler and Heun, and of h omega = 2.1
        for cell in cells():
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), str(NOTEBOOK), "exec"), names)
    names["figures"] = len(plt.get_fignums())
    plt.close("all")
    return names


def test_the_notebook_stores_no_results():
    assert all(not cell.get("outputs") and cell.get("execution_count") is None for cell in cells())
    assert "/home/" not in NOTEBOOK.read_text()


def test_methods_by_hand_are_those_of_msim(exercises):
    assert set(exercises["difference"]) == set(exercises["METHODS"])
    assert max(exercises["difference"].values()) < 1e-12


def test_orders(exercises):
    for name, order in exercises["METHODS"].items():
        assert exercises["orders"][name] == pytest.approx(order, abs=0.1), name


def test_energies(exercises):
    growth = exercises["growth"]
    for name, predicted in exercises["predicted"].items():
        assert growth[name] == pytest.approx(predicted, rel=1e-6), name
    verlet = exercises["energies"]["verlet"]
    band = exercises["h"] * exercises["omega"]
    assert np.abs(verlet - 1).max() < band


def test_the_limit_of_stability(exercises):
    reach = exercises["reach"]
    assert reach["verlet", 1.9] < 10 and reach["verlet", 2.1] > 1e6
    assert reach["implicit-euler", 1.9] < 1 and reach["implicit-euler", 2.1] < 1
    assert exercises["h_auto"] == pytest.approx(exercises["limit"], rel=1e-3)


def test_the_jacobian(exercises):
    assert exercises["jacobian_error"] < 1e-8


def test_the_plane(exercises):
    heights, e = exercises["heights"], exercises["e"]
    assert heights["event"] == pytest.approx(e**2, abs=1e-3)
    assert 0 < heights["reflect"] - e**2 < (1 + e) * np.sqrt(2 * 9.81) * 0.01   # of order h
    assert exercises["figures"] == 3


def test_the_snippet_of_the_first_page(capsys):
    """README.md of the project"""
    snippets = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    assert len(snippets) == 1
    exec(snippets[0], {})
    t, lowest = capsys.readouterr().out.split(maxsplit=1)
    assert float(t) == 1 and len(lowest.strip("[] \n").split()) == 3


def test_the_snippet_on_trajectories(tmp_path, monkeypatch, capsys):
    """docs/trajectory.md reads what a sim has recorded."""
    pytest.importorskip("h5py")
    if "hdf5" not in {recorder.name for recorder in msim.recorders() if recorder.available}:
        pytest.skip("no recorder for .vtkhdf")
    monkeypatch.chdir(tmp_path)
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_cloth((4, 4), (0, 0, 1), (1, 0, 0), (0, 1, 0), mass=1, k=100, pinned="corners")
    result = msim.run(scene, integrator="velocity-verlet", h=1e-3, t_end=0.1, fps=50,
                      out="run.vtkhdf")
    names = {}
    snippet, = re.findall(r"```python\n(.*?)```", (ROOT / "docs/trajectory.md").read_text(), re.S)
    exec(snippet, names)
    np.testing.assert_array_equal(names["x"], result.x)
    np.testing.assert_array_equal(names["ij"], scene.ij)
    np.testing.assert_allclose(names["total"], result.energy.total, rtol=1e-12)
    assert "6 frames of 16 particles" in capsys.readouterr().out


def test_the_snippet_on_scenes_in_hdf5(tmp_path, monkeypatch):
    """docs/scene_format.md writes a scene that msim loads."""
    h5py = pytest.importorskip("h5py")
    if "hdf5" not in {importer.name for importer in msim.importers() if importer.available}:
        pytest.skip("no importer for .h5")
    monkeypatch.chdir(tmp_path)
    snippet, = re.findall(r"```python\n(.*?)```", (ROOT / "docs/scene_format.md").read_text(), re.S)
    exec(snippet, {"h5py": h5py, "numpy": np, "x": np.eye(3), "ij": [[0, 1], [1, 2]]})
    scene = msim.Scene.load("net.h5")
    np.testing.assert_array_equal(scene.x, np.eye(3))
    assert msim.Sim(scene).plan.t_end == 2 and len(scene.planes) == 1


def test_answers_to_questions():
    """Calls that docs/how_do_i.md names exist."""
    text = (ROOT / "docs/how_do_i.md").read_text()
    calls = re.findall(r"`(sim|scene)\.(\w+)(\([^`]*\))?`", text)
    assert len(calls) >= 8
    for owner, name, arguments in calls:
        assert hasattr(msim.Sim if owner == "sim" else msim.Scene, name), name
        ast.parse(f"f{arguments}".replace("...", "0"))
    for name in re.findall(r"`(msim_\w+)`", text):
        headers = "".join(path.read_text() for path in (ROOT / "include/msim").glob("*.h"))
        assert name in headers or name in ("msim_cli",), name
