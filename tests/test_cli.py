"""Tests of the interface of msim_cli for users and scripts: help, refusals, options, files."""

import json
import math
import os
import re
import subprocess
import unittest
from pathlib import Path

import support
from cli_support import (CLI, INTEGRATORS, OPTIONS, COUNTERS, SECONDS, PENDULUM, SCENES, pendulum,
                         CliTest)


class Help(CliTest):
    def test_program(self):
        out = self.good("--help")
        for word in ("Usage: msim_cli", "run SCENE", "explain SCENE", "list"):
            self.assertIn(word, out)

    def test_version(self):
        self.assertRegex(self.good("--version"), r"\Amsim_cli \d+\.\d+\.\d+\n\Z")

    def test_commands_name_every_option(self):
        for command in ("run", "explain"):
            out = self.good(command, "--help")
            for option in OPTIONS:
                self.assertRegex(out, rf"(?m)^  --{re.escape(option)} ")
        out = self.good("run", "--help")
        self.assertIn("default 1e-3", out)
        self.assertIn("exact | clamp", " ".join(out.split()))
        for flag in ("--out FILE", "--final FILE.json", "--energies FILE.csv", "--reactions FILE.csv",
                     "--springs FILE.csv", "--init FINAL.json",
                     "--quiet", "--stats"):
            self.assertIn(flag, out)
        self.assertNotIn("--final", self.good("explain", "--help"))

    def test_lines_fit_a_terminal(self):
        for args in (["--help"], ["run", "--help"], ["explain", "--help"], ["list", "--help"]):
            self.assertLessEqual(max(map(len, self.good(*args).splitlines())), 80)

    def test_short_flags(self):
        self.assertEqual(self.good("-h"), self.good("--help"))
        self.assertEqual(self.good("-V"), self.good("--version"))
        self.assertEqual(self.good("run", "-h"), self.good("run", "--help"))

    def test_help_wins_over_what_else_is_missing(self):
        self.assertIn("Usage", self.good("run", "--h", "1", "--help"))

    def test_example_runs_as_printed(self):
        text = self.good("--help")
        lines = [line for line in text[:text.index("Commands:")].splitlines() if line[:2] == "  "]
        path = f"{Path(CLI).parent}:{os.environ['PATH']}"
        done = subprocess.run(["sh", "-ec", "\n".join(lines)], cwd=self.folder, text=True,
                              env={**os.environ, "PATH": path}, capture_output=True, timeout=100)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(self.files(), ["rope.csv", "rope.json"])
        self.assertEqual(self.frames("rope.csv")[-1], 2000)

    def test_list(self):
        out = self.good("list")
        for name in (*INTEGRATORS, "pcg", "cholmod", "klu", "sundials-pcg", "csv", "hdf5", "mpi"):
            self.assertRegex(out, rf"(?m)^  {name} ")
        self.assertRegex(out, r"(?m)^  verlet +2 +explicit ")
        self.assertRegex(out, r"(?m)^  linearly-implicit-euler +1 +implicit ")
        self.assertRegex(out, r"(?m)^  auto +- +- +chooses the least expensive")
        self.assertRegex(out, r"(?m)^  pcg +yes ")

    def test_list_says_why_a_plugin_is_not_available(self):
        support.shared_library()  # static programs have no communicator
        support.require(re.search(r"(?m)^  mpi +yes +\S+.* \d", self.good("list")), "the plugin mpi")
        (self.folder / "plugins").mkdir()
        self.write("plugins/msim_comm_mpi.so", "none")
        out = self.good("list", "--plugin_path", "plugins")
        self.assertRegex(out, r"(?s)\n  mpi +no +communicator 'mpi':.*msim_comm_mpi\.so")


