"""Arguments in the types and shapes that libmsim takes, with messages that name them."""
from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import ArgumentError, ArgumentTypeError

Doubles = NDArray[np.float64]
Ints = NDArray[np.int32]


Path = str | os.PathLike[str]


def shown(value: object) -> str:
    """One line for messages: arrays and lists of lists take several."""
    return " ".join(repr(value).split())


def _found(values: ArrayLike, array: NDArray[np.generic]) -> str:
    """A single value, or the type and shape of an array."""
    short = array.ndim == 0 or array.dtype.kind in "OU" and array.size < 5
    return shown(values) if short else f"an array of type {array.dtype} and shape {array.shape}"


def _as_array(name: str, values: ArrayLike, kinds: str = "biuf",
              what: str = "real numbers") -> NDArray[np.generic]:
    """An array whose type is of one of the kinds of NumPy."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ArgumentError(f"{name} must be rows of equal length; NumPy says: {error}") from error
    if array.dtype.kind not in kinds:
        raise ArgumentError(f"{name} must hold {what}; found {_found(values, array)}")
    return array


def doubles(name: str, values: ArrayLike) -> Doubles:
    """A contiguous copy as float64, which does not share memory with `values`."""
    return np.array(_as_array(name, values), dtype=np.float64, order="C")


def number(name: str, value: object) -> float:
    if isinstance(value, (int, float, np.integer, np.floating)):
        return float(value)
    raise ArgumentError(f"{name} must be a number; found {shown(value)}")


def count(name: str, value: object, least: int = 0, most: int = np.iinfo(np.int32).max) -> int:
    error: type[ArgumentError] = ArgumentTypeError
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        if least <= value <= most:
            return int(value)
        error = ArgumentError
    raise error(f"{name} must be a whole number from {least} to {most}; found {shown(value)}")


def flag(name: str, value: object) -> bool:
    if isinstance(value, (bool, np.bool_)) or isinstance(value, int) and value in (0, 1):
        return bool(value)
    raise ArgumentTypeError(f"{name} must be True or False; found {shown(value)}")


def path(value: object) -> str:
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    raise ArgumentTypeError(f"path must be a text or a path; found {shown(value)}")


def rows(name: str, values: ArrayLike, n: int | None = None) -> Doubles:
    """n rows of x, y, z."""
    array = doubles(name, values)
    if array.ndim != 2 or array.shape[1] != 3 or n is not None and len(array) != n:
        wanted = "n" if n is None else str(n)
        raise ArgumentError(f"{name} must have the shape ({wanted}, 3); found "
                            f"{_found(values, array)}")
    return array


def vector(name: str, values: ArrayLike) -> Doubles:
    array = doubles(name, values)
    if array.shape != (3,):
        raise ArgumentError(f"{name} must be three numbers; found {_found(values, array)}")
    return array


def each(name: str, values: ArrayLike, n: int, what: str) -> Doubles:
    """One number for each of n particles or springs, or one for all."""
    array = doubles(name, values)
    if array.shape not in ((), (n,)):
        raise ArgumentError(f"{name} must be one number, or one for each of {n} {what}; "
                            f"found {_found(values, array)}")
    return np.full(n, array) if array.ndim == 0 else array


def indices(name: str, values: ArrayLike, columns: int | None = None) -> Ints:
    """Indices of particles: a list, or rows of `columns`."""
    array = _as_array(name, values, "biufOU", "integers")
    if array.dtype.kind not in "iu" and array.size:
        flags = "; list the indices, not a flag for each" if array.dtype.kind == "b" else ""
        raise ArgumentError(f"{name} must hold integers (indices of particles); found "
                            f"{_found(values, array)}{flags}")
    shape = (-1,) if columns is None else (-1, columns)
    if array.size == 0:
        return np.zeros((0,) + shape[1:], np.int32)
    if array.ndim != len(shape) or columns is not None and array.shape[1] != columns:
        wanted = "(n,)" if columns is None else f"(n, {columns})"
        raise ArgumentError(f"{name} must have the shape {wanted}; found {_found(values, array)}")
    least, most = int(array.min()), int(array.max())
    limit = np.iinfo(np.int32).max
    if least < 0 or most > limit:
        raise ArgumentError(f"{name} must hold indices from 0 to {limit}; found "
                            f"{least if least < 0 else most}")
    return np.ascontiguousarray(array, dtype=np.int32)


def one_or_more(name: str, values: ArrayLike) -> Ints:
    """Indices of particles or springs: one, or a list."""
    single = np.isscalar(values) or getattr(values, "ndim", 1) == 0
    listed: Any = [values] if single else values
    return indices(name, listed)
