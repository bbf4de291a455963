"""One run of a sweep, in a worker: it continues where it was interrupted, and is run only once."""
from __future__ import annotations

import contextlib
import copy
import hashlib
import json
import math
import os
import re
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import _options
from ._core import version
from ._errors import ArgumentError, ArgumentTypeError, Error, FileError, NumericalError, Status
from ._result import Energy, Frame, Result
from ._scene import Scene, _jsonable
from ._sim import Sim

Sample = dict[str, Any]
Row = dict[str, Any]
Measure = Callable[[Sim, Result], Mapping[str, object]]

# of a run that could not be made
EMPTY: Row = {"status": "", "message": "", "t": math.nan, "steps": 0, "kinetic": math.nan,
              "elastic": math.nan, "gravitational": math.nan, "total": math.nan,
              "work": math.nan, "cpu_s": math.nan}
_PATH = re.compile(r"[^.\[\]]+(\[\d+\])*(\.[^.\[\]]+(\[\d+\])*)*")
_PART = re.compile(r"[^.\[\]]+")


@dataclass(frozen=True)
class Job:
    """What all runs of a sweep have in common; workers get it pickled."""

    scene: str | Callable[[Sample], Scene] # JSON text, or a function
    options: dict[str, object]
    measure: Measure | None
    measure_source: str
    folder: str | None
    checkpoint_interval: float


# -- scenes of samples ----------------------------------------------------------------------------

def is_option(name: str) -> bool:
    return name in _options._BY_KEYWORD


def substitute(tree: dict[str, Any], name: str, value: object) -> None:
    """Set the value at a path such as objects[0].k.shear in the tree of a scene file."""
    if not _PATH.fullmatch(name):
        raise ArgumentError(f"'{name}' is no option and no path in a scene, as objects[0].k is")
    parts: list[str | int] = [int(part) if part.isdigit() else part
                              for part in _PART.findall(name)]
    at: Any = tree
    for done, part in enumerate(parts):
        here = f"'{_joined(parts[:done])}' of the scene" if done else "the scene"
        last = done == len(parts) - 1
        if isinstance(part, int) and isinstance(at, list):
            if part >= len(at):
                raise ArgumentError(f"there is no '{name}': {here} has {len(at)} entries")
        elif not (isinstance(part, str) and isinstance(at, dict)) or part not in at and not last:
            keys = f"; it has {', '.join(at)}" if isinstance(at, dict) else ""
            raise ArgumentError(f"there is no '{name}': {here} has no '{part}'{keys}")
        if last:
            at[part] = value
        else:
            at = at[part]


def _joined(parts: list[str | int]) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts)[1:]


def _scene_of(job: Job, sample: Sample) -> Scene:
    if isinstance(job.scene, str):
        paths = {name: value for name, value in sample.items() if not is_option(name)}
        if not paths:
            return Scene.loads(job.scene)
        tree = json.loads(job.scene)
        for name, value in paths.items():
            substitute(tree, name, value)
        return Scene.loads(json.dumps(tree, default=_jsonable))
    scene = job.scene(copy.copy(sample))
    if not isinstance(scene, Scene):
        raise ArgumentTypeError("the function scene must return an msim.Scene; found "
                                f"{type(scene).__name__}")
    return scene


# -- files ----------------------------------------------------------------------------------------

def _name_of(job: Job, scene: Scene, options: dict[str, object]) -> str:
    """A name for the files of a run, by everything that its row depends on."""
    what = [version(), scene.dumps(), sorted(_options.as_text(options)), job.measure_source]
    return hashlib.sha256(json.dumps(what).encode()).hexdigest()[:32]


def _write(path: str, content: Callable[[Any], object]) -> None:
    """Replace a file at once: it has the old content or the new one, whatever happens."""
    part = f"{path}.{os.getpid()}.part"
    try:
        with open(part, "wb") as file:
            content(file)
        os.replace(part, path)
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error


@dataclass
class _Progress:
    """The frames of a run until now, and the processor time that it took."""

    keep_frames: bool
    frames: list[Frame] = field(default_factory=list)
    energies: list[Energy] = field(default_factory=list)
    cpu_s: float = 0.0

    def add(self, sim: Sim) -> None:
        """The present state; a sim that continues repeats its last frame."""
        if self.keep_frames and not (self.frames and sim.nsteps <= self.frames[-1].step):
            self.frames.append(sim.frame)
            self.energies.append(sim.energy)

    def save(self, path: str, sim: Sim) -> None:
        arrays: dict[str, Any] = {"checkpoint": np.frombuffer(sim.dumps(), np.uint8), "cpu_s": self.cpu_s}
        if self.frames:
            step, t, x, v = zip(*self.frames)
            arrays |= {"step": np.array(step), "t": np.array(t), "x": np.array(x),
                       "v": np.array(v), "energies": np.array([np.hstack(e)
                                                               for e in self.energies])}
        _write(path, lambda file: np.savez(file, **arrays))

    def load(self, path: str, sim: Sim) -> None:
        """Continue from the file; without one, or from one that does not fit, from the start."""
        try:
            with np.load(path) as file:
                arrays = dict(file)
            sim.loads(arrays["checkpoint"].tobytes())
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, Error):
            return
        self.cpu_s = float(arrays["cpu_s"])
        if "step" in arrays:
            self.frames = [Frame(int(step), float(t), x, v) for step, t, x, v in
                           zip(*(arrays[name] for name in ("step", "t", "x", "v")))]
            self.energies = [Energy(float(e[0]), float(e[1]), float(e[2]), float(e[3]), e[4:7],
                                    e[7:10], float(e[10])) for e in arrays["energies"]]