class Refusals(CliTest):
    def check(self, table):
        for args, *words in table:
            with self.subTest(" ".join(args)):
                self.assert_refused(args, *words)

    def test_command_line(self):
        self.scene()
        run = ["run", "scene.json"]
        self.check([
            ([], "run, rest, modes, explain or list", "'msim_cli --help'"),
            (["rum"], "'rum'", "--help"),
            (["run"], "needs a scene", "'msim_cli run --help'"),
            (["explain"], "needs a scene", "'msim_cli explain --help'"),
            (["rest", ""], "needs a scene", "'msim_cli rest --help'"),
            (["run", "scene.json", "b.json"], "b.json"),
            (["list", "scene.json"], "scene.json"),
            ([*run, "--stepz", "4"], "--stepz", "did you mean '--steps'?"),
            ([*run, "--finl", "x"], "did you mean '--final'?"),
            ([*run, "--step", "4"], "did you mean '--steps'?"),
            ([*run, "--solver.rtool=1"], "'--solver.rtool'", "did you mean '--solver.rtol'?"),
            ([*run, "--dt", "1e-3"], "did you mean '--h'?"),
            ([*run, "--t-end=3"], "did you mean '--t_end'?"),
            ([*run, "--output", "x.csv"], "did you mean '--out'?"),
            ([*run, "--qqqqqqqq"], "there is no option '--qqqqqqqq'; see"),
            ([*run, "-x"], "'-x'"),
            (["explain", "scene.json", "--out", "x.csv"], "--out"),
            (["list", "--h", "1"], "'--h'"),
            ([*run, "--h"], "--h needs a value"),
            ([*run, "--quiet=1"], "--quiet takes no value"),
            ([*run, "--h", "0"], "h is '0'", "number > 0"),
            ([*run, "--h", "abc"], "'abc'"),
            ([*run, "--h", "1e-3s"], "'1e-3s'"),
            ([*run, "--h", "0,001"], "number > 0 or auto, with a decimal point"),
            ([*run, "--h", "nan"], "'nan'"),
            ([*run, "--steps", "-1"], "'-1'"),
            ([*run, "--steps", "1.5"], "'1.5'"),
            ([*run, "--jacobian", "exakt"], "exact or clamp"),
            ([*run, "--every", "0"], "every"),
            ([*run, "--every", "2", "--fps", "3"], "--every", "--fps"),
            ([*run, "--out", ""], "--out"),
            ([*run, "--resume"], "--resume needs --out"),
            ([*run, "--resume", "--force", "--out", "out.vtkhdf"], "exclude each other"),
        ])

    def test_run(self):
        self.scene()
        self.write("bare.json", {**PENDULUM, "run": {}})
        self.write("broken.json", '{"msim": 1,\n "name" 3}')
        self.write("heavy.json", {**PENDULUM, "particles": {"x": [[0, 0, 0]], "mass": -1}})
        out = ["--out", "out.csv", "--final", "final.json"]
        self.check([
            (["run", "missing.json", *out], "missing.json"),
            (["run", ".", *out], "."),
            (["run", "broken.json", *out], "broken.json", "2"),
            (["run", "heavy.json", *out], "heavy.json", "mass"),
            (["run", "bare.json", "--steps", "1", *out], "--integrator", "msim_cli list",
             "'msim_cli explain bare.json' compares four"),
            (["run", "bare.json", "--integrator", "rk4", *out], "--steps", "--t_end"),
            (["run", "scene.json", "--integrator", "velocity-verlett", *out], "velocity-verlet'"),
            (["run", "scene.json", "--integrator", "auto", "--steps", "3", *out],
             "auto", "use t_end"),
            (["run", "scene.json", "--integrator", "linearly-implicit-euler", "--solver", "pgc",
              *out], "pgc", "'pcg'"),
            (["run", "scene.json", "--solver", "nonsense", *out], "unknown solver 'nonsense'"),
            (["run", "scene.json", "--integrator", "auto", "--solver", "pgc", *out], "pgc", "'pcg'"),
        ])

    def test_files(self):
        self.scene()
        (self.folder / "folder").mkdir()
        (self.folder / "folder.csv").mkdir()
        (self.folder / "link.json").symlink_to("scene.json")
        os.mkfifo(self.folder / "pipe")
        os.mkfifo(self.folder / "pipe.csv")
        run = ["run", "scene.json"]
        self.check([
            ([*run, "--out", "out.xyz"], "out.xyz", ".csv", ".vtkhdf"),
            ([*run, "--out", "out"], ".csv", ".vtkhdf"),
            ([*run, "--out", "missing/out.csv", "--final", "final.json"], "missing/out.csv"),
            ([*run, "--out", "scene.json/out.csv", "--final", "final.json"], "scene.json/out.csv"),
            ([*run, "--out", "folder.csv", "--final", "final.json"], "folder.csv", "a folder"),
            ([*run, "--out", "pipe.csv", "--final", "final.json"], "pipe.csv", "a pipe"),
            ([*run, "--out", "out.csv", "--final", "missing/final.json"], "missing/final.json"),
            ([*run, "--out", "out.csv", "--final", "folder"], "folder", "a folder"),
            ([*run, "--out", "out.csv", "--final", "pipe"], "pipe", "not a file"),
            ([*run, "--out", "same.csv", "--final", "./same.csv"], "same.csv", "both"),
            ([*run, "--final", "scene.json"], "scene.json", "is the scene"),
            ([*run, "--final", "folder/../scene.json"], "is the scene"),
            ([*run, "--final", "link.json"], "is the scene"),
            ([*run, "--out", "scene.json"], "is the scene"),
        ])
        self.assertEqual(json.loads((self.folder / "scene.json").read_text()), PENDULUM)
        self.assertTrue((self.folder / "pipe.csv").is_fifo())

    def test_init(self):
        self.scene()
        x, v = PENDULUM["particles"]["x"], PENDULUM["particles"]["v"]
        state = {"msim": 1, "x": x, "v": v}
        table = [
            ("{", "init.json:1"),
            ("[]", "'msim'"),
            ({"x": x, "v": v}, "'msim'"),
            ({**state, "msim": 2}, "msim must be 1"),
            ({"msim": 1, "v": v}, "'x'"),
            ({"msim": 1, "x": x}, "'v'"),
            ({**state, "x": x[:1]}, "x ", "2 triples"),
            ({**state, "v": 5}, "v ", "2 triples"),
            ({**state, "v": [v[0], [1, 2]]}, "v[1]", "three numbers"),
            ({**state, "x": [x[0], [1, None, 2]]}, "x[1][1]", "number"),
            ({**state, "v_half": [[0, 0, 0], 1]}, "v_half[1]"),
            ({**state, "step": -1}, "step"),
            ({**state, "step": 1.5}, "step"),
            ({**state, "t": "0"}, "t "),
            ({**state, "x": [[1, 0, 0], x[1]]}, "particle 0", "pinned"),
            ({**state, "t": 3}, "t_end"),
            (json.dumps(state)[:-1] + ', "x": []}', "init.json:1", "duplicate"),
            (json.dumps(state).replace("0.5", "NaN"), "init.json:1"),
            (json.dumps(state).replace("0.5", "1e999"), "init.json:1", "overflow"),
        ]
        for content, *words in table:
            with self.subTest(str(content)):
                self.write("init.json", content)
                self.assert_refused(["run", "scene.json", "--init", "init.json", "--out", "o.csv",
                                     "--final", "final.json"], "init.json", *words)
        self.assert_refused(["run", "scene.json", "--init", "no.json"], "no.json")
        self.write("init.csv", state)
        self.assert_refused(["run", "scene.json", "--init", "init.csv", "--out", "init.csv"],
                            "init.csv", "both")


