"""Trajectories of msim: files .vtkhdf (with h5py) and .csv, read frame by frame."""
from __future__ import annotations

import json
import operator
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from . import _arrays
from ._arrays import Doubles, Ints, Path
from ._errors import ArgumentError, FileError, UnsupportedError
from ._result import Energies, Frame
from ._scene import Scene

if TYPE_CHECKING:
    from ._sim import Sim


class _Reader(Protocol):
    times: Doubles
    steps: np.ndarray[Any, np.dtype[np.int64]]
    n: int
    planned: int # frames; an interrupted run has fewer

    def x(self, frame: int) -> Doubles: ...
    def v(self, frame: int) -> Doubles: ...
    def scene(self) -> Scene | None: ...
    def close(self) -> None: ...


class _Csv:
    """step,t,particle,x,y,z,vx,vy,vz: n lines a frame, of which the last may be incomplete."""

    TITLE = "step,t,particle,x,y,z,vx,vy,vz"

    def __init__(self, path: str) -> None:
        try:
            with open(path, encoding="ascii") as file:
                title = file.readline().rstrip("\n")
                lines = file.readlines()
        except UnicodeDecodeError as error:
            raise ArgumentError(f"{path}: this is no trajectory of msim") from error
        if title != self.TITLE:
            raise ArgumentError(f"{path}: this is no trajectory of msim: its first line must be "
                                f"'{self.TITLE}'")
        if lines and not lines[-1].endswith("\n"):
            lines.pop()
        try:
            table = np.loadtxt(lines, delimiter=",", ndmin=2) if lines else np.zeros((0, 9))
        except ValueError as error:
            raise ArgumentError(f"{path}: {error}") from error
        self.n = int(table[:, 2].max()) + 1 if len(table) else 0
        count = len(table) // self.n if self.n else 0
        self._table = table[:count * self.n].reshape(count, self.n, 9)
        self.times: Doubles = self._table[:, 0, 1] if count else np.zeros(0)
        self.steps = (self._table[:, 0, 0] if count else np.zeros(0)).astype(np.int64)
        self.planned = count

    def x(self, frame: int) -> Doubles:
        return self._table[frame, :, 3:6].copy()

    def v(self, frame: int) -> Doubles:
        return self._table[frame, :, 6:9].copy()

    def scene(self) -> Scene | None:
        return None

    def close(self) -> None:
        pass


class _Vtkhdf:
    """The layout is described in backends/hdf5/layout.h. Frames beyond the last are planned only."""

    def __init__(self, path: str) -> None:
        try:
            import h5py
        except ImportError as error:
            raise ImportError("reading .vtkhdf files needs h5py: pip install h5py") from error
        if not h5py.is_hdf5(path):
            raise ArgumentError(f"{path}: this is no trajectory of msim")
        try:
            self._file = h5py.File(path, "r", locking=False)
            self._root = self._file["VTKHDF"]
            self._frames = self._file["msim/frames"]
        except KeyError as error:
            raise ArgumentError(f"{path}: this is no trajectory of msim") from error
        committed = np.asarray(self._root["Steps/PartOffsets"]) == 0
        count = len(committed) if committed.all() else int(committed.argmin())
        self.planned = len(committed)
        self.times: Doubles = self._frames["time"][:count]
        self.steps = self._frames["step"][:count]
        self._offsets = self._root["Steps/PointOffsets"][:count]
        self.n = int(self._root["NumberOfPoints"][0])

    def _rows(self, name: str, frame: int) -> Doubles:
        first = int(self._offsets[frame])
        rows: Doubles = self._root[name][first:first + self.n]
        return rows

    def x(self, frame: int) -> Doubles:
        return self._rows("Points", frame)

    def v(self, frame: int) -> Doubles:
        return self._rows("PointData/Velocity", frame)

    def scene(self) -> Scene | None:
        return Scene.loads(np.asarray(self._file["msim/scene"]).tobytes())

    def close(self) -> None:
        self._file.close()


_READERS: dict[str, Callable[[str], _Reader]] = {".csv": _Csv, ".vtkhdf": _Vtkhdf}


