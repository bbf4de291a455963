"""Helpers of the tests in Python: paths of the build, exit status 77 if every test was skipped."""
import os
import subprocess
import sys
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parent.parent
os.environ.pop("MSIM_PLUGIN_PATH", None)  # plugins must be found without it


def setting(name):
    """A variable that CMake sets for this build, see msim_python_test in CMakeLists.txt."""
    try:
        return os.environ["MSIM_" + name]
    except KeyError:
        raise unittest.SkipTest(f"MSIM_{name} is not set: run this by ctest") from None


def require(there, what):
    """Skips the test if a requirement is missing, or fails it if MSIM_COMPLETE is set, as by
    tools/check."""
    if not there:
        if "MSIM_COMPLETE" in os.environ:
            raise AssertionError(f"{what} is missing")
        raise unittest.SkipTest(f"{what} is missing")


def shared_library():
    if setting("SHARED") != "1":
        raise unittest.SkipTest("a static build has no libmsim.so and no plugin files")
    return Path(setting("LIBRARY"))


def plugins():
    """The plugins of this build: {"backend_cholmod": path, ...}"""
    folder = shared_library().parent / "msim"
    return {path.stem.removeprefix("msim_"): path for path in folder.glob("*.so")}


def run(*command, **options):
    """Runs a command and returns its output; on failure the output is shown."""
    done = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
    if done.returncode != 0:
        line = " ".join(str(word) for word in command)
        raise AssertionError(f"{line}\nexit status {done.returncode}\n{done.stdout}")
    return done.stdout


def main():
    result = unittest.main(argv=sys.argv[:1], exit=False, verbosity=2).result
    if not result.wasSuccessful():
        sys.exit(1)
    sys.exit(77 if result.testsRun == len(result.skipped) else 0)