class HDF5Scenes(CliTest):
    HERE = Path(__file__).parent

    def setUp(self):
        super().setUp()
        support.require(re.search(r"(?s)Importers.* hdf5 +yes ", self.good("list")),
                        "the importer hdf5")

    def test_run(self):
        path = self.HERE / "fuzz/corpus/hdf5/three_particles.h5"
        self.good("run", path, "--final", "hdf5.json", "--quiet")
        self.good("run", SCENES / "three_particles.json", "--final", "json.json", "--quiet")
        ends = [json.loads((self.folder / f"{name}.json").read_text()) for name in ("hdf5", "json")]
        self.assertEqual(ends[0]["x"], ends[1]["x"])

    @unittest.skipIf(os.environ.get("MSIM_SANITIZE"), "the sanitizer would report the crash")
    def test_a_crash_of_libhdf5_is_a_sentence(self):
        path = self.HERE / "fuzz/libhdf5/accum_read.h5"
        self.assert_refused(["explain", path], "accum_read.h5")


class Options(CliTest):
    def test_defaults_scene_command_line(self):
        self.scene(pendulum(integrator="rk4", t_end=0.05))
        self.assertEqual(self.run_final()["step"], 50)
        self.scene(pendulum(integrator="rk4", h=0.01, t_end=0.05))
        self.assertEqual(self.run_final()["step"], 5)
        self.assertEqual(self.run_final("--h", "0.005")["step"], 10)
        self.assertEqual(self.run_final("--h=0.025")["step"], 2)
        self.assertEqual(self.run_final("--h", "0.01", "--h", "0.005")["step"], 10)

    def test_integrator(self):
        self.scene()
        self.assertNotIn("v_half", self.run_final())
        self.assertIn("v_half", self.run_final("--integrator", "verlet"))

    def test_steps_win_over_the_scenes_end(self):
        self.scene()
        final = self.run_final("--steps", "7", "--h", "0.003")
        self.assertEqual((final["step"], final["t"]), (7, 7 * 0.003))

    def test_end_wins_over_the_scenes_steps(self):
        self.scene(pendulum(integrator="rk4", h=0.01, steps=3))
        self.assertEqual(self.run_final()["step"], 3)
        self.assertEqual(self.run_final("--t_end", "0.08")["step"], 8)
        self.assertEqual(self.run_final("--t_end", "0.08", "--steps", "2")["step"], 2)

    def test_both_ends_are_noted(self):
        self.scene()
        status, _, err = self.cli("run", "scene.json", "--t_end", "0.08", "--steps", "2")
        self.assertEqual(status, 0)
        self.assert_sentence(err, "note: t_end = 0.08 s is ignored: steps = 2 ends the run; remove")
        self.good("run", "scene.json", "--steps", "2")  # the command line replaces the scene's t_end
        self.scene(pendulum(integrator="rk4", h=0.01, steps=3, t_end=1))
        self.assert_sentence(self.cli("run", "scene.json")[2], "note: t_end = 1 s is ignored")

    def test_no_step(self):
        self.scene()
        final = self.run_final("--steps", "0")
        self.assertEqual((final["step"], final["x"]), (0, PENDULUM["particles"]["x"]))

    def test_frames_of_the_scene_are_overridden(self):
        out = ["--out", "out.csv", "--quiet", "--steps", "10"]
        self.scene(pendulum(integrator="rk4", h=0.01, every=4))
        self.good("run", "scene.json", *out)
        self.assertEqual(self.frames(), [0, 4, 8, 10])
        self.good("run", "scene.json", *out, "--fps", "20")
        self.assertEqual(self.frames(), [0, 5, 10])
        self.scene(pendulum(integrator="rk4", h=0.01, fps=20))
        self.good("run", "scene.json", *out, "--every", "6")
        self.assertEqual(self.frames(), [0, 6, 10])

    def test_operands_anywhere_and_after_dashes(self):
        self.write("--scene", PENDULUM)
        self.assertIn("pendulum", self.good("run", "--steps", "1", "--", "--scene"))
        self.scene()
        posix = {**os.environ, "POSIXLY_CORRECT": "1"}
        self.assertRegex(self.good("run", "scene.json", "--steps", "3", env=posix), r"steps +3 of")

    def test_every_integrator_runs(self):
        self.scene()
        for name in INTEGRATORS:
            with self.subTest(name):
                final = self.run_final("--integrator", name, "--steps", "20")
                self.assertEqual((final["step"], final["status"]), (20, "ok"))


