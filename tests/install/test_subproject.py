"""Tests that the program of docs/c_program.md builds with msim as a subproject, by FetchContent and
by add_subdirectory."""
import json
import os
import tempfile
import unittest
from pathlib import Path

import support

HERE = Path(__file__).resolve().parent / "subproject"


class Subproject(unittest.TestCase):
    def setUp(self):
        # beside the other builds, so that ccache sees the same relative paths
        beside = Path(support.setting("BUILD")).parent
        folder = tempfile.TemporaryDirectory(prefix="msim-subproject-", dir=beside)
        self.addCleanup(folder.cleanup)
        self.build = Path(folder.name)

    def configure(self, *options):
        support.run(support.setting("CMAKE"), "-S", HERE, "-B", self.build,
                    f"-DMSIM_SOURCE={support.SOURCE}", "-DMSIM_BACKENDS=none",
                    f"-DCMAKE_C_COMPILER={support.setting('CC')}", *options)

    def test_fetch_content(self):
        """The subproject builds no tests and no tools, and installs nothing."""
        # With a cache the objects of the release build, without one a third of its time
        cached = "CMAKE_C_COMPILER_LAUNCHER" in os.environ
        self.configure("-DFETCH=ON", "-DMSIM_WERROR=ON",
                       f"-DCMAKE_BUILD_TYPE={'Release' if cached else 'Debug'}")
        support.run(support.setting("CMAKE"), "--build", self.build)
        self.assertRegex(support.run(self.build / "pendulum"), r"^t = 2 s, x = \S+ \S+ \S+ m\n$")
        built = {path.name for path in self.build.rglob("*") if path.is_file()}
        self.assertEqual(built & {"msim_cli", "msim_bench", "test_vector"}, set())

    def test_add_subdirectory(self):
        """The subproject has the targets of the package; CMake fails where one is missing."""
        self.configure()
        self.assertTrue((self.build / "msim/cmake_install.cmake").is_file())

    def optimizations(self, *options):
        """The sets of words -O... of msim's compile commands and of the parent's."""
        self.configure("-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", "-DMSIM_BACKENDS=auto", *options)
        commands = json.loads((self.build / "compile_commands.json").read_text())
        levels = {True: set(), False: set()}
        for command in commands:
            ours = not command["file"].endswith("pendulum.c")
            words = [word for word in command["command"].split() if word.startswith("-O")]
            levels[ours].add(" ".join(words))
        return levels[True], levels[False]

    def test_without_a_build_type(self):
        """msim and its plugins are optimized, and only they."""
        self.assertEqual(self.optimizations("-DCMAKE_C_FLAGS="), ({"-O3"}, {""}))

    def test_with_a_build_type(self):
        """What the parent project chooses is kept."""
        self.assertEqual(self.optimizations("-DCMAKE_C_FLAGS=", "-DCMAKE_BUILD_TYPE=Debug"),
                         ({""}, {""}))
        self.assertEqual(self.optimizations("-DCMAKE_C_FLAGS=-g -O1", "-DCMAKE_BUILD_TYPE="),
                         ({"-O1"}, {"-O1"}))


if __name__ == "__main__":
    support.main()
