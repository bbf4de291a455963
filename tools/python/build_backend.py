"""The build backend: scikit-build-core, with msim's C sources beside it in source archives.

In a checkout they lie two folders above and may not be named there by a pyproject.toml. While an
archive is made they are copied to libmsim/, where an unpacked archive has them anyway.
"""
import contextlib
import shutil
from pathlib import Path

from scikit_build_core import build as _core
from scikit_build_core.build import *  # noqa: F403  the hooks that are not redefined below

_HERE = Path(__file__).resolve().parent
_ROOT = _HERE.parents[1]
_SOURCES = ["CMakeLists.txt", "LICENSE", "include", "src", "backends", "tools/cmake"]


def _copy(source, target):
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target)
    else:
        shutil.copy2(source, target)


@contextlib.contextmanager
def _staged(files):
    """Copies of {target: source} for the duration of a build, where they are missing."""
    missing = {_HERE / target: source for target, source in files.items()
               if not (_HERE / target).exists()}
    try:
        for target, source in missing.items():
            _copy(source, target)
        yield
    finally:
        for target in missing:
            shutil.rmtree(target) if target.is_dir() else target.unlink(missing_ok=True)
        if missing:
            shutil.rmtree(_HERE / "libmsim", ignore_errors=True)


def _license():
    return {"LICENSE": _ROOT / "LICENSE"}


def build_sdist(sdist_directory, config_settings=None):
    sources = {} if (_HERE / "libmsim").exists() else {
        f"libmsim/{name}": _ROOT / name for name in _SOURCES}
    with _staged({**_license(), **sources}):
        return _core.build_sdist(sdist_directory, config_settings)


def _with_license(hook):
    def staged(*arguments, **keywords):
        with _staged(_license()):
            return hook(*arguments, **keywords)
    return staged


build_wheel = _with_license(_core.build_wheel)
build_editable = _with_license(_core.build_editable)
prepare_metadata_for_build_wheel = _with_license(_core.prepare_metadata_for_build_wheel)
prepare_metadata_for_build_editable = _with_license(_core.prepare_metadata_for_build_editable)
