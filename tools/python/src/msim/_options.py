"""Keyword arguments to options of libmsim: names as in scene files and C, with _ for a dot."""
from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from . import _arrays, _core
from ._errors import ArgumentError, OptionError


class Option(NamedTuple):
    """An option of Sim: its name in scene files, accepted values, default."""

    name: str
    values: str
    default: str
    doc: str

    @property
    def keyword(self) -> str:
        return self.name.replace(".", "_")


class Integrator(NamedTuple):
    """A value of the option `integrator`; order 0: it chooses one of the others."""

    name: str
    order: int
    implicit: bool
    doc: str


class Plugin(NamedTuple):
    """A solver, recorder or importer; note: where it comes from, or why it is not available."""

    name: str
    available: bool
    library: str
    license: str
    note: str


def options() -> list[Option]:
    """All options of Sim."""
    return [Option(*entry) for entry in _core.options()]


def integrators() -> list[Integrator]:
    return [Integrator(*entry) for entry in _core.integrators()]


def solvers() -> list[Plugin]:
    """Linear solvers of implicit methods."""
    return [Plugin(*entry) for entry in _core.solvers()]


def recorders() -> list[Plugin]:
    """Kinds of trajectory files that can be written."""
    return [Plugin(*entry) for entry in _core.recorders()]


def importers() -> list[Plugin]:
    """Kinds of scene files besides JSON."""
    return [Plugin(*entry) for entry in _core.importers()]


_BY_KEYWORD = {name: option for option in options() for name in (option.name, option.keyword)}

# what other programs call it
_ELSEWHERE = {
    "dt": "h", "delta_t": "h", "time_step": "h", "timestep": "h", "step": "h", "step_size": "h",
    "max_step": "h", "first_step": "h", "method": "integrator", "scheme": "integrator",
    "rtol": "tol", "atol": "tol", "tolerance": "tol", "duration": "t_end", "t_final": "t_end",
    "t_max": "t_end", "tmax": "t_end", "tend": "t_end", "t1": "t_end", "n_steps": "steps",
    "nsteps": "steps", "num_steps": "steps", "n_threads": "threads", "num_threads": "threads",
    "nthreads": "threads", "linear_solver": "solver", "frame_rate": "fps", "stride": "every",
}


def _refuse(keyword: str) -> OptionError:
    known = {option.keyword: option.keyword for option in options()} | _ELSEWHERE
    near = difflib.get_close_matches(keyword.lower(), known, 1)
    hint = f"did you mean '{known[near[0]]}'?" if near else "msim.options() lists them"
    return OptionError(f"there is no option '{keyword}'; {hint}")


def _text(keyword: str, value: object) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "on" if value else "off"
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    raise ArgumentError(f"{keyword} must be a number or a text; found {_arrays.shown(value)}")


def as_text(given: Mapping[str, object]) -> list[tuple[str, str]]:
    """Options as names and values of scene files; None: the default."""
    for keyword, value in given.items():
        if keyword not in _BY_KEYWORD:
            raise _refuse(keyword)
        if isinstance(value, (bool, np.bool_)) and "on" not in _BY_KEYWORD[keyword].values.split():
            raise ArgumentError(f"{keyword} must be {_BY_KEYWORD[keyword].values}; found {value}")
    return [(_BY_KEYWORD[keyword].name, _text(keyword, value)) for keyword, value in given.items()
            if value is not None]
