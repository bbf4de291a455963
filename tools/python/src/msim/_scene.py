"""Scenes: particles, springs, gravity, drag and forces; planes and colliders: _obstacles."""
from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _core, _edits, _force
from ._arrays import Doubles, Ints, Path
from ._errors import ArgumentError, ArgumentTypeError
from ._obstacles import Obstacles

_LAWS = ("linear", "tension", "compression", "dead_band", "polynomial", "table")
Pinned = str | Sequence[int] | NDArray[np.integer[Any]]


def _jsonable(value: object) -> object:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise ArgumentError(f"a scene cannot hold a {type(value).__name__}; use numbers, texts, lists, "
                        "dicts and arrays")


class Scene(Obstacles):
    """A mechanical model. Build it here, or read it: Scene.load("scene.json").

    Methods that add particles return their indices as a range. Units are SI: m, kg, s, N.
    """

    def __init__(self, *, name: str = "", gravity: ArrayLike = (0, 0, 0), drag: float = 0) -> None:
        self._core = _core.Scene()
        self.name = name
        self.gravity = gravity
        self.drag = drag

    # -- reading and writing ----------------------------------------------------------------------

    @classmethod
    def _wrap(cls, core: _core.Scene) -> Scene:
        scene = cls.__new__(cls)
        scene._core = core
        return scene

    @classmethod
    def load(cls, path: Path) -> Scene:
        """Read a scene file: JSON, or what the extension says (.h5)."""
        return cls._wrap(_core.Scene(_arrays.path(path)))

    @classmethod
    def loads(cls, text: str | bytes, label: str = "scene") -> Scene:
        """Read a scene from JSON text; `label` stands for the file in messages."""
        if not isinstance(text, (str, bytes)):
            raise ArgumentTypeError(f"text must be a text or bytes; found {_arrays.shown(text)}")
        return cls._wrap(_core.Scene(label, text.encode() if isinstance(text, str) else text))

    @classmethod
    def from_dict(cls, tree: Mapping[str, object]) -> Scene:
        """A scene from the tree of a scene file; arrays may be NumPy's. "msim": 1 is implied."""
        if not isinstance(tree, Mapping):
            raise ArgumentTypeError('tree must be a mapping, as {"particles": {"x": ...}}; found '
                                    f"{tree!r}")
        return cls.loads(json.dumps({"msim": 1, **tree}, default=_jsonable), "dict")

    def save(self, path: Path) -> None:
        """Write a scene file: JSON, or what the extension says (.h5). Numbers stay exact."""
        self._core.save(_arrays.path(path))

    def dumps(self) -> str:
        """The scene as JSON text."""
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "scene.json")
            self._core.save(path)
            with open(path, encoding="utf-8") as file:
                return file.read()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self).loads, (self.dumps(),)

    # -- building ---------------------------------------------------------------------------------

    def add_particles(self, x: ArrayLike, mass: ArrayLike, v: ArrayLike | None = None) -> range:
        """Add particles at x, (n, 3), with one mass each, or one for all; v: at rest."""
        at = _arrays.rows("x", x)
        speed = None if v is None else _arrays.rows("v", v, len(at))
        masses = _arrays.each("mass", mass, len(at), "particles")
        first = len(self)
        self._core.add_particles(at, speed, masses)
        return range(first, len(self))

    def add_springs(self, ij: ArrayLike, k: ArrayLike, rest: ArrayLike | None = None,
                    damping: ArrayLike | None = None) -> range:
        """Add springs between the pairs ij, (n, 2); rest: the present length; damping: 0."""
        pairs = _arrays.indices("ij", ij, 2)
        n, first = len(pairs), self.nsprings
        optional = [None if values is None else _arrays.each(name, values, n, "springs")
                    for name, values in (("rest", rest), ("damping", damping))]
        self._core.add_springs(pairs, _arrays.each("k", k, n, "springs"), *optional)
        return range(first, self.nsprings)

    def add_angles(self, ijk: ArrayLike, k: ArrayLike, rest: ArrayLike | None = None,
                   damping: ArrayLike | None = None) -> range:
        """Add angular springs at j between its edges to i and k, ijk: (n, 3).

        They resist bending and do not stretch: the energy is k/2 (theta - rest)^2, with the angle
        theta in rad, pi where the edges are straight; k: N m/rad^2; damping: N m s/rad, 0.
        rest: the present angle, exactly pi if that is straight.
        """
        corners = _arrays.indices("ijk", ijk, 3)
        n, first = len(corners), self.nangles
        optional = [None if values is None else _arrays.each(name, values, n, "angles")
                    for name, values in (("rest", rest), ("damping", damping))]
        self._core.add_angles(corners, _arrays.each("k", k, n, "angles"), *optional)
        return range(first, self.nangles)

    def add_law(self, type: str, *, half_width: float = 0, limit: float = 0,
                coefficients: ArrayLike | None = None, stretch: ArrayLike | None = None,
                force: ArrayLike | None = None, break_strain: float = 0,
                break_force: float = 0) -> int:
        """Add a law of springs, for set_law; its number, from 1 on: law 0 is linear.

        With the stretch e = l - rest, type and parameters are "tension", f = k max(e, 0);
        "compression", f = k min(e, 0); "dead_band", no force while |e| is below half_width;
        "polynomial", f = k sum of coefficients[i] e^(i+1), linear where |e| > limit; "table", the
        monotone cubic through force (N) at stretch (m), linear beyond both ends. With break_strain
        or break_force, for "linear" too, a spring breaks whose strain e/rest, or whose f, exceeds it.
        """
        if type not in _LAWS:
            raise ArgumentError(f"type is {type!r}; it must be one of {', '.join(_LAWS)}")
        given = {"coefficients": coefficients, "stretch": stretch, "force": force}
        lists = {name: np.atleast_1d(_arrays.doubles(name, values))
                 for name, values in given.items() if values is not None}
        sizes = {len(values) for values in lists.values()}
        if len(sizes) > 1:
            raise ArgumentError("stretch and force must have the same length")
        return self._core.add_law(_LAWS.index(type), _arrays.number("half_width", half_width),
                                  _arrays.number("limit", limit), lists.get("coefficients"),
                                  lists.get("stretch"), lists.get("force"), max(sizes, default=0),
                                  _arrays.number("break_strain", break_strain),
                                  _arrays.number("break_force", break_force))

    def set_law(self, springs: ArrayLike, law: int) -> None:
        """Give springs, an index or several, the law of this number; 0: linear."""
        self._core.set_law(_arrays.one_or_more("springs", springs), _arrays.count("law", law))

    def edit(self, *, remove_particles: ArrayLike = (), remove_springs: ArrayLike = (),
             x: ArrayLike | None = None, mass: ArrayLike | None = None,
             v: ArrayLike | None = None, ij: ArrayLike = (), k: ArrayLike | None = None,
             rest: ArrayLike | None = None, damping: ArrayLike | None = None,
             law: ArrayLike | None = None, ijk: ArrayLike = (),
             angle_k: ArrayLike | None = None, angle_rest: ArrayLike | None = None,
             angle_damping: ArrayLike | None = None) -> None:
        """Remove and add particles and springs at once, as Sim.edit does in a running sim."""
        self._core.edit(*_edits.arguments(remove_particles, remove_springs, x, mass, v, ij, k, rest,
                                          damping, law, ijk, angle_k, angle_rest, angle_damping))

    def add_faces(self, corners: ArrayLike) -> None:
        """Add triangles of particles, (n, 3), which viewers draw; they have no mass or force."""
        self._core.add_faces(_arrays.indices("corners", corners, 3))

    def pin(self, particles: ArrayLike) -> None:
        """Hold particles where they are; an index, or several."""
        self._core.pin(_arrays.one_or_more("particles", particles))

    def add_motion(self, particles: ArrayLike, t: ArrayLike, x: ArrayLike, *,
                   cubic: bool = False) -> None:
        """Move pinned particles through the points x, (times, particles, 3), at the times t, s.

        Along straight lines, or, cubic, with continuous velocities, which are 0 at both ends.
        """
        which = _arrays.one_or_more("particles", particles)
        times = np.atleast_1d(_arrays.doubles("t", t))
        points = _arrays.doubles("x", x)
        if times.ndim != 1 or points.shape != (len(times), len(which), 3):
            raise ArgumentError(f"x must have the shape ({len(times)}, {len(which)}, 3), one row for "
                                f"each time and particle; found {points.shape}")
        self._core.add_motion(which, times, points, cubic)

    def set_force(self, function: _force.Function | None, *, name: str | None = None,
                  time: bool = False, velocity: bool = False,
                  jacobian: _force.Jacobian | None = None,
                  potential: _force.Potential | None = None, largest_stiffness: float = 0,
                  largest_damping: float = 0) -> None:
        """Add the forces function(t, particles, x, v), (n, 3) or (3,), N; None: no longer.

        It gets the time, the indices of the free particles of an island, and copies of their
        positions and velocities, (n, 3), and must depend on these alone: say with `time` and
        `velocity` whether on t and v, which is None otherwise. jacobian, with the same arguments,
        returns df/dx and df/dv of each particle: numbers (times the unit matrix), (3, 3) or
        (n, 3, 3); implicit methods need it for long steps. potential(particles, x), in J, counts as
        energy; without one the work of the force is integrated. largest_stiffness, N/m, and
        largest_damping, N s/m, bound the derivatives, for h="auto". Checkpoints compare `name`, that
        of the function if it is not given. An exception of a function ends the step, and is raised
        there. Functions must not use the sim.
        """
        if function is None:
            self._core.remove_force()
            return
        for what, value in (("function", function), ("jacobian", jacobian),
                            ("potential", potential)):
            _force.callable_or_none(what, value)
        title = getattr(function, "__name__", "force") if name is None else name
        if not isinstance(title, str):
            raise ArgumentTypeError(f"name must be a text; found {_arrays.shown(title)}")
        flags = _arrays.flag("time", time) + 2 * _arrays.flag("velocity", velocity)
        self._core.set_force(title, flags,
                             _force.wrap_function(function), _force.wrap_jacobian(jacobian),
                             _force.wrap_potential(potential),
                             _arrays.number("largest_stiffness", largest_stiffness),
                             _arrays.number("largest_damping", largest_damping))

    def add_rope(self, n: int, start: ArrayLike, end: ArrayLike, *, mass: float, k: float,
                 damping: float = 0, bending: float = 0, pinned: Pinned = ()) -> range:
        """Add n particles from start to end, with springs between neighbours. mass: of the rope.

        bending: k of angular springs at the inner particles, N m/rad^2; 0: none.
        """
        first = len(self)
        self._core.add_rope(_arrays.count("n", n), _arrays.vector("start", start),
                            _arrays.vector("end", end), *_material(mass, k, damping),
                            _arrays.number("bending", bending),
                            _arrays.indices("pinned", _no_names(pinned)))
        return range(first, len(self))

    def add_cloth(self, n: tuple[int, int], origin: ArrayLike, row: ArrayLike, column: ArrayLike,
                  *, mass: float, k: float | Mapping[str, float], damping: float = 0,
                  bending: float = 0, pinned: Pinned = ()) -> range:
        """Add n = (rows, columns) particles in a parallelogram with the edge vectors row, column.

        mass: of the cloth. k: one for all springs, or {"structural": .., "shear": .., "bend": ..}.
        bending: k of angular springs along rows and columns, N m/rad^2; 0: none.
        pinned: indices within the cloth, "corners", "first_row" or "first_corners".
        """
        rows, columns = _sizes(n, 2)
        kinds = ("structural", "shear", "bend")
        if isinstance(k, Mapping):
            unknown = set(k) - set(kinds)
            if unknown:
                raise ArgumentError(f"k has no key {sorted(unknown)[0]!r}; it may have "
                                    f"{', '.join(kinds)}")
            stiffness = [_arrays.number(f"k[{kind!r}]", k.get(kind, 0)) for kind in kinds]
        else:
            stiffness = [_arrays.number("k", k)] * 3
        first = len(self)
        self._core.add_cloth(rows, columns, _arrays.vector("origin", origin),
                             _arrays.vector("row", row), _arrays.vector("column", column),
                             _arrays.number("mass", mass), _arrays.doubles("k", stiffness),
                             _arrays.number("damping", damping),
                             _arrays.number("bending", bending),
                             _arrays.indices("pinned", _pinned_of_cloth(pinned, rows, columns)))
        return range(first, len(self))

    def add_lattice(self, n: tuple[int, int, int], origin: ArrayLike, size: ArrayLike, *,
                    mass: float, k: float, damping: float = 0, pinned: Pinned = ()) -> range:
        """Add a box of n = (nx, ny, nz) particles. mass: of the lattice."""
        first = len(self)
        self._core.add_lattice(np.array(_sizes(n, 3), np.int32), _arrays.vector("origin", origin),
                               _arrays.vector("size", size), *_material(mass, k, damping),
                               _arrays.indices("pinned", _no_names(pinned)))
        return range(first, len(self))

    def add_mesh(self, vertices: ArrayLike | None = None, faces: ArrayLike | None = None, *,
                 file: Path | None = None, scale: float = 1, translate: ArrayLike = (0, 0, 0),
                 mass: float, k: float, bend: float = 0, fill: float | bool = False,
                 damping: float = 0, pinned: Pinned = ()) -> range:
        """Add a surface of triangles: vertices (n, 3) and faces (m, 3), or those of a file.

        A particle at each vertex, a spring along each edge, and with bend one between the vertices
        opposite each edge. Files: .obj, .stl, .ply, .gltf, .glb (plugin assimp); scale and
        translate apply to them and to arrays. fill: spacing in m of a lattice inside, which makes
        a soft body; True: a sixth of the shortest edge of the bounding box. Particles are the
        vertices in their order, then the points of the lattice. What is merged, left out or turned
        is counted in mesh_repairs.
        """
        if (file is None) == (vertices is None) or (vertices is None) != (faces is None):
            raise ArgumentError("a mesh is vertices and faces, or a file")
        at = None if vertices is None else _arrays.rows("vertices", vertices)
        corners = None if faces is None else _arrays.indices("faces", faces, 3)
        automatic = isinstance(fill, (bool, np.bool_))
        spacing = (-1.0 if fill else 0.0) if automatic else _arrays.number("fill", fill)
        if not automatic and not spacing > 0:
            raise ArgumentError(f"fill must be a number > 0, True or False; found {fill!r}")
        first = len(self)
        self._core.add_mesh(None if file is None else _arrays.path(file), at, corners,
                            _arrays.number("scale", scale), _arrays.vector("translate", translate),
                            _arrays.number("mass", mass), _arrays.number("k", k),
                            _arrays.number("bend", bend), spacing,
                            _arrays.number("damping", damping),
                            _arrays.indices("pinned", _no_names(pinned)))
        return range(first, len(self))

    @property
    def mesh_repairs(self) -> dict[str, int]:
        """What was merged, left out or turned, and what is open, in all meshes together."""
        return self._core.mesh_repairs()

    # -- properties -------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        return self._core.name()

    @name.setter
    def name(self, name: str) -> None:
        if not isinstance(name, str):
            raise ArgumentTypeError(f"name must be a text; found {_arrays.shown(name)}")
        self._core.set_name(name)

    @property
    def gravity(self) -> Doubles:
        """Acceleration of all particles, m/s^2; assign three numbers."""
        return _frozen(np.array(self._core.gravity()))

    @gravity.setter
    def gravity(self, value: ArrayLike) -> None:
        self._core.set_gravity(_arrays.vector("gravity", value))

    @property
    def drag(self) -> float:
        """b in the force -b v on every particle, N s/m."""
        return self._core.drag()

    @drag.setter
    def drag(self, value: float) -> None:
        self._core.set_drag(_arrays.number("drag", value))

    @property
    def planes_constrain(self) -> bool:
        """Whether implicit methods with long steps hold particles at planes by their matrix, as at
        colliders, also with collision="reflect"; meshes set it."""
        return self._core.planes_constrain()

    @planes_constrain.setter
    def planes_constrain(self, value: bool) -> None:
        self._core.set_planes_constrain(_arrays.flag("planes_constrain", value))

    @property
    def self_contact(self) -> tuple[float, float]:
        """Thickness (m) and friction of self-contact; (0, 0): there is none."""
        return self._core.self_contact()

    def set_self_contact(self, thickness: float, friction: float = 0) -> None:
        """Let faces and ropes not pass through each other or themselves; thickness 0: they do."""
        self._core.set_self_contact(_arrays.number("thickness", thickness),
                                    _arrays.number("friction", friction))

    @property
    def force(self) -> Doubles:
        """Constant forces on particles, (n, 3), N; a read-only copy. Assign others."""
        return self._array("force")

    @force.setter
    def force(self, value: ArrayLike) -> None:
        self._core.set_forces(_arrays.rows("force", value, len(self)))

    @property
    def x(self) -> Doubles:
        """Initial positions, (n, 3); this and the following are read-only copies."""
        return self._array("x")

    @property
    def v(self) -> Doubles:
        """Initial velocities, (n, 3)."""
        return self._array("v")

    @property
    def mass(self) -> Doubles:
        return self._array("mass")

    @property
    def pinned(self) -> NDArray[np.bool_]:
        """True where a particle is pinned."""
        return self._array("pinned").astype(bool)

    @property
    def ij(self) -> Ints:
        """The two particles of each spring, (nsprings, 2)."""
        return self._array("ij")

    @property
    def k(self) -> Doubles:
        return self._array("k")

    @property
    def rest(self) -> Doubles:
        return self._array("rest")

    @property
    def damping(self) -> Doubles:
        return self._array("damping")

    @property
    def law(self) -> Ints:
        """The number of the law of each spring; 0: linear."""
        return self._array("law")

    @property
    def ijk(self) -> Ints:
        """The three particles of each angular spring, the vertex in the middle, (nangles, 3)."""
        return self._array("ijk")

    @property
    def angle_k(self) -> Doubles:
        """Bending stiffnesses of the angular springs, N m/rad^2."""
        return self._array("angle_k")

    @property
    def angle_rest(self) -> Doubles:
        """Their rest angles, rad."""
        return self._array("angle_rest")

    @property
    def angle_damping(self) -> Doubles:
        """Their damping constants, N m s/rad."""
        return self._array("angle_damping")

    @property
    def faces(self) -> Ints:
        """Triangles of particles, (nfaces, 3)."""
        return self._array("faces")

    @property
    def nsprings(self) -> int:
        return self._core.counts()[1]

    @property
    def nangles(self) -> int:
        return self._core.counts()[4]

    def __len__(self) -> int:
        """The number of particles."""
        return self._core.counts()[0]

    def __bool__(self) -> bool:
        return True

    def __repr__(self) -> str:
        particles, springs, planes, faces, _ = self._core.counts()
        name = f" {self.name!r}" if self.name else ""
        return (f"<msim.Scene{name}: {particles} particles, {springs} springs, {planes} planes, "
                f"{faces} faces>")

    def _array(self, name: str) -> NDArray[Any]:
        return _frozen(self._core.array(name))


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array


