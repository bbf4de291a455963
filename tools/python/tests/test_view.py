"""Pictures: the page of a notebook and the window of PyVista."""
import builtins
import importlib.util
import sys

import msim
import msim._view
import pytest


def sim_of(scene):
    return msim.Sim(scene, integrator="velocity-verlet", h=1e-3, t_end=0.05)


def test_show_displays_the_page_in_a_frame(cloth):
    pytest.importorskip("IPython")
    if "html" not in {recorder.name for recorder in msim.recorders()}:
        pytest.skip("there is no recorder for .html")
    shown = sim_of(cloth).show(height=300)._repr_html_()
    assert shown.startswith('<iframe srcdoc="') and "&lt;html" in shown
    assert 'height="300"' in shown


def test_show_frames_whatever_page_there_is(cloth, monkeypatch):
    pytest.importorskip("IPython")
    monkeypatch.setattr(msim._view, "page", lambda sim: '<html lang="en"></html>')
    shown = sim_of(cloth).show()._repr_html_()
    assert '<iframe srcdoc="&lt;html lang=&quot;en&quot;&gt;&lt;/html&gt;"' in shown


def test_show_says_what_is_missing(cloth):
    pytest.importorskip("IPython")
    if "html" in {recorder.name for recorder in msim.recorders()}:
        pytest.skip("there is a recorder for .html")
    with pytest.raises(msim.UnsupportedError, match=".html"):
        sim_of(cloth).show()


def without(monkeypatch, *modules):
    real = builtins.__import__

    def refuse(name, *arguments, **keywords):
        if name.split(".")[0] in modules:
            raise ImportError(name)
        return real(name, *arguments, **keywords)

    for module in modules:
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setattr(builtins, "__import__", refuse)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)


@pytest.mark.parametrize("module, call", [
    ("pyvista", lambda sim, path: msim.view(path)),
    ("h5py", lambda sim, path: msim.Trajectory(path.with_suffix(".vtkhdf"))),
    ("tqdm", lambda sim, path: next(sim.frames(progress=True))),
    ("IPython", lambda sim, path: sim.show())])
def test_missing_packages_are_named(monkeypatch, tmp_path, cloth, module, call):
    sim = sim_of(cloth)
    sim.run(out=tmp_path / "run.csv")
    (tmp_path / "run.vtkhdf").touch()
    without(monkeypatch, module)
    with pytest.raises(ImportError, match="pip install"):
        call(sim_of(cloth), tmp_path / "run.csv")


@pytest.mark.parametrize("extension", [".csv", ".vtkhdf"])
def test_view_shows_surfaces(tmp_path, cloth, extension):
    pyvista = pytest.importorskip("pyvista")
    if extension == ".vtkhdf":
        pytest.importorskip("h5py")
    path = tmp_path / f"run{extension}"
    sim_of(cloth).run(out=path)
    mesh = msim._view._mesh(pyvista, msim.Trajectory(path), -1)
    assert mesh.n_points == 64
    assert mesh.n_cells == (98 if extension == ".vtkhdf" else 64)
