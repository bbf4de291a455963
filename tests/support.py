"""What the tests in Python share: where things are, and exit status 77 where all was skipped."""
import os
import subprocess
import sys
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parent.parent
os.environ.pop("MSIM_PLUGIN_PATH", None)  # plugins are found by themselves, or a test fails


def setting(name):
    """What CMake says about this build, see msim_python_test in CMakeLists.txt."""
    try:
        return os.environ["MSIM_" + name]
    except KeyError:
        raise unittest.SkipTest(f"MSIM_{name} is not set: run this by ctest") from None


def require(there, what):
    """Skips the test where what it needs is missing, or fails it where nothing should be, as in
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
    """Runs a command and returns what it printed; a failure shows all of it."""
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
