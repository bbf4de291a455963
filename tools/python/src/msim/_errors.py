"""Exceptions by status: each is an msim.Error and, where one fits, a built-in exception."""
from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Return codes of libmsim: < 0 errors, > 0 numerical events."""

    OK = 0
    NOT_SPD = 1
    NOT_CONVERGED = 2
    NOT_FINITE = 3
    STOPPED = 4
    UNSTABLE = 5
    FORCE_FAILED = 6
    ERR_ARG = -1
    ERR_MEMORY = -2
    ERR_NAME = -3
    ERR_PLUGIN = -4
    ERR_ABI = -5
    ERR_BACKEND = -6
    ERR_IO = -7
    ERR_UNSUPPORTED = -8
    ERR_SIZE = -9


class Error(Exception):
    """Base of all exceptions of msim; `status` says what failed."""

    status: Status = Status.ERR_ARG


class ArgumentError(Error, ValueError):
    """An argument, a scene or an option is invalid."""


class ArgumentTypeError(ArgumentError, TypeError):
    """An argument is of another type."""


class OptionError(ArgumentTypeError):
    """There is no option of that name."""


class NameNotFoundError(ArgumentError):
    """There is no integrator, solver, recorder or importer of that name."""

    status = Status.ERR_NAME


class OutOfMemoryError(Error, MemoryError):
    """An allocation failed."""

    status = Status.ERR_MEMORY


class FileError(Error, OSError):
    """A file could not be read or written."""

    status = Status.ERR_IO


class PluginError(Error, RuntimeError):
    """A plugin, or the library behind it, is unusable or failed."""


class UnsupportedError(Error, NotImplementedError):
    """This version of msim does not support it."""

    status = Status.ERR_UNSUPPORTED


class BusyError(Error, RuntimeError):
    """Another thread is using the sim."""


class StoppedError(Error, RuntimeError):
    """Sim.stop was called."""


class NumericalError(Error, ArithmeticError):
    """A numerical event ended the run; the sim is in the last good state.

    advice: what to try, at most five sentences, one a line, the first the most likely to help.
    """

    advice: str = ""


class NotPositiveDefiniteError(NumericalError):
    """The matrix of a step is not positive definite, and indefinite="stop"."""


class NotConvergedError(NumericalError):
    """An iterative solver, or Newton's method, did not reach its tolerance."""


class NotFiniteError(NumericalError):
    """The state contains NaN or numbers that are too large."""


class UnstableError(NumericalError):
    """Energy or extent exceed their bounds: the step is too large."""


class ForceFailedError(NumericalError):
    """A force function failed; its own exception is raised where it has one."""


CLASSES: dict[Status, type[Error]] = {
    Status.NOT_SPD: NotPositiveDefiniteError,
    Status.NOT_CONVERGED: NotConvergedError,
    Status.NOT_FINITE: NotFiniteError,
    Status.STOPPED: StoppedError,
    Status.UNSTABLE: UnstableError,
    Status.FORCE_FAILED: ForceFailedError,
    Status.ERR_ARG: ArgumentError,
    Status.ERR_MEMORY: OutOfMemoryError,
    Status.ERR_NAME: NameNotFoundError,
    Status.ERR_PLUGIN: PluginError,
    Status.ERR_ABI: PluginError,
    Status.ERR_BACKEND: PluginError,
    Status.ERR_IO: FileError,
    Status.ERR_UNSUPPORTED: UnsupportedError,
    Status.ERR_SIZE: ArgumentError,
}


def from_status(status: int, text: str, advice: str = "") -> Error:
    """The exception for a status; the binding raises it."""
    error = CLASSES[Status(status)](text)
    error.status = Status(status)
    if isinstance(error, NumericalError):
        error.advice = advice
    return error