class Control(CliTest):
    """Runs under error control."""

    def test_frames_are_at_their_times(self):
        self.scene()
        for name in ("dop853", "velocity-verlet", "implicit-midpoint"):
            with self.subTest(name):
                final = self.run_final("--integrator", name, "--tol", "1e-3", "--t_end", "0.3",
                                       "--fps", "40", "--out", "out.csv")
                times = sorted({float(row["t"]) for row in self.rows()})
                self.assertEqual(len(times), 13)
                for i, t in enumerate(times):
                    self.assertAlmostEqual(t, i / 40)
                self.assertEqual((final["t"], times[-1]), (0.3, 0.3))
                last = [row for row in self.rows() if float(row["t"]) == 0.3]
                self.assertEqual([[float(row[k]) for k in ("x", "y", "z")] for row in last],
                                 final["x"])

    def test_frames_by_steps(self):
        self.scene()
        args = ["--integrator", "dop853", "--t_end", "0.3", "--every", "5"]
        final = self.run_final(*args, "--out", "out.csv")
        steps = sorted({int(row["step"]) for row in self.rows()})
        self.assertEqual(steps, [*range(0, final["step"], 5), final["step"]])
        if re.search(r"(?m)^  hdf5 +yes ", self.good("list")):
            self.assert_refused(["run", "scene.json", *args, "--out", "out.vtkhdf"], "fps")

    def test_words(self):
        self.scene()
        out = self.good("explain", "scene.json", "--integrator", "dop853", "--t_end", "0.3")
        self.assertIn("tol = 1e-06", out)
        self.assertIn("to t = 0.3 s; 201 frames", out)
        out = self.good("run", "scene.json", "--tol", "1e-3", "--t_end", "0.3")
        self.assertRegex(out, r"steps +\d+, accepted with tol = 0.001; \d+ more were rejected")
        self.assert_refused(["run", "scene.json", "--tol", "1e-3", "--steps", "3"], "exclude")
        self.assert_refused(["run", "scene.json", "--tol", "1e-3", "--t_end", "1", "--integrator",
                             "respa"], "'respa' has no error control")


