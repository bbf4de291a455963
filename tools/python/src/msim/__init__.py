"""msim simulates mass-spring systems.

    import msim
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_cloth((20, 20), origin=(0, 0, 1), row=(0, 1, 0), column=(1, 0, 0), mass=0.2, k=200,
                    damping=0.02, pinned="first_corners")
    result = msim.Sim(scene, integrator="implicit-midpoint", h=0.005, t_end=1).run()
    print(result)
"""
from ._core import version as _version
from ._errors import (ArgumentError, ArgumentTypeError, BusyError, Error, FileError,
                      ForceFailedError, NameNotFoundError, NotConvergedError, NotFiniteError,
                      NotPositiveDefiniteError, NumericalError, OptionError, OutOfMemoryError,
                      PluginError, Status, StoppedError, UnstableError, UnsupportedError)
from ._obstacles import Plane
from ._options import (Integrator, Option, Plugin, importers, integrators, options, recorders,
                       solvers)
from ._result import (Energies, Energy, Equilibrium, Estimate, Frame, Islands, Modes, Plan, Result,
                      Springs)
from ._scene import Scene
from ._sim import Recorder, Sim, run, step_many
from ._sweep import sweep
from ._trajectory import Trajectory
from ._view import view

__version__ = _version()
__all__ = [
    "ArgumentError", "ArgumentTypeError", "BusyError", "Energies", "Energy", "Equilibrium", "Error", "Estimate",
    "FileError", "ForceFailedError", "Frame", "Integrator", "Islands", "Modes",
    "NameNotFoundError", "NotConvergedError", "NotFiniteError", "NotPositiveDefiniteError",
    "NumericalError", "Option", "OptionError", "OutOfMemoryError", "Plan", "Plane", "Plugin",
    "PluginError", "Recorder", "Result", "Scene", "Sim", "Springs", "Status", "StoppedError",
    "Trajectory", "UnstableError", "UnsupportedError", "importers", "integrators", "options", "recorders", "run",
    "solvers", "step_many", "sweep", "view", "__version__",
]
