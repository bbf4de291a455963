"""Sims: scenes in motion."""
from __future__ import annotations

import html
import math
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _core, _edits, _options
from ._arrays import Doubles, Path
from ._errors import ArgumentError, ArgumentTypeError, FileError, NumericalError, Status
from ._result import (Energy, Equilibrium, Estimate, Frame, Islands, Modes, Plan, Result,
                      Springs)
from ._scene import Scene

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from ._view import Page

Observer = Callable[["Sim"], object]
_INT64 = 2**63 - 1


# msim_contact
_CONTACT = np.dtype([("particle", np.int32), ("plane", np.int32), ("collider", np.int32),
                     ("reserved", np.int32), ("point", np.float64, 3), ("normal", np.float64, 3),
                     ("impulse", np.float64, 3)])
_CONTACT_FIELDS = ["particle", "plane", "collider", "point", "normal", "impulse"]


class Sim(_core.Sim):
    """A scene in motion: Sim(scene, integrator="velocity-verlet", h=1e-3, t_end=2).

    Options have the names of scene files and C, with "_" for ".", as solver_rtol; msim.options()
    lists them. Those in the scene's `run` are the defaults. A sim is used by one thread at a time.
    """

    def __init__(self, scene: Scene, **options: object) -> None:
        if not isinstance(scene, Scene):
            raise ArgumentError(f"scene must be an msim.Scene; found {type(scene).__name__}")
        super().__init__(scene._core, _options.as_text(options))

    # -- state ------------------------------------------------------------------------------------

    def __bool__(self) -> bool:
        return True

    @property
    def energy(self) -> Energy:
        """Energies and momenta of the present state."""
        return Energy(*self._energy())

    @property
    def islands(self) -> Islands:
        """The island of each particle, and the energies of each island.

        Springs that are not broken join free particles; all pinned ones are one more island, the
        last. The energies add up to those of `energy`.
        """
        return Islands(*self._islands())

    @property
    def stats(self) -> dict[str, float]:
        """Work done and time spent since creation."""
        return self._stats()

    @property
    def plan(self) -> Plan:
        """Decisions made at creation: method, solver, step size, end."""
        return Plan(*self._plan())

    def estimate(self) -> Estimate:
        """The cost of the rest of the run, counted in the first steps of a clone, and never timed."""
        return Estimate(*self._estimate())

    @property
    def h(self) -> float:
        """Step size, s; under error control the next to try. Assign another one, or "auto"."""
        return self.plan.h

    @h.setter
    def h(self, h: float | str) -> None:
        if h != "auto" and (isinstance(h, str) or not 0 < _arrays.number("h", h) < math.inf):
            raise ArgumentError("h must be a finite number > 0 or 'auto'; found "
                                + _arrays.shown(h))
        self._set_step(-1.0 if isinstance(h, str) else float(h))

    @property
    def frame(self) -> Frame:
        """The present state, copied."""
        return Frame(self.nsteps, self.t, self.x.copy(), self.v.copy())

    def step(self, n: int = 1) -> None:
        """Make n steps, without the GIL; Ctrl-C ends them within 50 ms, or after one step."""
        super().step(_arrays.count("n", n, most=_INT64))

    def set_state(self, x: ArrayLike | None = None, v: ArrayLike | None = None, *,
                  t: float | None = None, step: int | None = None,
                  v_half: ArrayLike | None = None) -> None:
        """Continue from another state; what is None stays. The end is planned anew."""
        n = len(self)
        self._set_state(_arrays.rows("x", self.x if x is None else x, n),
                        _arrays.rows("v", self.v if v is None else v, n),
                        None if v_half is None else _arrays.rows("v_half", v_half, n),
                        self.t if t is None else _arrays.number("t", t),
                        self.nsteps if step is None else _arrays.count("step", step, most=_INT64))

    def set_springs(self, k: ArrayLike | None = None, rest: ArrayLike | None = None,
                    damping: ArrayLike | None = None) -> None:
        """Change the springs of this sim: one value each, or one for all; what is None stays."""
        values = [None if given is None else _arrays.each(name, given, self.nsprings, "springs")
                  for name, given in (("k", k), ("rest", rest), ("damping", damping))]
        self._set_springs(*values)

    def set_gravity(self, gravity: ArrayLike) -> None:
        """Change the gravity of this sim, m/s^2: a new run starts from the present state."""
        self._set_gravity(_arrays.vector("gravity", gravity))

    def set_drag(self, drag: float) -> None:
        """Change the drag of this sim, N s/m: a new run starts from the present state."""
        self._set_drag(_arrays.number("drag", drag))

    def set_forces(self, force: ArrayLike | None) -> None:
        """Set constant forces on all particles, (n, 3), N, until they are set again; None: none.

        A new run starts from the present state, with the same end.
        """
        self._set_forces(None if force is None else _arrays.rows("force", force, len(self)))

    def move_pinned(self, particles: ArrayLike, x: ArrayLike, duration: float) -> None:
        """Move pinned particles on straight lines to x, (n, 3), from now on within duration, s."""
        which = _arrays.one_or_more("particles", particles)
        points = _arrays.rows("x", np.atleast_2d(_arrays.doubles("x", x)), len(which))
        self._move_pinned(which, points, _arrays.number("duration", duration))

    def move_collider(self, collider: int, x: ArrayLike, duration: float,
                      rotation: ArrayLike | None = None) -> None:
        """Move a collider on a straight line to x, its center, from now on within duration, s.

        rotation: the rotation vector about x at the end, after the rotation that it has at rest.
        """
        turned = None if rotation is None else _arrays.vector("rotation", rotation)
        self._move_collider(_arrays.count("collider", collider), _arrays.vector("x", x), turned,
                            _arrays.number("duration", duration))

    def set_pinned(self, particles: ArrayLike, pinned: bool = True) -> None:
        """Pin particles where they are, or let them go: an index, or several."""
        which = _arrays.one_or_more("particles", particles)
        self._set_pinned(which, _arrays.flag("pinned", pinned))

    # -- cutting and growing ----------------------------------------------------------------------

    def edit(self, *, remove_particles: ArrayLike = (), remove_springs: ArrayLike = (),
             x: ArrayLike | None = None, mass: ArrayLike | None = None,
             v: ArrayLike | None = None, ij: ArrayLike = (), k: ArrayLike | None = None,
             rest: ArrayLike | None = None, damping: ArrayLike | None = None,
             law: ArrayLike | None = None, ijk: ArrayLike = (),
             angle_k: ArrayLike | None = None, angle_rest: ArrayLike | None = None,
             angle_damping: ArrayLike | None = None) -> None:
        """Remove and add particles and springs at once; a new run starts from the present state.

        All indices are those before; particles at x are numbered on from len(sim), so that ij may
        tie them. Afterwards what stays comes first, in its order, as with numpy.delete. Removed
        particles take their springs, faces and motions along. rest, angle_rest: the present lengths
        and angles, of springs ij and angular springs ijk.
        """
        self._edit(*_edits.arguments(remove_particles, remove_springs, x, mass, v, ij, k, rest,
                                    damping, law, ijk, angle_k, angle_rest, angle_damping))

    def remove_springs(self, springs: ArrayLike) -> None:
        """Remove springs, an index or several: those behind them move up, as with numpy.delete."""
        self.edit(remove_springs=springs)

    def remove_particles(self, particles: ArrayLike) -> None:
        """Remove particles, an index or several, with their springs, faces and motions."""
        self.edit(remove_particles=particles)

    def add_particles(self, x: ArrayLike, mass: ArrayLike, v: ArrayLike | None = None) -> range:
        """Add particles at x, (n, 3), with one mass each, or one for all; v: at rest."""
        first = len(self)
        self.edit(x=x, mass=mass, v=v)
        return range(first, len(self))

    def add_springs(self, ij: ArrayLike, k: ArrayLike, rest: ArrayLike | None = None,
                    damping: ArrayLike | None = None, law: ArrayLike | None = None) -> range:
        """Add springs between the pairs ij, (n, 2); rest: the present length; damping, law: 0."""
        first = self.nsprings
        self.edit(ij=ij, k=k, rest=rest, damping=damping, law=law)
        return range(first, self.nsprings)

    def add_angles(self, ijk: ArrayLike, k: ArrayLike, rest: ArrayLike | None = None,
                   damping: ArrayLike | None = None) -> None:
        """Add angular springs at the vertices j of ijk, (n, 3); rest: the present angle."""
        self.edit(ijk=ijk, angle_k=k, angle_rest=rest, angle_damping=damping)

    def break_springs(self, springs: ArrayLike) -> None:
        """Let springs, an index or several, exert no force any more; they keep their indices."""
        self._break_springs(_arrays.one_or_more("springs", springs))

    @property
    def broken(self) -> NDArray[np.bool_]:
        """True for each spring that is broken, in scene order."""
        return self._broken().astype(bool)

    # -- equilibrium and vibrations ---------------------------------------------------------------

    def equilibrium(self, ftol: float, max_iterations: int = 10000) -> Equilibrium:
        """Move to an equilibrium near the present state, where at most ftol (N) is left.

        It is a local minimum of the energy; damping and drag have no effect, velocities become 0.
        Raises NotConvergedError where none is found, as there is none for a body that falls.
        """
        return Equilibrium(*self._equilibrium(_arrays.number("ftol", ftol),
                                              _arrays.count("max_iterations", max_iterations)))

    def modes(self, n: int = 10) -> Modes:
        """The n lowest frequencies of small undamped vibrations about the present state.

        0: a motion without stiffness; negative: an unstable one. Each shape u has u.M u = 1.
        """
        return Modes(*self._modes(_arrays.count("n", n, least=1)))

    # -- forces and matrices ----------------------------------------------------------------------

    def force(self, x: ArrayLike | None = None, v: ArrayLike | None = None) -> Doubles:
        """Forces on all particles, (n, 3), N, at x and v: the present ones; 0 where pinned."""
        n = len(self)
        return self._force(_arrays.rows("x", self.x if x is None else x, n),
                           _arrays.rows("v", self.v if v is None else v, n))

    @property
    def reactions(self) -> Doubles:
        """The force of its support on each pinned particle, (n, 3), N; 0 for all others."""
        return self._reactions()

    @property
    def contacts(self) -> NDArray[np.void]:
        """What particles touched in the last step, with contacts="on": a structured array.

        Fields: particle, plane and collider (an index, or -1), point, m, normal, and impulse, N s,
        of the whole step on the particle.
        """
        return np.frombuffer(self._contacts(), _CONTACT)[_CONTACT_FIELDS]

    @property
    def springs(self) -> Springs:
        """Tension, elongation and strain of each spring in the present state, in scene order."""
        return Springs(*self._springs())

    def matrix(self) -> csr_array[Any, tuple[int, int]]:
        """A = M - h D - h^2 J of the next implicit step, without rows of pinned particles."""
        from scipy.sparse import csr_array
        values, columns, rows = self._matrix()
        return csr_array((values, columns, rows), shape=(len(rows) - 1,) * 2)

    # -- checkpoints ------------------------------------------------------------------------------

    def save(self, path: Path) -> None:
        """Write a checkpoint to a file."""
        with _opened(path, "wb") as file:
            file.write(self.dumps())

    def load(self, path: Path) -> None:
        """Continue from a checkpoint, in a sim of the same scene and options, bit by bit."""
        with _opened(path, "rb") as file:
            self.loads(file.read())

    def loads(self, data: bytes) -> None:
        """Continue from a checkpoint of a sim of the same scene and options, bit by bit."""
        if not isinstance(data, bytes):
            raise ArgumentTypeError("data must be bytes, as dumps() returns; found "
                                    + _arrays.shown(data))
        super().loads(data)

    def clone(self) -> Sim:
        """An independent sim in the same state, with the same history: both go on bit by bit."""
        copy = Sim.__new__(Sim)
        _core.Sim.__init__(copy, self)
        return copy

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("a Sim cannot be pickled or copied: use Sim.clone(), or pickle its Scene and "
                        "the checkpoint Sim.dumps(), and give the latter to Sim.loads()")

    # -- runs -------------------------------------------------------------------------------------

    def frames(self, *, every: int | None = None, fps: float | None = None,
               t_end: float | None = None, progress: bool = False) -> Iterator[Frame]:
        """Run to the end and yield the first state and each frame; the loop may break.

        The options of the sim say when frames are due and when the run ends. With fixed steps
        `every`, `fps` and `t_end` may say so instead; without any end, `every` and `fps` go on for
        ever. progress: a bar (tqdm, where it is installed).
        """
        plan = self.plan
        if every is None and fps is None and t_end is None:
            frames = self._frames_of_options(plan)
        else:
            frames = self._frames_by_steps(plan, every, fps, t_end)
        return _with_progress(frames, self, plan, t_end) if progress else frames

    def _frames_of_options(self, plan: Plan) -> Iterator[Frame]:
        if plan.t_end < 0:
            raise ArgumentError("the run has no end: give Sim the option t_end or steps, or frames "
                                "and run the argument t_end, every or fps")
        return self._native_frames()

    def _native_frames(self) -> Iterator[Frame]:
        self._forget_frame()
        while self._next_frame():
            yield self.frame

    def _frames_by_steps(self, plan: Plan, every: int | None, fps: float | None,
                         t_end: float | None) -> Iterator[Frame]:
        if plan.tol > 0:
            raise ArgumentError("under error control the times of frames and the end belong to the "
                                "sim: give every, fps and t_end to Sim")
        if every is not None and fps is not None:
            raise ArgumentError("give every or fps, not both")
        if every is not None:
            _arrays.count("every", every, 1)
        if fps is not None and not _arrays.number("fps", fps) > 0:
            raise ArgumentError(f"fps must be > 0; found {fps}")
        left = _steps_left(self, plan, t_end)
        if every is None and fps is None and left is not None:
            every = max(1, -(-left // 200))
        per_frame = float(every) if every is not None else 1 / ((fps or 0) * plan.h)
        return self._step_frames(max(1.0, per_frame), left)

    def _step_frames(self, per_frame: float, left: int | None) -> Iterator[Frame]:
        """Frame k at the first step >= k per_frame from here on, with a tolerance for rounding."""
        yield self.frame
        done = k = 0
        while left is None or done < left:
            k += 1
            due = -int(-(k * per_frame * (1 - 1e-9)) // 1)
            due = due if left is None else min(due, left)
            self.step(due - done)
            done = due
            yield self.frame

    def run(self, *, every: int | None = None, fps: float | None = None,
            t_end: float | None = None, observer: Observer | None = None, out: Path | None = None,
            replace: bool = False, progress: bool = False) -> Result:
        """Run to the end, and return the frames, as solve_ivp of SciPy does.

        every, fps, t_end, progress: as of `frames`. observer(sim): called at each frame; what is
        true ends the run. out: also record a trajectory (.csv, .vtkhdf, ...); replace: any file.
        A numerical event ends the run: see `success`, `status` and `message` of the result.
        """
        if out is not None and (every, fps, t_end) != (None, None, None):
            raise ArgumentError("a recording is planned by the options of the sim: give every, fps "
                                "and t_end to Sim")
        if observer is not None and not callable(observer):
            raise ArgumentTypeError("observer must be a function of the sim; found "
                                    + _arrays.shown(observer))
        frames: list[Frame] = []
        energies: list[Energy] = []
        status, message = Status.OK, "the run reached its end"
        with _recording(self, out, replace) as write:
            try:
                for frame in self.frames(every=every, fps=fps, t_end=t_end, progress=progress):
                    frames.append(frame)
                    energies.append(self.energy)
                    write()
                    if observer is not None and self._observe(observer):
                        status, message = Status.STOPPED, "the observer ended the run"
                        break
                else:
                    if not self._is_at_end(t_end):
                        status, message = Status.STOPPED, "stopped on request"
            except NumericalError as event:
                status, message = event.status, str(event)
        return Result(frames, energies, len(self), status, message, self.stats)

    def _observe(self, observer: Observer) -> bool:
        self._set_in_observer(True)
        try:
            return bool(observer(self))
        finally:
            self._set_in_observer(False)

    def _is_at_end(self, t_end: float | None) -> bool:
        end = self.plan.t_end if t_end is None else t_end
        return self.t >= end * (1 - 1e-9)

    def recorder(self, path: Path, *, replace: bool = False, resume: bool = False) -> Recorder:
        """Open a trajectory file for the frames of this sim: `with sim.recorder(path) as r:`."""
        return Recorder(self, path, replace=replace, resume=resume)

    def show(self, *, height: int = 520) -> Page:
        """Run to the end and display the run in a notebook, as a page of its own."""
        from ._view import show
        return show(self, height)

    # -- texts ------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        plan = self.plan
        steps = f"tol = {plan.tol:g}" if plan.tol > 0 else f"h = {plan.h:g} s"
        solver = "" if plan.solver == "none" else f", solver {plan.solver}"
        return (f"<msim.Sim: {len(self)} particles, {plan.integrator}, {steps}{solver}, "
                f"t = {self.t:g} s, step {self.nsteps}>")

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"


class Recorder(_core.Recorder):
    """A trajectory file; write() adds the present state of the sim."""

    def __init__(self, sim: Sim, path: Path, *, replace: bool = False, resume: bool = False) -> None:
        mode = "resume" if resume else "replace" if replace else "new"
        super().__init__(sim, _arrays.path(path), mode)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def run(scene: Scene, *, observer: Observer | None = None, out: Path | None = None,
        progress: bool = False, **options: object) -> Result:
    """Run a scene to its end: Sim(scene, **options).run(...)."""
    return Sim(scene, **options).run(observer=observer, out=out, progress=progress)


def step_many(sims: Iterable[Sim], n: int = 1, *, threads: int = 0) -> None:
    """Make n steps of each of many sims, several at a time, on all cores or in so many threads.

    Meant for many small scenes, whose sims have threads=1 each; bits are those of Sim.step. An error
    of a sim begins with its number, as "sims[3]: "; the others have then made equally many steps,
    at most n. Sims with a force function in Python take turns, as Python's threads do.
    """
    every = list(sims)
    for i, sim in enumerate(every):
        if not isinstance(sim, Sim):
            raise ArgumentError(f"sims[{i}] must be an msim.Sim; found {type(sim).__name__}")
    if len({id(sim) for sim in every}) < len(every):
        raise ArgumentError("sims must be different; one is there twice")
    _core.step_many(every, _arrays.count("n", n, most=_INT64),
                    _arrays.count("threads", threads, most=256))


@contextmanager
def _opened(path: Path, mode: str) -> Iterator[IO[bytes]]:
    """A binary file whose errors are those of msim."""
    try:
        with open(_arrays.path(path), mode) as file:
            yield file
    except OSError as error:
        raise FileError(f"{os.fspath(path)}: {error.strerror}") from error


@contextmanager
def _recording(sim: Sim, out: Path | None, replace: bool) -> Iterator[Callable[[], None]]:
    if out is None:
        yield lambda: None
    else:
        with sim.recorder(out, replace=replace) as recorder:
            yield recorder.write


def _steps_left(sim: Sim, plan: Plan, t_end: float | None) -> int | None:
    """Steps to t_end, or to the end of the plan; None: there is none."""
    if t_end is None and plan.t_end < 0:
        return None
    end = plan.t_end if t_end is None else _arrays.number("t_end", t_end)
    if not math.isfinite(end):
        raise ArgumentError(f"t_end must be finite; found {end}")
    steps = (end - sim.t) / plan.h
    if not steps > -1e-9:
        raise ArgumentError(f"t_end = {end:g} s lies before the present time {sim.t:g} s")
    return -int(-(steps - 1e-9 * max(1.0, steps)) // 1)


def _with_progress(frames: Iterator[Frame], sim: Sim, plan: Plan,
                   t_end: float | None) -> Iterator[Frame]:
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise ImportError("a progress bar needs tqdm: pip install tqdm") from error
    end = plan.t_end if t_end is None else t_end
    total = round(end - sim.t, 9) if end >= 0 else None
    start = sim.t
    with tqdm(total=total, unit="s", bar_format="{l_bar}{bar}| {n:.3g}/{total} s simulated "
              "[{elapsed}<{remaining}]") as bar:
        for frame in frames:
            bar.update(frame.t - start - bar.n)
            yield frame
