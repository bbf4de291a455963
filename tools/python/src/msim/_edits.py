"""Arguments of Scene.edit and Sim.edit."""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import _arrays
from ._arrays import Doubles, Ints
from ._errors import ArgumentError


def arguments(remove_particles: ArrayLike, remove_springs: ArrayLike, x: ArrayLike | None,
              mass: ArrayLike | None, v: ArrayLike | None, ij: ArrayLike, k: ArrayLike | None,
              rest: ArrayLike | None, damping: ArrayLike | None, law: ArrayLike | None,
              ijk: ArrayLike, angle_k: ArrayLike | None, angle_rest: ArrayLike | None,
              angle_damping: ArrayLike | None
              ) -> tuple[Ints, Ints, Doubles | None, Doubles | None, Doubles | None, Ints,
                         Doubles | None, Doubles | None, Doubles | None, Ints | None, Ints,
                         Doubles | None, Doubles | None, Doubles | None]:
    """The arrays of msim_edit."""
    pairs = _arrays.indices("ij", ij, 2)
    triples = _arrays.indices("ijk", ijk, 3)
    if len(triples) and angle_k is None:
        raise ArgumentError("angular springs to add need both ijk and angle_k")
    angles = [None if values is None else _arrays.each(name, values, len(triples), "angles")
              for name, values in (("angle_k", angle_k), ("angle_rest", angle_rest),
                                   ("angle_damping", angle_damping))]
    if (x is None) != (mass is None):
        raise ArgumentError("particles to add need both x and mass")
    if len(pairs) and k is None:
        raise ArgumentError("springs to add need both ij and k")
    springs = [None if values is None else _arrays.each(name, values, len(pairs), "springs")
               for name, values in (("k", k), ("rest", rest), ("damping", damping))]
    laws = None if law is None else _arrays.one_or_more("law", law)
    if laws is not None and len(laws) == 1:
        laws = np.full(len(pairs), laws[0], np.int32)
    if laws is not None and len(laws) != len(pairs):
        raise ArgumentError(f"law must be one number, or one for each of {len(pairs)} springs")
    at = None if x is None else _arrays.rows("x", x)
    n = 0 if at is None else len(at)
    return (_arrays.one_or_more("remove_particles", remove_particles),
            _arrays.one_or_more("remove_springs", remove_springs), at,
            None if v is None else _arrays.rows("v", v, n),
            None if mass is None else _arrays.each("mass", mass, n, "particles"), pairs,
            springs[0], springs[1], springs[2], laws, triples, angles[0], angles[1], angles[2])
