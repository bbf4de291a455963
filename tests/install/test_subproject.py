"""Tests that the program of docs/c_program.md builds with msim as a subproject, by FetchContent and
by add_subdirectory."""
import tempfile
import unittest
from pathlib import Path

import support

HERE = Path(__file__).resolve().parent / "subproject"


class Subproject(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="msim-subproject-")
        self.addCleanup(folder.cleanup)
        self.build = Path(folder.name)

    def configure(self, *options):
        support.run(support.setting("CMAKE"), "-S", HERE, "-B", self.build,
                    f"-DMSIM_SOURCE={support.SOURCE}", "-DMSIM_BACKENDS=none",
                    f"-DCMAKE_C_COMPILER={support.setting('CC')}", *options)

    def test_fetch_content(self):
        """The subproject builds no tests and no tools, and installs nothing."""
        self.configure("-DFETCH=ON")
        support.run(support.setting("CMAKE"), "--build", self.build)
        self.assertRegex(support.run(self.build / "pendulum"), r"^t = 2 s, x = \S+ \S+ \S+ m\n$")
        built = {path.name for path in self.build.rglob("*") if path.is_file()}
        self.assertEqual(built & {"msim_cli", "msim_bench", "test_vector"}, set())

    def test_add_subdirectory(self):
        """The subproject has the targets of the package; CMake fails where one is missing."""
        self.configure()
        self.assertTrue((self.build / "msim/cmake_install.cmake").is_file())


if __name__ == "__main__":
    support.main()
