"""Arguments to arrays of the shape and type that libmsim takes, with messages that name them."""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import ArgumentError

Doubles = NDArray[np.float64]
Ints = NDArray[np.int32]


def _as_array(name: str, values: ArrayLike) -> NDArray[np.generic]:
    array = np.asarray(values)
    if array.dtype.kind not in "biuf":
        raise ArgumentError(f"{name} must hold real numbers; found an array of type {array.dtype}")
    return array


def doubles(name: str, values: ArrayLike) -> Doubles:
    """A contiguous copy as float64, which does not share memory with `values`."""
    return np.array(_as_array(name, values), dtype=np.float64, order="C")


def number(name: str, value: object) -> float:
    if isinstance(value, (int, float, np.integer, np.floating)):
        return float(value)
    raise ArgumentError(f"{name} must be a number; found {value!r}")


def rows(name: str, values: ArrayLike, n: int | None = None) -> Doubles:
    """n rows of x, y, z."""
    array = doubles(name, values)
    if array.ndim != 2 or array.shape[1] != 3 or n is not None and len(array) != n:
        wanted = "n" if n is None else str(n)
        raise ArgumentError(f"{name} must have the shape ({wanted}, 3); found {array.shape}")
    return array


def vector(name: str, values: ArrayLike) -> Doubles:
    array = doubles(name, values)
    if array.shape != (3,):
        raise ArgumentError(f"{name} must be three numbers; found an array of shape {array.shape}")
    return array


def each(name: str, values: ArrayLike, n: int, what: str) -> Doubles:
    """One number for each of n particles or springs, or one for all."""
    array = doubles(name, values)
    if array.shape not in ((), (n,)):
        raise ArgumentError(f"{name} must be one number, or one for each of {n} {what}; "
                            f"found an array of shape {array.shape}")
    return np.full(n, array) if array.ndim == 0 else array


def indices(name: str, values: ArrayLike, columns: int | None = None) -> Ints:
    """Indices of particles: a list, or rows of `columns`."""
    array = _as_array(name, values)
    if array.dtype.kind not in "iu" and array.size:
        raise ArgumentError(f"{name} must hold integers (indices of particles); found an array of "
                            f"type {array.dtype}")
    shape = (-1,) if columns is None else (-1, columns)
    if array.size == 0:
        return np.zeros((0,) + shape[1:], np.int32)
    if array.ndim != len(shape) or columns is not None and array.shape[1] != columns:
        wanted = "(n,)" if columns is None else f"(n, {columns})"
        raise ArgumentError(f"{name} must have the shape {wanted}; found {array.shape}")
    least, most = int(array.min()), int(array.max())
    if least < 0 or most > np.iinfo(np.int32).max:
        raise ArgumentError(f"{name} must hold indices that count from 0; found "
                            f"{least if least < 0 else most}")
    return np.ascontiguousarray(array, dtype=np.int32)


