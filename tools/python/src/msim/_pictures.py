"""Pictures of recorded runs, drawn by matplotlib without a display: a frame, a film, the energies."""
from __future__ import annotations

import importlib
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ._arrays import Doubles
from ._errors import ArgumentError, FileError
from ._trajectory import Trajectory

FILM_RATE = 25 # frames a second
SIZE, DPI = (8.0, 6.0), 120 # inches; pixels an inch
COMPRESSED, UNSTRAINED, STRETCHED = "#1f77ff", "#404040", "#e0201b"


def _require(module: str, user: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.split(".")[0]
        raise ImportError(f"{user} needs {package}: pip install {package}") from error


@contextmanager
def _complete(path: str) -> Iterator[str]:
    """The name of a temporary file, which gets its own once it is complete."""
    stem, extension = os.path.splitext(path)
    part = f"{stem}.part{extension}"
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if os.path.exists(part):
            os.unlink(part)


class _Drawing:
    """A figure that shows one frame after another: springs, coloured by their strain, and the
    particles that have none. The axes cover the frames that are given, the colours 98 % of their
    strains."""

    def __init__(self, run: Trajectory, frames: Sequence[int], user: str) -> None:
        Figure = _require("matplotlib.figure", user).Figure
        lines = _require("mpl_toolkits.mplot3d.art3d", user).Line3DCollection
        colours = _require("matplotlib.colors", user).LinearSegmentedColormap
        self._run = run
        self._ij = run.ij if run.has_scene else np.zeros((0, 2), np.int32)
        self._loose = np.setdiff1d(np.arange(run.n), self._ij)
        self.figure = Figure(SIZE, DPI)
        self._axes = self.figure.add_subplot(projection="3d")
        self._springs = self._axes.add_collection3d(
            lines(np.zeros((len(self._ij), 2, 3)), linewidths=0.8, cmap=colours.from_list(
                "strain", [COMPRESSED, UNSTRAINED, STRETCHED])), autolim=False)
        self._particles, = self._axes.plot([], [], [], "o", markersize=4, color="black")
        self._set_limits(frames)
        if len(self._ij):
            self.figure.colorbar(self._springs, label="strain", shrink=0.6, pad=0.1,
                                 extend="both")

    def _set_limits(self, frames: Sequence[int]) -> None:
        low, high, strain = np.full(3, np.inf), np.full(3, -np.inf), 1e-6
        for frame in frames:
            x = self._run.x(frame)
            low, high = np.fmin(low, x.min(axis=0)), np.fmax(high, x.max(axis=0))
            if len(self._ij):
                strain = max(strain, float(np.quantile(np.abs(self._run.strain(frame)), 0.98)))
        middle, extent = (low + high) / 2, high - low
        extent = np.maximum(extent, 0.05 * extent.max() or 1) # a plane or a point has a size, too
        self._axes.set(**{f"{axis}lim": (middle[i] - extent[i] / 2, middle[i] + extent[i] / 2)
                          for i, axis in enumerate("xyz")},
                       **{f"{axis}label": f"{axis}, m" for axis in "xyz"})
        self._axes.set_box_aspect(extent)
        self._springs.set_clim(-strain, strain)

    def show(self, frame: int) -> None:
        x = self._run.x(frame)
        if len(self._ij):
            self._springs.set_segments(x[self._ij])
            self._springs.set_array(self._run.strain(frame))
        self._particles.set_data_3d(*x[self._loose].T)
        self._axes.set_title(f"t = {self._run.times[frame]:.3f} s")


def write_picture(run: Trajectory, path: str, *, frame: int = -1) -> None:
    """A picture of one frame."""
    frame %= len(run)
    drawing = _Drawing(run, [frame], "--png")
    drawing.show(frame)
    with _complete(path) as part:
        drawing.figure.savefig(part)


def film_frames(times: Doubles, rate: float = FILM_RATE) -> list[int]:
    """The frames of a film in real time: at each of its times the last one that is not later, and
    the last of the run."""
    at = np.arange(int((times[-1] - times[0]) * rate) + 1) / rate
    frames = np.searchsorted(times, times[0] + at * (1 + 1e-9), side="right") - 1
    return [*frames.tolist(), *([] if frames[-1] == len(times) - 1 else [len(times) - 1])]


def _ffmpeg() -> str:
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise ImportError("--mp4 needs ffmpeg: pip install imageio-ffmpeg") from error
    return str(imageio_ffmpeg.get_ffmpeg_exe())


def write_film(run: Trajectory, path: str) -> None:
    """A film of the run in real time (MPEG-4)."""
    animation = _require("matplotlib.animation", "--mp4")
    frames = film_frames(run.times)
    drawing = _Drawing(run, sorted(set(frames)), "--mp4")
    writer = animation.FFMpegWriter(fps=FILM_RATE)
    settings = {"animation.ffmpeg_path": _ffmpeg()}
    try:
        with (_require("matplotlib", "--mp4").rc_context(settings), _complete(path) as part,
              writer.saving(drawing.figure, part, DPI)):
            for frame in frames:
                drawing.show(frame)
                writer.grab_frame()
    except subprocess.CalledProcessError as error:
        raise FileError(f"cannot write {path}: ffmpeg failed with exit status "
                        f"{error.returncode}") from error


def write_energies(run: Trajectory, path: str) -> None:
    """Curves of the energies over time; the extension is one that matplotlib writes."""
    figure = _require("matplotlib.figure", "--energy").Figure(SIZE, DPI, layout="constrained")
    if os.path.splitext(path)[1][1:] not in figure.canvas.get_supported_filetypes():
        raise ArgumentError(f"{path}: matplotlib writes no such pictures; use .png, .svg or .pdf")
    axes = figure.subplots()
    for name, energy in run.energies._asdict().items():
        axes.plot(run.times, energy, label=name)
    axes.set(xlabel="t, s", ylabel="energy, J")
    axes.grid(linestyle=":")
    axes.legend()
    with _complete(path) as part:
        figure.savefig(part)
