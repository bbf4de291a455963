"""Tests that C programs are linked with -static against an installed static msim, by the line of
pkg-config and by CMake, and compute the bits of those with the shared one. tools/full.sh (fully_static) builds
both; CHOLMOD is not among the plugins, as Debian 12 has no archive of METIS, which it needs."""
import os
import shlex
import subprocess
import tempfile
import unittest
from pathlib import Path

import support

HERE = Path(__file__).resolve().parent
BUILDS = {"static": support.SOURCE / "build/fully_static", "shared": support.SOURCE / "build/release"}
SOLVERS = ("auto", "klu", "sundials-pcg", "sundials-spgmr", "sundials-spfgmr", "sundials-spbcgs",
           "sundials-sptfqmr")


class FullyStatic(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="msim-static-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        for kind, build in BUILDS.items():
            support.run("cmake", "--install", build, "--prefix", cls.folder / kind)

    def link(self, kind, source):
        program = self.folder / f"{source.stem}_{kind}"
        flags = support.run("pkg-config", "--cflags", "--libs",
                            *(["--static"] if kind == "static" else []), "msim",
                            env={**os.environ,
                                 "PKG_CONFIG_PATH": str(self.folder / kind / "lib/pkgconfig")})
        support.run("gcc", "-static" if kind == "static" else f"-Wl,-rpath,{self.folder / kind}/lib",
                    source, "-o", program, *shlex.split(flags))
        return program

    def test_needs_nothing(self):
        headers = support.run("readelf", "--program-headers", "--dynamic",
                              self.link("static", HERE / "pendulum.c"))
        self.assertIn("There is no dynamic section", headers)
        self.assertNotIn("INTERP", headers)

    def try_pendulum(self, static):
        shared = self.link("shared", HERE / "pendulum.c")
        for arguments in (("velocity-verlet",),
                          *(("linearly-implicit-euler", solver) for solver in SOLVERS)):
            with self.subTest(arguments):
                result = support.run(static, *arguments)
                self.assertRegex(result, r"^t = 2 s, x = \S+ \S+ \S+ m\n$")
                self.assertEqual(result, support.run(shared, *arguments))

    def test_computes_the_same(self):
        self.try_pendulum(self.link("static", HERE / "pendulum.c"))

    def test_cmake(self):
        """A project that looks for archives only."""
        archives, build = self.folder / "archives.cmake", self.folder / "build"
        archives.write_text("set(CMAKE_FIND_LIBRARY_SUFFIXES .a)\n")
        support.run("cmake", "-S", HERE, "-B", build, f"-DCMAKE_PROJECT_INCLUDE={archives}",
                    f"-DCMAKE_PREFIX_PATH={self.folder / 'static'}",
                    "-DCMAKE_EXE_LINKER_FLAGS=-static")
        support.run("cmake", "--build", build)
        self.try_pendulum(build / "pendulum")

    def test_records_the_same(self):
        """A recording by HDF5 has the same bytes."""
        files = []
        for kind in BUILDS:
            files.append(self.folder / f"{kind}.vtkhdf")
            support.run(self.link(kind, HERE / "recording.c"),
                        support.SOURCE / "tools/scenes/rope.json", files[-1])
        self.assertGreater(files[0].stat().st_size, 10000)
        self.assertEqual(files[0].read_bytes(), files[1].read_bytes())

    def test_a_missing_plugin_is_an_error(self):
        done = subprocess.run([self.link("static", HERE / "pendulum.c"), "linearly-implicit-euler",
                               "cholmod"], text=True, capture_output=True, check=False,
                              env={"PATH": os.environ["PATH"]})
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("msim_backend_cholmod.so was not found in any folder", done.stderr)


if __name__ == "__main__":
    support.main()
