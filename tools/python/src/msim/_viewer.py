"""The program msim-view: shows a recorded run, draws or films it, writes it in other formats."""
from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import NamedTuple

from . import _pictures
from ._errors import ArgumentError, Error, UnsupportedError
from ._trajectory import Trajectory
from ._view import view


class _Kind(NamedTuple):
    write: Callable[[Trajectory, str, bool], None] # run, file, replace
    ending: str # of the file, in place of the run's extension
    doc: str


def _record(run: Trajectory, path: str, replace: bool) -> None:
    run.record(path, replace=replace)


_KINDS = {
    "html": _Kind(_record, ".html", "a page with a player, for any browser"),
    "png": _Kind(lambda run, path, _: _pictures.write_picture(run, path), ".png",
                 "a picture of the last frame"),
    "mp4": _Kind(lambda run, path, _: _pictures.write_film(run, path), ".mp4",
                 "a film in real time"),
    "pvd": _Kind(_record, ".pvd", "files for any ParaView"),
    "energy": _Kind(lambda run, path, _: _pictures.write_energies(run, path), "_energy.png",
                    "curves of the energies (.png, .svg, .pdf)"),
}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="msim-view", description="Show a recorded run in a window, or write it as:")
    parser.add_argument("run", metavar="RUN", help="a trajectory, .vtkhdf or .csv")
    kinds = parser.add_mutually_exclusive_group()
    for name, kind in _KINDS.items():
        kinds.add_argument(f"--{name}", dest="kind", action="store_const", const=name,
                           help=kind.doc)
    parser.add_argument("-o", metavar="FILE", dest="out",
                        help="the file to write; without it, one beside RUN")
    parser.add_argument("--force", action="store_true",
                        help="replace any file, not only what msim has written")
    return parser


def _show(run: Trajectory) -> None:
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or
                                                 os.environ.get("WAYLAND_DISPLAY")):
        raise UnsupportedError("there is no display for a window; use --html, --png or --mp4")
    view(run)


def _target(arguments: argparse.Namespace, kind: _Kind) -> str:
    """The file to write, which has the extension of its kind."""
    path = str(arguments.out or os.path.splitext(arguments.run)[0] + kind.ending)
    extension = kind.ending[kind.ending.index("."):]
    if arguments.kind != "energy" and os.path.splitext(path)[1] != extension:
        raise ArgumentError(f"-o {path}: the file of --{arguments.kind} must end in {extension}")
    return path


def _execute(arguments: argparse.Namespace) -> None:
    if arguments.kind is None and arguments.out is not None:
        raise ArgumentError(f"-o {arguments.out}: say what to write: --{', --'.join(_KINDS)}")
    with Trajectory(arguments.run) as run:
        if len(run) == 0:
            raise UnsupportedError(f"{run.path} has no frames")
        if arguments.kind is None:
            _show(run)
            return
        kind = _KINDS[arguments.kind]
        target = _target(arguments, kind)
        kind.write(run, target, arguments.force)
        print(target)


def main(words: Sequence[str] | None = None) -> int:
    """Returns the exit status: 1 after an error, which is one sentence."""
    arguments = _parser().parse_args(words)
    try:
        _execute(arguments)
    except (Error, ImportError, OSError) as error:
        print("msim-view:", " ".join(str(error).split()), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0
