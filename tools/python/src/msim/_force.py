"""Forces that a program computes: results of its functions as arrays for the binding."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _arrays
from ._arrays import Doubles, Ints
from ._errors import ArgumentError, ArgumentTypeError

Function = Callable[[float, Ints, Doubles, Doubles | None], ArrayLike]
Jacobian = Callable[[float, Ints, Doubles, Doubles | None], tuple[ArrayLike, ArrayLike]]
Potential = Callable[[Ints, Doubles], float]


def callable_or_none(name: str, value: object) -> None:
    if value is not None and not callable(value):
        raise ArgumentTypeError(f"{name} must be a function; found {_arrays.shown(value)}")


def _blocks(name: str, values: ArrayLike, n: int) -> Doubles:
    """3 x 3 blocks of n particles: one for each, one for all, or a number times the unit matrix."""
    array = _arrays.doubles(name, values)
    if array.ndim == 0:
        array = array * np.eye(3)
    if array.shape not in ((3, 3), (n, 3, 3)):
        raise ArgumentError(f"{name} must be a number, or have the shape (3, 3) or ({n}, 3, 3); "
                            f"found {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, (n, 3, 3)))


def wrap_function(function: Function) -> Callable[..., Doubles]:
    def forces(t: float, particles: Ints, x: Doubles, v: Doubles | None) -> Doubles:
        array = _arrays.doubles("force", function(t, particles, x, v))
        if array.shape not in ((3,), x.shape):
            raise ArgumentError(f"the force function must return an array of shape {x.shape} or "
                                f"(3,); found {array.shape}")
        return np.ascontiguousarray(np.broadcast_to(array, x.shape))
    return forces


def wrap_jacobian(jacobian: Jacobian | None) -> Callable[..., tuple[Doubles, Doubles]] | None:
    if jacobian is None:
        return None
    known = jacobian

    def blocks(t: float, particles: Ints, x: Doubles, v: Doubles | None) -> tuple[Doubles, Doubles]:
        pair: Any = known(t, particles, x, v)
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise ArgumentError("jacobian must return a pair, df/dx and df/dv; found "
                                + _arrays.shown(pair))
        return _blocks("df/dx", pair[0], len(x)), _blocks("df/dv", pair[1], len(x))
    return blocks


def wrap_potential(potential: Potential | None) -> Callable[..., float] | None:
    if potential is None:
        return None
    known = potential
    return lambda particles, x: _arrays.number("the potential", known(particles, x))
