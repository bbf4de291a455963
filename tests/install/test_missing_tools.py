"""Tests that a configuration names each missing library or tool with the Debian package that brings
it. CMake runs on the sources while directories are hidden from it."""
import os
import re
import subprocess
import sys
import sysconfig
import tempfile
import unittest
from pathlib import Path

import support

SYSTEM = ["/usr/include", "/usr/local/include", "/usr/include/suitesparse", "/usr/include/hdf5/serial"]


def cached(name):
    """A value that the configuration of this build found"""
    cache = Path(support.setting("BUILD"), "CMakeCache.txt").read_text()
    return re.search(rf"^{name}:\w+=(.*)$", cache, re.M)[1]


class Configuration(unittest.TestCase):
    def configure(self, source, *options, environment=()):
        with tempfile.TemporaryDirectory(prefix="msim-missing-") as build:
            done = subprocess.run(
                [support.setting("CMAKE"), "-S", source, "-B", build,
                 f"-DCMAKE_C_COMPILER={support.setting('CC')}", *options], text=True,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=100, check=False,
                env={**os.environ, "PKG_CONFIG_LIBDIR": build, **dict(environment)})
        return done.returncode, " ".join(done.stdout.split())

    def assert_refused(self, words, source, *options, **keywords):
        status, text = self.configure(source, *options, **keywords)
        self.assertNotEqual(status, 0, text)
        self.assertIn(words, text)

    @staticmethod
    def hidden(*folders):
        return "-DCMAKE_IGNORE_PATH=" + ";".join(folders)


class MissingLibraries(Configuration):
    @staticmethod
    def jansson():
        return [f"-DMSIM_JANSSON_{part}={cached(f'MSIM_JANSSON_{part}')}"
                for part in ("LIBRARY", "INCLUDE_DIR")]

    def test_jansson(self):
        self.assert_refused("msim needs jansson: sudo apt install libjansson-dev", support.SOURCE,
                            self.hidden(*SYSTEM))

    def test_plugins(self):
        for name, packages in (("cholmod", "libsuitesparse-dev"), ("hdf5", "libhdf5-dev"),
                               ("klu", "libsundials-dev libsuitesparse-dev"),
                               ("mpi", "libopenmpi-dev"), ("petsc", "petsc-dev"), ("sundials", "libsundials-dev")):
            with self.subTest(name):
                self.assert_refused(f"whose library was not found: sudo apt install {packages}",
                                    support.SOURCE, self.hidden(*SYSTEM), *self.jansson(),
                                    f"-DMSIM_BACKENDS={name}")

    def test_plugins_that_are_not_asked_for(self):
        """The configuration passes, and says what each of them lacks."""
        status, text = self.configure(support.SOURCE, self.hidden(*SYSTEM), *self.jansson(),
                                      "-DMSIM_TESTS=OFF")
        self.assertEqual(status, 0, text)
        self.assertIn("plugin cholmod: OFF: sudo apt install libsuitesparse-dev", text)
        self.assertIn("plugin hdf5: OFF: sudo apt install libhdf5-dev", text)

    def test_cmocka(self):
        self.assert_refused("the tests need cmocka: sudo apt install libcmocka-dev, or omit them by "
                            "-DMSIM_TESTS=OFF", support.SOURCE,
                            "-DCMAKE_DISABLE_FIND_PACKAGE_cmocka=ON", "-DMSIM_BACKENDS=none")


class MissingToolsOfPython(Configuration):
    SOURCE = support.SOURCE / "tools/python"
    HERE = [f"-DPython_EXECUTABLE={sys.executable}"]

    def test_compiler(self):
        self.assert_refused("needs a C++ compiler", self.SOURCE, *self.HERE,
                            environment={"CXX": "/nonexistent/c++"})

    def test_headers(self):
        self.assert_refused("the headers of Python 3.10 or later", self.SOURCE, *self.HERE,
                            self.hidden(sysconfig.get_paths()["include"]))

    def test_all_at_once(self):
        self.assert_refused(
            "msim for Python needs a C++ compiler, the headers of Python 3.10 or later, jansson: "
            "sudo apt install g++ python3-dev libjansson-dev", self.SOURCE, *self.HERE,
            self.hidden(*SYSTEM, sysconfig.get_paths()["include"]),
            environment={"CXX": "/nonexistent/c++"})


if __name__ == "__main__":
    support.main()
