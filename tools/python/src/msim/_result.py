"""What a run returns, and its parts."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._arrays import Doubles
from ._errors import Status


class Energy(NamedTuple):
    """Energies in J, momentum and angular momentum about the origin.

    work: energy that changes of forces have supplied; it is part of `total`.
    """

    kinetic: float
    elastic: float
    gravitational: float
    total: float
    momentum: Doubles
    angular_momentum: Doubles
    work: float


class Energies(NamedTuple):
    """Energies in J, one of each frame."""

    kinetic: Doubles
    elastic: Doubles
    gravitational: Doubles
    total: Doubles


class Islands(NamedTuple):
    """The island of each particle, and energies in J, one of each island."""

    of: NDArray[np.int32]
    kinetic: Doubles
    elastic: Doubles
    gravitational: Doubles


class Equilibrium(NamedTuple):
    """The largest force that is left, N, on which particle, and how it was found.

    saddles: equilibria that were left, as they are no minimum of the energy. is_minimum: False
    where it is not known, because of friction, samples of colliders, or the solver.
    """

    force: float
    particle: int
    iterations: int
    saddles: int
    is_minimum: bool


class Modes(NamedTuple):
    """Natural frequencies, Hz, (n,), and the motions of all particles, (n, particles, 3)."""

    frequency: Doubles
    shape: Doubles


class Plan(NamedTuple):
    """Decisions made at creation: steps and t_end are -1 if no end was given."""

    h: float
    steps: int
    integrator: str
    solver: str
    threads: int
    tol: float
    t_end: float


class Estimate(NamedTuple):
    """The cost of the rest of a run, or of 1 s if it has no end, by `tried` first steps: counts as in
    `Sim.stats`, and `work`, all of them in evaluations of all forces."""

    tried: int
    steps: float
    force_evaluations: float
    solves: float
    iterations: float
    factorizations: float
    work: float


class Springs(NamedTuple):
    """One number for each spring: tension f + c dl/dt, N, f = k (l - L) or that of its law;
    elongation l - L, m; strain (l - L)/L, 0 where L = 0."""

    tension: Doubles
    elongation: Doubles
    strain: Doubles


class Frame(NamedTuple):
    """A state of a run; x and v are copies."""

    step: int
    t: float
    x: Doubles
    v: Doubles


class Result:
    """The frames of a run, and how it ended; the names are those of scipy.integrate.solve_ivp.

    t: (frames,); x, v: (frames, n, 3); energy, work: arrays per frame; success: the run reached its end;
    status, message: why it did not; nfev, njev, nlu: evaluations of forces, matrices and
    factorizations; stats: all counts and times.
    """

    def __init__(self, frames: list[Frame], energies: list[Energy], n: int, status: Status,
                 message: str, stats: dict[str, float]) -> None:
        self.t = np.array([frame.t for frame in frames])
        self.steps = np.array([frame.step for frame in frames], dtype=np.int64)
        self.x = np.array([frame.x for frame in frames]).reshape(len(frames), n, 3)
        self.v = np.array([frame.v for frame in frames]).reshape(len(frames), n, 3)
        self.energy = Energies(*(np.array([energy[part] for energy in energies])
                                 for part in range(4)))
        self.work = np.array([energy.work for energy in energies])
        self.status = status
        self.success = status == Status.OK
        self.message = message
        self.stats = stats
        self.nsteps = int(stats["steps"])
        self.nfev = int(stats["force_evaluations"])
        self.njev = int(stats["assemblies"])
        self.nlu = int(stats["factorizations"])

    def __len__(self) -> int:
        return len(self.t)

    def _span(self) -> str:
        return f" from t = {self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else ""

    def _drift(self) -> str:
        """The largest change of total energy less work, in units of the largest energy."""
        if not len(self.t):
            return "-"
        scale = max(float(np.abs(part).max()) for part in self.energy)
        balance = self.energy.total - self.work
        change = float(np.abs(balance - balance[0]).max())
        return f"{change / scale if scale else 0.0:.2e} of the largest energy"

    def __repr__(self) -> str:
        rows = {
            "message": self.message,
            "success": self.success,
            "status": f"{int(self.status)} ({self.status.name})",
            "frames": f"{len(self)}{self._span()}",
            "t": self.t.shape, "x": self.x.shape, "v": self.v.shape,
            "energy change": self._drift(),
            "nsteps": self.nsteps, "nfev": self.nfev, "njev": self.njev, "nlu": self.nlu,
            "seconds": f"{self.stats['total_s']:.3g}",
        }
        return "\n".join(f"{name:>14}: {value}" for name, value in rows.items())

    def _repr_html_(self) -> str:
        import html
        return f"<pre>{html.escape(repr(self))}</pre>"
