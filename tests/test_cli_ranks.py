"""Tests of msim_cli under mpirun: ranks share a scene, rank 0 prints and writes, all end together."""

import os
import shutil
import signal
import subprocess
import sys
import time

import support
from cli_support import CLI, FOR_EVER, CliTest

CLOTH = {
    "msim": 1,
    "gravity": [0, 0, -9.81],
    "objects": [{"type": "cloth", "n": [12, 12], "origin": [0, 0, 0], "row": [0, 1, 0],
                 "column": [1, 0, 0], "mass": 0.3, "k": {"structural": 100, "shear": 50},
                 "pinned": [0, 11]}],
    "run": {"integrator": "velocity-verlet", "h": 0.001, "steps": 100, "every": 20},
}
FILES = ["--out", "out.csv", "--final", "final.json", "--energies", "energies.csv", "--reactions",
         "reactions.csv", "--springs", "springs.csv"]


class Ranks(CliTest):
    PROGRAM = "mpirun"

    def setUp(self):
        super().setUp()
        self.scene(CLOTH)

    def ranks(self, n, *args):
        """Exit status, stdout and the messages of msim_cli, without those of mpirun."""
        return self.mpirun("-n", str(n), CLI, "run", *args)

    def mpirun(self, *args):
        status, out, err = self.cli(*args)
        return status, out, self.messages(err)

    def messages(self, err):
        return "".join(line for line in err.splitlines(True) if line.startswith("msim_cli: "))

    def contents(self, names):
        return [(self.folder / name).read_text() for name in names]

    def assert_failed(self, result, *words):
        """One sentence, status 1, and no file but the scene."""
        status, out, err = result
        self.assertEqual((status, out), (1, ""), err)
        self.assertRegex(err, r"\Amsim_cli: [^\n]{10,}\n\Z")
        for word in words:
            self.assertIn(word, err)
        self.assertEqual(self.files(), ["scene.json"])

    def test_files_have_the_bits_of_one_process(self):
        tables = [name for name in FILES if name.endswith(".csv")]
        subprocess.run([CLI, "run", "scene.json", *FILES, "--quiet"], cwd=self.folder, check=True)
        alone, state = self.contents(tables), self.final()
        self.assertEqual(len(alone), 4)
        for n in 2, 3, 4:
            status, out, err = self.ranks(n, "scene.json", *FILES, "--force")
            self.assertEqual((status, err), (0, ""))
            self.assertEqual(out.count("velocity-verlet"), 1)
            self.assertEqual(self.contents(tables), alone)
            self.assertEqual((self.final()["x"], self.final()["v"]), (state["x"], state["v"]))
            self.assertEqual(self.files(), sorted([*tables, "final.json", "scene.json"]))

    def test_init(self):
        self.assertEqual(self.ranks(2, "scene.json", "--final", "half.json")[0], 0)
        self.assertEqual(self.ranks(2, "scene.json", "--init", "half.json", "--final",
                                    "final.json")[::2], (0, ""))
        self.assertEqual(self.final()["step"], 200)

    def test_unreadable_scene_of_one_rank(self):
        began = time.monotonic()
        self.assert_failed(self.mpirun("-n", "2", CLI, "run", "scene.json", *FILES, ":", "-n", "1",
                                       CLI, "run", "missing.json", *FILES),
                           "rank 2 of 3 on host ", "missing.json: cannot be read")
        self.assertLess(time.monotonic() - began, 20)

    def test_different_inputs(self):
        self.assert_failed(self.mpirun("-n", "1", CLI, "run", "scene.json", *FILES, ":", "-n", "1",
                                       CLI, "run", "scene.json", *FILES, "--h", "0.0005"),
                           "rank 1 of 2 on host ", "another command line")
        self.assert_failed(self.mpirun("-n", "1", CLI, "run", "scene.json", ":", "-n", "1", CLI,
                                       "run", "scene.json", "--out", "out.csv"),
                           "rank 1 of 2 on host ", "another command line")

    def test_errors_have_one_sentence(self):
        for args, words in ((["--hh", "1"], ["rank 0 on host ", "'--hh'"]),
                            (["--out", "no/out.csv"], ["no/out.csv"]),
                            (["--energies", "no/e.csv", "--out", "out.csv"], ["no/e.csv"]),
                            (["--integrator", "respa", "--out", "out.csv"], ["2 ranks", "respa"]),
                            (["--resume", "--out", "out.csv"], ["cannot be resumed"])):
            with self.subTest(args[0]):
                self.assert_failed(self.ranks(2, "scene.json", *args), *words)

    def test_petsc(self):
        """The velocities of one process to the tolerance of the solver, by any KSP and PC."""
        rtol = 1e-9
        implicit = ["scene.json", "--integrator", "linearly-implicit-euler", "--h", "0.005", "--steps",
                    "10", "--solver.rtol", str(rtol), "--final", "final.json", "--force"]
        status, _, err = self.ranks(1, *implicit, "--solver", "petsc")
        support.require(status == 0, "the plugin petsc")
        subprocess.run([CLI, "run", *implicit, "--quiet"], cwd=self.folder, check=True)
        alone = [c for row in self.final()["v"] for c in row]
        for n, options in ((3, "-ksp_type cg -pc_type gamg"),
                           (2, "-ksp_type gmres -pc_type bjacobi"),
                           (3, "-ksp_type pipecg -pc_type msim")):
            with self.subTest(f"{n} {options}"):
                status, _, err = self.ranks(n, *implicit, "--solver", "petsc", "--solver.options",
                                            options)
                self.assertEqual((status, err), (0, ""))
                self.assertEqual(self.final()["step"], 10)
                self.assertGreater(self.final()["stats"]["iterations"], 20)
                off = max(abs(a - b) for a, b in zip(alone, (c for row in self.final()["v"]
                                                             for c in row)))
                self.assertLess(off, 10 * 10 * rtol * max(map(abs, alone)))
        os.remove(self.folder / "final.json")
        self.assert_failed(self.ranks(2, *implicit, "--solver", "petsc", "--solver.options",
                                      "-ksp_typ cg"), "-ksp_typ")
        self.assert_failed(self.ranks(2, *implicit, "--solver", "klu"), "2 ranks do not support",
                           "pcg or petsc")

    def test_plugin_that_cannot_be_opened(self):
        with self.subTest("several ranks"):
            os.mkdir(self.folder / "plugins")
            self.write("plugins/msim_comm_mpi.so", "none")
            status, out, err = self.ranks(2, "scene.json", "--out", "out.csv", "--plugin_path",
                                          "plugins")
            self.assertEqual((status, out), (1, ""))
            self.assert_sentence(err.replace("msim_cli", "mpirun"), "rank 0 on host ", "mpi")
        with self.subTest("one rank opens nothing"):
            status, _, err = self.ranks(1, "scene.json", "--out", "out.csv", "--plugin_path",
                                        "plugins")
            self.assertEqual((status, err), (0, ""))

    def start_ranks(self):
        return self.start("-n", "3", CLI, "run", "scene.json", *FOR_EVER, "--every", "100000",
                          "--out", "out.csv", "--final", "final.json")

    def processes(self, parent):
        """The ranks that mpirun has started."""
        with open(f"/proc/{parent.pid}/task/{parent.pid}/children", encoding="ascii") as children:
            return [int(word) for word in children.read().split()]

    def assert_stopped(self, err):
        final = self.final()
        self.assertEqual(final["status"], "stopped")
        self.assertRegex(self.messages(err), rf"\Amsim_cli: stopped at step {final['step']}, .*\n\Z")
        self.assertEqual(self.frames()[-1], final["step"])
        self.assertEqual(self.files(), ["final.json", "out.csv", "scene.json"])

    def test_signal_to_mpirun(self):
        """Open MPI forwards SIGUSR1; by others it ends itself with status 1, after its ranks."""
        for number in signal.SIGINT, signal.SIGTERM, signal.SIGUSR1:
            with self.subTest(number.name), self.start_ranks() as process:
                self.wait_for("out.csv")
                time.sleep(0.3)
                process.send_signal(number)
                _, err = process.communicate(timeout=30)
                self.assertIn(process.returncode, (2,) if number == signal.SIGUSR1 else (1, 2))
                self.assert_stopped(err)
                os.remove(self.folder / "out.csv")
                os.remove(self.folder / "final.json")

    def test_signal_to_one_rank(self):
        for which in 0, 2:
            with self.subTest(which), self.start_ranks() as process:
                self.wait_for("out.csv")
                time.sleep(0.3)
                os.kill(self.processes(process)[which], signal.SIGINT)
                _, err = process.communicate(timeout=30)
                self.assertEqual(process.returncode, 2)
                self.assert_stopped(err)
                os.remove(self.folder / "out.csv")
                os.remove(self.folder / "final.json")

    def test_killed_rank(self):
        with self.start_ranks() as process:
            self.wait_for("out.csv")
            os.kill(self.processes(process)[1], signal.SIGKILL)
            process.communicate(timeout=30)
            self.assertNotEqual(process.returncode, 0)


if __name__ == "__main__":
    os.environ["MALLOC_PERTURB_"] = "165"  # memory that was freed must not be read
    if shutil.which("mpirun") is None:
        sys.exit(77)
    support.main()
