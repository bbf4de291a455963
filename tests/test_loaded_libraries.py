"""Tests that a run loads only the libraries that it needs, as the dynamic linker of glibc lists
them (LD_DEBUG)."""
import json
import re
import tempfile
import unittest
from pathlib import Path

import support

SOLVERS = re.compile(r"lib(cholmod|amd|colamd|sundials\w*|openblas|blas|lapack|klu)\b")
HDF5 = re.compile(r"libhdf5")


class Loads(unittest.TestCase):
    def setUp(self):
        support.shared_library()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def libraries(self, *options):
        """Runs the hanging cloth and returns the libraries opened, and the final state."""
        final = self.folder / "final.json"
        scene = support.setting("SCENES") + "/hanging_cloth.json"
        support.run("env", "LD_DEBUG=files", f"LD_DEBUG_OUTPUT={self.folder}/linker",
                    support.setting("CLI"), "run", scene, "--steps", 5, "--h", "1e-5", "--quiet",
                    "--final", final, *options)
        text = "".join(log.read_text() for log in self.folder.glob("linker.*"))
        opened = set(re.findall(r"file=(\S+) \[\d+\];  generating link map", text))
        if not any("libmsim" in name for name in opened):
            self.skipTest("this dynamic linker does not support LD_DEBUG")
        return opened, json.loads(final.read_text())

    def assert_none(self, opened, pattern):
        self.assertEqual({name for name in opened if pattern.search(name)}, set())

    def assert_some(self, opened, pattern):
        self.assertTrue(any(pattern.search(name) for name in opened), opened)

    def test_explicit_run_loads_no_solver_and_no_hdf5(self):
        for integrator in ("verlet", "velocity-verlet"):
            opened, final = self.libraries("--integrator", integrator,
                                           "--out", self.folder / "frames.csv")
            self.assert_none(opened, SOLVERS)
            self.assert_none(opened, HDF5)
            for count in ("assemblies", "analyses", "factorizations", "solves", "iterations"):
                self.assertEqual(final["stats"][count], 0, count)

    def test_pcg_is_built_in(self):
        opened, final = self.libraries("--integrator", "linearly-implicit-euler", "--solver", "pcg",
                                       "--out", self.folder / "frames.csv")
        self.assert_none(opened, SOLVERS)
        self.assert_none(opened, HDF5)
        self.assertGreater(final["stats"]["solves"], 0)

    def test_cholmod_is_loaded_when_asked_for(self):
        support.require("backend_cholmod" in support.plugins(), "the plugin cholmod")
        opened, final = self.libraries("--integrator", "linearly-implicit-euler",
                                       "--solver", "cholmod")
        self.assert_some(opened, SOLVERS)
        self.assert_none(opened, HDF5)
        self.assertGreater(final["stats"]["solves"], 0)

    def test_hdf5_is_loaded_for_its_files_only(self):
        support.require("recorder_hdf5" in support.plugins(), "the plugin hdf5")
        opened, _ = self.libraries("--integrator", "verlet", "--out", self.folder / "a.vtkhdf")
        self.assert_some(opened, HDF5)
        self.assert_none(opened, SOLVERS)


if __name__ == "__main__":
    support.main()