# -- runs -----------------------------------------------------------------------------------------

def _failed(status: str, message: str) -> Row:
    return {**EMPTY, "status": status, "message": message}


def row_of_error(error: BaseException) -> Row:
    status = error.status.name if isinstance(error, Error) else type(error).__name__
    return _failed(status, str(error) or type(error).__name__)


def _values(measured: object) -> Row:
    """The columns that the function `measure` adds."""
    if not isinstance(measured, Mapping):
        raise ArgumentTypeError("the function measure must return a dict of numbers and texts; "
                                f"found {type(measured).__name__}")
    row = {}
    for name, value in measured.items():
        plain = value.item() if isinstance(value, (np.generic, np.ndarray)) and np.size(value) == 1 \
            else value
        if not isinstance(name, str) or not isinstance(plain, (bool, int, float, str, type(None))):
            raise ArgumentTypeError("the function measure must return a dict of numbers and texts; "
                                    f"found {name!r}: {type(value).__name__}")
        if name in EMPTY:
            raise ArgumentError(f"the function measure returns '{name}', which the table has "
                                "already; give it another name")
        row[name] = plain
    return row


class _Run:
    """A run of the sample; `files`: its row and its checkpoint, without extension."""

    def __init__(self, job: Job, sample: Sample) -> None:
        self._job = job
        options = {name: value for name, value in sample.items() if is_option(name)}
        self._options = {"threads": 1, **job.options, **options}
        self._scene = _scene_of(job, sample)
        self._files = None if job.folder is None else os.path.join(
            job.folder, _name_of(job, self._scene, self._options))

    def row(self) -> Row:
        if self._files is None:
            return self._made(None)
        try:
            with open(self._files + ".json", encoding="utf-8") as file:
                row: Row = json.load(file)
                return row
        except (OSError, ValueError):
            pass
        made = self._made(self._files + ".npz")
        _write(self._files + ".json", lambda file: file.write(json.dumps(made).encode()))
        with contextlib.suppress(OSError):
            os.unlink(self._files + ".npz")
        return made

    def _made(self, checkpoint: str | None) -> Row:
        sim = Sim(self._scene, **self._options)
        progress = _Progress(self._job.measure is not None)
        if checkpoint is not None:
            progress.load(checkpoint, sim)
        clock = time.thread_time if sim.plan.threads == 1 else time.process_time
        start = clock() - progress.cpu_s
        due = time.monotonic() + self._job.checkpoint_interval
        status, message = Status.OK, "the run reached its end"
        try:
            for _ in sim.frames():
                progress.add(sim)
                progress.cpu_s = clock() - start
                if checkpoint is not None and time.monotonic() >= due:
                    due = self._save(progress, checkpoint, sim)
        except NumericalError as event:
            status, message = event.status, str(event)
        progress.cpu_s = clock() - start
        return self._measured(sim, progress, status, message)

    def _save(self, progress: _Progress, checkpoint: str, sim: Sim) -> float:
        """Write a checkpoint, and return when the next one is due: writing takes 5 % at most,
        unless each frame is asked for."""
        start = time.monotonic()
        progress.save(checkpoint, sim)
        end = time.monotonic()
        interval = self._job.checkpoint_interval
        return end + (max(interval, 20 * (end - start)) if interval > 0 else 0)

    def _measured(self, sim: Sim, progress: _Progress, status: Status, message: str) -> Row:
        energy = sim.energy
        row = {**EMPTY, "status": status.name, "message": message, "t": sim.t, "steps": sim.nsteps,
               "kinetic": energy.kinetic, "elastic": energy.elastic,
               "gravitational": energy.gravitational, "total": energy.total, "work": energy.work,
               "cpu_s": progress.cpu_s}
        if self._job.measure is not None and status == Status.OK:
            result = Result(progress.frames, progress.energies, len(sim), status, message,
                            sim.stats)
            row |= _values(self._job.measure(sim, result))
        return row


def run(job: Job, sample: Sample) -> Row:
    """The row of a sample; what goes wrong is said in it."""
    try:
        return _Run(job, sample).row()
    except Exception as error:
        return row_of_error(error)