def _material(mass: float, k: float, damping: float) -> tuple[float, float, float]:
    return (_arrays.number("mass", mass), _arrays.number("k", k),
            _arrays.number("damping", damping))


def _sizes(n: tuple[int, ...], count: int) -> list[int]:
    listed = isinstance(n, (Sequence, np.ndarray)) and not isinstance(n, str)
    sizes = [_arrays.count("n", value) for value in n] if listed else []
    if len(sizes) != count:
        raise ArgumentError(f"n must be {count} whole numbers; found {_arrays.shown(n)}")
    return sizes


def _no_names(pinned: Pinned) -> ArrayLike:
    if isinstance(pinned, str):
        raise ArgumentError(f"pinned must be indices; {pinned!r} is a name for cloths only")
    return pinned


def _pinned_of_cloth(pinned: Pinned, rows: int, columns: int) -> ArrayLike:
    if not isinstance(pinned, str):
        return pinned
    last = (rows - 1) * columns
    names = {"corners": sorted({0, columns - 1, last, last + columns - 1}),
             "first_row": list(range(columns)), "first_corners": sorted({0, columns - 1})}
    if pinned not in names:
        raise ArgumentError(f"pinned is {pinned!r}; it must be indices or one of "
                            f"{', '.join(names)}")
    return names[pinned]