class Final(CliTest):
    def test_keys(self):
        self.scene()
        final = self.run_final("--integrator", "verlet")
        self.assertEqual(set(final), {"msim", "status", "step", "t", "h", "x", "v", "v_half",
                                      "reactions", "energy", "momentum", "angular_momentum",
                                      "stats"})
        self.assertEqual(set(final["energy"]), {"kinetic", "elastic", "gravitational", "total"})
        self.assertEqual(set(final["stats"]), COUNTERS | {"seconds"})
        self.assertEqual(set(final["stats"]["seconds"]), SECONDS)
        self.assertEqual((final["msim"], final["status"], final["step"]), (1, "ok", 100))
        self.assertAlmostEqual(final["t"], 0.1)
        self.assertEqual(final["stats"]["steps"], 100)
        for key in ("x", "v", "v_half", "reactions"):
            self.assertEqual([len(row) for row in final[key]], [3, 3])
        length = math.hypot(*final["x"][1])  # the support balances its weight and the spring
        for c, weight in enumerate((0, 0, -9.81)):
            pull = 100 * (length - 0.4) * final["x"][1][c] / length
            self.assertAlmostEqual(final["reactions"][0][c], -weight - pull, delta=1e-12)
        self.assertEqual(final["reactions"][1], [0, 0, 0])
        self.assertEqual(final["x"][0], [0, 0, 0])
        self.assertEqual(self.files(), ["final.json", "scene.json"])

    def test_islands(self):
        self.scene({"msim": 1, "gravity": [0, 0, -10], "particles": {
            "x": [[0, 0, 0], [1, 0, 0], [0, 0, -2]], "mass": 1, "pinned": [0]},
            "springs": {"ij": [[0, 1], [0, 2]], "k": [10, 20]}})
        final = self.run_final("--integrator", "velocity-verlet", "--h", "1e-3", "--steps", "100")
        islands = final["islands"]  # the pinned particle connects nothing, and is the last one
        self.assertEqual(set(islands), {"of", "kinetic", "elastic", "gravitational"})
        self.assertEqual(islands["of"], [2, 0, 1])
        for key in ("kinetic", "elastic", "gravitational"):
            self.assertAlmostEqual(sum(islands[key]), final["energy"][key], delta=1e-12)
        self.assertAlmostEqual(islands["elastic"][0], 10 / 2 * (math.hypot(*final["x"][1]) - 1)**2)
        self.assertEqual(islands["kinetic"][2], 0)

    def test_free_fall(self):
        self.scene({"msim": 1, "gravity": [0, 0, -10], "particles": {
            "x": [[1, 2, 3]], "v": [[1, 0, 0]], "mass": 2}})
        final = self.run_final("--integrator", "velocity-verlet", "--h", "0.25", "--steps", "4")
        self.assertNotIn("reactions", final)  # nothing is pinned
        self.assertNotIn("islands", final)  # there is one
        self.assertEqual((final["x"], final["v"], final["t"]), ([[2, 2, -2]], [[1, 0, -10]], 1))
        self.assertEqual(final["energy"], {"kinetic": 101, "elastic": 0, "gravitational": -40,
                                           "total": 61})
        self.assertEqual(final["momentum"], [2, 0, -20])
        self.assertEqual(final["angular_momentum"], [-40, 36, -4])

    def test_numbers_are_exact(self):
        self.scene()
        final = self.run_final("--out", "out.csv")
        rows = [row for row in self.rows() if int(row["step"]) == final["step"]]
        self.assertEqual([[float(row[k]) for k in ("x", "y", "z")] for row in rows], final["x"])
        self.assertEqual([[float(row[k]) for k in ("vx", "vy", "vz")] for row in rows], final["v"])

    def test_a_file_that_is_there_is_replaced_at_the_end_only(self):
        self.scene()
        old = self.run_final("--steps", "3")
        self.assert_refused(["run", "scene.json", "--final", "final.json", "--out", "no/o.csv"])
        self.assertEqual(self.final(), old)
        self.assertEqual(self.run_final()["step"], 100)