class Trajectory:
    """A recorded run: Trajectory("run.vtkhdf"); len(), indexing and iteration give its frames.

    Positions and velocities of .vtkhdf files are read when they are asked for.
    """

    def __init__(self, path: Path) -> None:
        self.path = _arrays.path(path)
        extension = os.path.splitext(self.path)[1]
        if extension not in _READERS:
            raise UnsupportedError(f"{self.path}: a trajectory that can be read ends in "
                                   f"{' or '.join(_READERS)}")
        try:
            with open(self.path, "rb"):
                self._reader = _READERS[extension](self.path)
        except OSError as error:
            raise FileError(f"{self.path}: {error.strerror or error}") from error

    @property
    def times(self) -> Doubles:
        """Times of the frames, s."""
        return self._reader.times

    @property
    def steps(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Numbers of the steps of the frames."""
        return self._reader.steps

    @property
    def n(self) -> int:
        """The number of particles."""
        return self._reader.n

    def x(self, frame: int) -> Doubles:
        """Positions of a frame, (n, 3), m."""
        return self._reader.x(self._index(frame))

    def v(self, frame: int) -> Doubles:
        """Velocities of a frame, (n, 3), m/s."""
        return self._reader.v(self._index(frame))

    @property
    def has_scene(self) -> bool:
        """Whether the file holds the scene; a .csv file does not."""
        return not isinstance(self._reader, _Csv)

    @cached_property
    def scene(self) -> Scene:
        """The scene of the run."""
        scene = self._reader.scene()
        if scene is None:
            raise UnsupportedError(f"{self.path}: a .csv file holds no scene; record .vtkhdf")
        return scene

    def strain(self, frame: int) -> Doubles:
        """Strain of the springs in a frame, (nsprings,): (l - L) / L of one of length l and rest
        length L, 0 where L = 0."""
        x, ij, rest = self.x(frame), self.ij, self.scene.rest
        length = np.linalg.norm(x[ij[:, 0]] - x[ij[:, 1]], axis=1)
        strain: Doubles = np.divide(length - rest, rest, out=np.zeros_like(rest), where=rest > 0)
        return strain

    @cached_property
    def energies(self) -> Energies:
        """Energies of all frames, J, computed from the scene."""
        with self._still_sim() as sim:
            parts = [sim.energy[:4] for _ in self._states(sim)]
        return Energies(*np.array(parts).reshape(len(self), 4).T)

    def record(self, path: Path, *, replace: bool = False) -> None:
        """Write the frames to a file of another format: .html, .pvd, .csv, ...

        It has the bytes that the run itself would have recorded. It takes the place of an older
        trajectory of msim; replace: of any file. A .vtkhdf file made in this way cannot be resumed.
        """
        if os.path.exists(path) and os.path.samefile(path, self.path):
            raise ArgumentError(f"{self.path} cannot be recorded into itself; use another name")
        with self._still_sim() as sim, sim.recorder(path, replace=replace) as recorder:
            for _ in self._states(sim):
                recorder.write()

    @contextmanager
    def _still_sim(self) -> Iterator[Sim]:
        """A sim that takes the states of the frames and makes no steps; as many frames are planned
        as in the run."""
        from ._sim import Sim
        tree = json.loads(self.scene.dumps())
        tree.pop("run", None)
        span = float(np.ptp(self.times)) if len(self) else 0.0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore") # the step may be unstable
            yield Sim(Scene.from_dict(tree), integrator="symplectic-euler", watch="off",
                      h=span / (len(self) - 1) if span else 1.0, steps=self._reader.planned - 1)

    def _states(self, sim: Sim) -> Iterator[None]:
        """Set the sim to each frame in turn."""
        for frame in self:
            sim.set_state(frame.x, frame.v, t=frame.t, step=frame.step)
            yield

    @property
    def ij(self) -> Ints:
        """The two particles of each spring."""
        return self.scene.ij

    def close(self) -> None:
        self._reader.close()

    def _index(self, frame: int) -> int:
        try:
            index = operator.index(frame)
        except TypeError as error:
            raise TypeError(f"a frame must be a whole number; found {frame!r}") from error
        if not -len(self) <= index < len(self):
            raise IndexError(f"{self.path} has {len(self)} frames; there is no frame {frame}")
        return index % len(self)

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, frame: int) -> Frame:
        i = self._index(frame)
        return Frame(int(self.steps[i]), float(self.times[i]), self.x(i), self.v(i))

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    def __enter__(self) -> Trajectory:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        span = f", t = {self.times[0]:g} to {self.times[-1]:g} s" if len(self) else ""
        return f"<msim.Trajectory {self.path!r}: {len(self)} frames of {self.n} particles{span}>"
