"""Pictures: a page in a notebook, and a window of PyVista."""
from __future__ import annotations

import html
import importlib.util
import os
import tempfile
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _options
from ._arrays import Path
from ._errors import UnsupportedError
from ._trajectory import Trajectory

if TYPE_CHECKING:
    from ._sim import Sim


def page(sim: Sim) -> str:
    """Run to the end, recorded as one HTML page."""
    if "html" not in {recorder.name for recorder in _options.recorders()}:
        raise UnsupportedError("this msim has no recorder for .html; record .vtkhdf and open it "
                               "with msim.view or ParaView")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "run.html")
        with sim.recorder(path) as recorder:
            for _ in sim.frames():
                recorder.write()
        with open(path, encoding="utf-8") as file:
            return file.read()


class Page:
    """What a notebook displays in a frame of its own, in which the page's scripts may run."""

    def __init__(self, text: str, height: int) -> None:
        self.text = text
        self.height = height

    def _repr_html_(self) -> str:
        return (f'<iframe srcdoc="{html.escape(self.text)}" width="100%" height="{self.height}" '
                'style="border:0" sandbox="allow-scripts"></iframe>')


def show(sim: Sim, height: int) -> Page:
    if importlib.util.find_spec("IPython") is None:
        raise ImportError("show() needs a notebook: pip install notebook; elsewhere record the "
                          "run: sim.run(out=\"run.html\")")
    return Page(page(sim), height)


def view(trajectory: Trajectory | Path, *, frame: int = -1, **options: Any) -> Any:
    """Show one frame in a window of PyVista, as springs or faces; returns the plotter.

    options: those of pyvista.Plotter.
    """
    try:
        import pyvista
    except ImportError as error:
        raise ImportError("view() needs PyVista: pip install pyvista") from error
    run = trajectory if isinstance(trajectory, Trajectory) else Trajectory(trajectory)
    if len(run) == 0:
        raise UnsupportedError(f"{run.path} has no frames")
    plotter = pyvista.Plotter(**options)
    plotter.add_mesh(_mesh(pyvista, run, frame), color="lightsteelblue", line_width=2)
    plotter.show()
    return plotter


def _mesh(pyvista: Any, run: Trajectory, frame: int) -> Any:
    x = run.x(frame)
    if not run.has_scene:
        return pyvista.PolyData(x)
    faces, springs = run.scene.faces, run.scene.ij
    if len(faces):
        return pyvista.PolyData(x, faces=_cells(faces))
    return pyvista.PolyData(x, lines=_cells(springs)) if len(springs) else pyvista.PolyData(x)


def _cells(corners: Any) -> Any:
    """Each row with its length before it, as VTK has it."""
    return np.column_stack([np.full(len(corners), corners.shape[1]), corners]).ravel()