class Init(CliTest):
    def test_two_halves_are_the_whole(self):
        self.scene()
        for integrator in INTEGRATORS:
            with self.subTest(integrator):
                args = ["--integrator", integrator]
                whole = self.run_final(*args, "--steps", "20")
                self.run_final(*args, "--steps", "12")
                os.rename(self.folder / "final.json", self.folder / "half.json")
                final = self.run_final(*args, "--init", "half.json", "--steps", "8")
                self.assertEqual(final["step"], 20)
                self.assertAlmostEqual(final["t"], whole["t"])
                self.assertEqual((final["x"], final["v"]), (whole["x"], whole["v"]))
                self.assertEqual(final.get("v_half"), whole.get("v_half"))

    def test_end_time_counts_from_zero(self):
        self.scene()
        self.run_final("--t_end", "0.06")
        final = self.run_final("--init", "final.json", "--out", "out.csv", "--every", "30")
        self.assertEqual((final["step"], final["stats"]["steps"]), (100, 40))
        self.assertEqual(self.frames(), [60, 90, 100])
        self.assertAlmostEqual(float(self.rows()[0]["t"]), 0.06)

    def test_written_by_hand(self):
        self.scene()
        self.write("init.json", {"msim": 1, "x": [[0, 0, 0], [1, 2, 3]],
                                 "v": [[0, 0, 0], [0, 0, 0]]})
        final = self.run_final("--init", "init.json", "--steps", "0")
        self.assertEqual((final["step"], final["t"], final["x"][1]), (0, 0, [1, 2, 3]))


class Frames(CliTest):
    def run_csv(self, *args):
        self.scene()
        self.good("run", "scene.json", "--out", "out.csv", "--quiet", "--h", "0.01", *args)
        self.assertEqual(self.files(), ["out.csv", "scene.json"])
        return self.frames()

    def test_columns(self):
        self.assertEqual(self.run_csv("--steps", "1"), [0, 1])
        first = self.rows()[1]
        self.assertEqual(list(first), "step t particle x y z vx vy vz".split())
        self.assertEqual([float(value) for value in first.values()],
                         [0, 0, 1, 0.5, 0.1, 0, 0, 1, 0])
        self.assertEqual(len(self.rows()), 4)

    def test_every(self):
        self.assertEqual(self.run_csv("--steps", "10", "--every", "3"), [0, 3, 6, 9, 10])
        self.assertEqual(self.run_csv("--steps", "9", "--every", "3"), [0, 3, 6, 9])
        self.assertEqual(self.run_csv("--steps", "3", "--every", "1000"), [0, 3])

    def test_fps(self):
        """A frame is the first step at or after its time."""
        self.assertEqual(self.run_csv("--steps", "10", "--fps", "30"), [0, 4, 7, 10])
        self.assertEqual(self.run_csv("--steps", "10", "--fps", "50"), [0, 2, 4, 6, 8, 10])
        self.assertEqual(self.run_csv("--steps", "3", "--fps", "1000"), [0, 1, 2, 3])

    def test_about_200(self):
        steps = self.run_csv("--steps", "1999")
        self.assertTrue(190 <= len(steps) <= 210, len(steps))
        self.assertEqual((steps[0], steps[-1]), (0, 1999))

    def test_no_step(self):
        self.assertEqual(self.run_csv("--steps", "0"), [0])

    def test_bits_do_not_depend_on_who_watches(self):
        self.scene()
        alone = self.run_final("--steps", "5000")
        watched = self.run_final("--steps", "5000", "--out", "out.csv", "--every", "7")
        self.assertEqual((watched["x"], watched["v"]), (alone["x"], alone["v"]))

    def test_paraview(self):
        support.require(re.search(r"(?m)^  hdf5 +yes ", self.good("list")), "the recorder hdf5")
        self.scene()
        out = self.good("run", "scene.json", "--out", "out.vtkhdf")
        self.assertIn("ParaView", out)
        self.assertEqual((self.folder / "out.vtkhdf").read_bytes()[:8], b"\x89HDF\r\n\x1a\n")
        self.assertEqual(self.files(), ["out.vtkhdf", "scene.json"])


if __name__ == "__main__":
    support.main()
