"""What particles of a scene bounce off: planes and colliders."""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import _arrays
from ._core import Scene as CoreScene
from ._errors import ArgumentError


class Plane(NamedTuple):
    """The half space normal . x >= offset."""

    normal: tuple[float, float, float]
    offset: float
    restitution: float
    friction: float


# The types of colliders, in the order of msim_collider_type, with their keys
_COLLIDERS = {"sphere": ("center", "radius"), "capsule": ("from", "to", "radius"),
              "cylinder": ("from", "to", "radius"), "box": ("center", "size", "rotation"),
              "heightfield": (), "sdf": ()}


class Obstacles:
    """The part of Scene that adds and lists them."""

    _core: CoreScene

    def add_plane(self, normal: ArrayLike, offset: float = 0, *, restitution: float = 1,
                  friction: float = 0) -> None:
        """Add the half space normal . x >= offset, which particles bounce off."""
        self._core.add_plane(_arrays.vector("normal", normal), _arrays.number("offset", offset),
                             _arrays.number("restitution", restitution),
                             _arrays.number("friction", friction))

    def add_sphere(self, center: ArrayLike, radius: float, *, inside: bool = False,
                   restitution: float = 1, friction: float = 0) -> None:
        """Add a sphere that particles bounce off; inside: they stay in it, as in a bowl."""
        self._add_collider("sphere", inside, restitution, friction, center=center, radius=radius)

    def add_capsule(self, start: ArrayLike, end: ArrayLike, radius: float, *, inside: bool = False,
                    restitution: float = 1, friction: float = 0) -> None:
        """Add all points within radius of the line from start to end, as add_sphere does."""
        self._add_collider("capsule", inside, restitution, friction, start=start, end=end,
                           radius=radius)

    def add_cylinder(self, start: ArrayLike, end: ArrayLike, radius: float, *,
                     inside: bool = False, restitution: float = 1, friction: float = 0) -> None:
        """Add a cylinder with flat ends, whose axis is from start to end, as add_sphere does."""
        self._add_collider("cylinder", inside, restitution, friction, start=start, end=end,
                           radius=radius)

    def add_box(self, center: ArrayLike, size: ArrayLike, rotation: ArrayLike = (0, 0, 0), *,
                inside: bool = False, restitution: float = 1, friction: float = 0) -> None:
        """Add a box with these edge lengths, as add_sphere does.

        rotation: about the center, the axis with the angle in rad as its length.
        """
        self._add_collider("box", inside, restitution, friction, center=center, size=size,
                           rotation=rotation)

    def add_heightfield(self, origin: ArrayLike, spacing: ArrayLike, heights: ArrayLike, *,
                        inside: bool = False, restitution: float = 1, friction: float = 0) -> None:
        """Add the space below triangles through heights on a grid, as add_sphere does.

        heights: (nx, ny), above the origin, that of (i, j) at (i spacing[0], j spacing[1]) from it;
        beyond the grid the surface continues with the heights of its border.
        """
        self._add_samples("heightfield", origin, spacing, heights, 2, inside, restitution, friction)

    def add_sdf(self, origin: ArrayLike, spacing: ArrayLike, values: ArrayLike, *,
                inside: bool = False, restitution: float = 1, friction: float = 0) -> None:
        """Add a solid by samples of the signed distance on a grid, as add_sphere does.

        values: (nx, ny, nz), negative in the solid and > 0 at the border of the grid.
        """
        self._add_samples("sdf", origin, spacing, values, 3, inside, restitution, friction)

    def _add_samples(self, kind: str, origin: ArrayLike, spacing: ArrayLike, values: ArrayLike,
                     axes: int, inside: bool, restitution: float, friction: float) -> None:
        samples, step = _arrays.doubles("values", values), _arrays.doubles("spacing", spacing)
        if samples.ndim != axes or step.shape != (axes,):
            raise ArgumentError(f"a {kind} has samples along {axes} axes, and as many spacings; found "
                                f"arrays of shapes {samples.shape} and {step.shape}")
        self._core.add_samples(1 + list(_COLLIDERS).index(kind), _arrays.flag("inside", inside),
                               _arrays.vector("origin", origin), step,
                               np.array(samples.shape, np.int32), samples.ravel(),
                               _arrays.number("restitution", restitution),
                               _arrays.number("friction", friction))

    def _add_collider(self, kind: str, inside: bool, restitution: float, friction: float, *,
                      radius: float = 0, **vectors: ArrayLike) -> None:
        names = ("center", "start", "end", "size", "rotation")
        center, start, end, size, rotation = (_arrays.vector(name, vectors.get(name, (0, 0, 0)))
                                              for name in names)
        self._core.add_collider(1 + list(_COLLIDERS).index(kind), _arrays.flag("inside", inside),
                                center, start, end, _arrays.number("radius", radius), size,
                                rotation, _arrays.number("restitution", restitution),
                                _arrays.number("friction", friction))

    def set_collider_motion(self, collider: int, t: ArrayLike, x: ArrayLike,
                            rotation: ArrayLike | None = None, *, cubic: bool = False) -> None:
        """Move a collider, by its index, through x, (times, 3), at the times t, s.

        x: its center, or the middle of its axis. rotation: rotation vectors about it, (times, 3),
        after the rotation that it has at rest. Between times as add_motion.
        """
        times = np.atleast_1d(_arrays.doubles("t", t))
        turns = None if rotation is None else _arrays.rows("rotation", rotation, len(times))
        self._core.set_collider_motion(_arrays.count("collider", collider), times,
                                       _arrays.rows("x", x, len(times)), turns, cubic)

    @property
    def planes(self) -> list[Plane]:
        return [Plane(*plane) for plane in self._core.planes()]

    @property
    def colliders(self) -> list[dict[str, Any]]:
        """The colliders, each with all keys that it has in scene files."""
        names = ("inside", "center", "from", "to", "radius", "size", "rotation", "restitution",
                 "friction")
        found = []
        for i, (number, *values) in enumerate(self._core.colliders()):
            kind = list(_COLLIDERS)[number - 1]
            keys = (*_COLLIDERS[kind], "inside", "restitution", "friction")
            found.append({"type": kind, **{name: value for name, value in zip(names, values)
                                           if name in keys}})
            samples = self._core.samples(i)
            if samples:
                origin, spacing, numbers = samples
                found[-1].update(origin=origin, spacing=spacing, n=numbers.shape)
                found[-1]["heights" if kind == "heightfield" else "values"] = numbers.ravel().tolist()
            motion = self._core.collider_motion(i)
            if motion:
                t, x, rotation, cubic = motion
                found[-1]["motion"] = {
                    "t": t.tolist(), "x": x.tolist(),
                    "interpolation": "cubic" if cubic else "linear",
                    **({} if rotation is None else {"rotation": rotation.tolist()})}
        return found
