"""Tests of the measurements of msim_bench: rows, summary, every program compared, equal results."""

import os
import re
import shutil
import signal
import subprocess
import time

import support
from bench_support import BenchTest, Children

SCENE = ["linear", "--quick", "--scene", "cloth32"]
TUNING = {"OPENBLAS_CORETYPE": "Prescott", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


class Linear(Children):
    def check_times(self, row):
        self.assertGreater(row["ms"], 0)
        self.assertGreaterEqual(row["repeats"], 1)
        parts = [row.get(f"{part}_ms", 0) for part in ("force", "assemble", "factor", "solve")]
        self.assertLess(sum(parts), 3 * row["ms"])  # medians of each part, which need not add up
        if row["measure"] != "bare":
            self.assertLess(row["residual"], 1.01e-6)
        if row["measure"] == "step":
            ran = row["ran"]
            self.assertIn(ran, ("pcg", "cholmod") if row["solver"] == "auto" else (row["solver"],))
            self.assertGreaterEqual(row["threads"], 1)
        if row["solver"] == "pcg" or row["measure"] == "stock":
            self.assertGreater(row["iterations"], 10)

    def check_rows(self, rows):
        for row in rows:
            with self.subTest(row):
                self.assertIn(row["measure"], ("step", "bare", "default", "stock", "ratio",
                                               "disagreement", "reference"))
                if row["measure"] in ("ratio", "disagreement") and "solver" not in row:
                    continue
                self.assertIn(row["status"], ("ok", "failed", "left out"))
                if row["status"] == "ok":
                    self.check_times(row)
                else:
                    self.assertGreater(len(row["reason"]), 10)

    def test_small_scene(self):
        out = self.good(*SCENE, "--json", "out.json")
        self.assertEqual(self.files(), ["out.json"])
        result = self.result()
        self.assertEqual(set(result), {"bench", "quick", "machine", "rows", "summary"})
        self.assertEqual((result["bench"], result["quick"]), ("linear", True))
        self.assertLessEqual({"cores", "isa", "msim", "solvers", "references"},
                             set(result["machine"]))
        rows, summary = result["rows"], result["summary"]
        self.check_rows(rows)
        for solver in result["machine"]["solvers"]:
            self.assertTrue(self.find(rows, solver=solver, scene="cloth32"), solver)
        self.check_summary(result)
        self.check_printed(summary, out)

    def check_summary(self, result):
        rows, summary = result["rows"], result["summary"]
        expected = set()
        if "cholmod" in result["machine"]["solvers"]:
            if "default cholmod" in result["machine"]["references"]:
                expected.add("cholmod_step_over_default_cloth32")
            expected |= {"max_disagreement", "max_disagreement_stiff"}
        self.assertEqual(set(summary), {"cholmod_step_over_default_cloth32", "max_disagreement",
                                        "max_disagreement_stiff"})
        self.assertEqual({key for key in summary if summary[key] is not None}, expected)
        for key, k in ("max_disagreement", 1e3), ("max_disagreement_stiff", 1e5):
            if key in expected:
                largest = [row["largest"] for row in self.find(rows, measure="disagreement", k=k)
                           if "largest" in row]
                self.assertEqual((len(largest), max(largest)), (2, summary[key]))
                self.assertLess(summary[key], 1e-8)
        for row in self.find(rows, measure="ratio", name="cholmod_step_over_default"):
            self.assertEqual(row["ratio"], summary["cholmod_step_over_default_cloth32"])

    def test_references_know_nothing_of_our_environment(self):
        with self.start(*SCENE, env={**os.environ, **TUNING}) as process:
            self.wait_for_line(process, "cloth32")
            children = [child for child in self.children(process)
                        if "reference" in (child / "cmdline").read_text()]
            for child in children:
                names = re.findall(r"(?:\A|\0)([^=\0]*)=", (child / "environ").read_text())
                self.assertIn("PATH", names)
                self.assertEqual(set(names) & set(TUNING), set())
        support.require(children, "a reference program of msim_bench")

    def test_a_reference_that_dies_is_a_result(self):
        with self.start(*SCENE, "--json", "out.json") as process:
            self.wait_for_line(process, "cloth32")
            children = self.children(process)
            for child in children:
                if "reference" in (child / "cmdline").read_text():
                    os.kill(int(child.name), signal.SIGKILL)
            out, _ = process.communicate(timeout=100)
        self.assertEqual(process.returncode, 0)
        result = self.result()
        self.check_rows(result["rows"])
        self.assertIsNone(result["summary"]["cholmod_step_over_default_cloth32"])
        self.check_printed(result["summary"], out)
        self.assertEqual(self.find(result["rows"], measure="default", status="ok"), [])
        self.assertTrue(self.find(result["rows"], measure="step", status="ok"))


class Scaling(BenchTest):
    def test_small_scenes(self):
        out = self.good("scaling", "--quick", "--scene", "cloth32,cloth100,jelly8", "--threads",
                        "2", "--json", "out.json")
        result = self.result()
        self.assertEqual((result["bench"], result["quick"]), ("scaling", True))
        rows, summary = result["rows"], result["summary"]
        scenes = {"cloth32": 1024, "cloth100": 10000, "jelly8": 512}
        for scene, k in ("cloth32", 1e3), ("cloth100", 1e3), ("cloth100", 1e5), ("jelly8", 1e3):
            found = {row["solver"]: row for row in rows if (row["scene"], row["k"]) == (scene, k)}
            self.assertEqual(set(found), {"auto", "auto, 2 threads", "cholmod"})
            for solver, row in found.items():
                with self.subTest(f"{scene} {k} {solver}"):
                    self.check_row(row, scenes[scene], 2 if "2" in solver else 1)
            self.assertEqual(found["auto"]["iterations"], found["auto, 2 threads"]["iterations"])
        self.assertEqual(set(summary), {"iterations_growth_k_to_100k",
                                        "batch_efficiency_explicit_cloth32",
                                        "batch_efficiency_implicit_cloth32"})
        soft, stiff = (row["iterations"] for row in rows
                       if (row["scene"], row["solver"]) == ("cloth100", "auto"))
        self.assertAlmostEqual(summary["iterations_growth_k_to_100k"], stiff / soft)
        self.assertIn("iterations_growth_k_to_100k", out)

    def test_keys_of_a_large_cloth(self):
        out = self.good("scaling", "--quick", "--scene", "cloth500", "--threads", "2", "--json",
                        "out.json")
        summary = self.result()["summary"]
        self.assertEqual(set(summary), {"time_per_particle_growth_cloth64_to_cloth500",
                                        "pcg_iteration_triad_fraction_cloth500",
                                        "two_threads_implicit_cloth500"})
        for key, value in summary.items():  # null: the machine was too busy for its steps
            self.assertTrue(value is None or value > 0, key)
        self.check_printed(summary, out)

    def check_row(self, row, particles, threads):
        self.assertEqual(row["particles"], particles)
        self.assertAlmostEqual(row["h"], 1 / 60)
        if row["status"] != "ok":
            self.assertEqual(row["solver"], "cholmod")  # the only one that may be missing
            self.assertGreater(len(row["reason"]), 10)
            return
        self.assertGreater(row["ms"], 0)
        self.assertEqual(row["threads"], threads)
        self.assertTrue(0 < row["t"] <= 0.5)
        self.assertEqual(row.get("iterations", 0) > 0, row["ran"] == "pcg")


class Step(BenchTest):
    METHODS = ["Newton, pcg", "Newton, cholmod", "projective dynamics", "L-BFGS"]
    ENDS = "ok", "cut off", "other minimum", "failed", "left out"

    def test_small_scene(self):
        out = self.good("step", "--quick", "--scene", "cloth32", "--json", "out.json")
        result = self.result()
        self.assertEqual((result["bench"], result["quick"]), ("step", True))
        found, unsolved, cases = [], 0, 0
        for k in 1e3, 1e5:
            for steps in 60, 240:
                rows = [row for row in result["rows"]
                        if row["k"] == k and round(1 / row["h"]) == steps]
                with self.subTest(f"k = {k}, h = 1/{steps}"):
                    self.check_case(rows)
                    self.check_descents(rows, (k, steps) == (1e3, 240))
                found += self.find(rows, measure="ratio", name="newton_over_prefactored")
                unsolved += bool(self.find(rows, measure="solution", status="failed"))
                cases += self.is_case(rows)
        self.check_summary(result, out)
        self.assertEqual(result["summary"]["newton_over_prefactored_cases"], cases)
        self.check_prefactored(result["summary"], found, unsolved)

    def is_case(self, rows):
        """Newton's method was run, and failed or agrees with a reference that was run."""
        tried = [row["method"] for row in self.find(rows, measure="step", accuracy=1e-4)
                 if row["status"] != "left out"]
        solved = self.find(rows, method="Newton, pcg", accuracy=1e-4, status="ok")
        return bool(self.find(rows, measure="solution", status="failed") or
                    "Newton, pcg" in tried and (not solved or set(tried) & set(self.METHODS[2:])))

    def check_prefactored(self, summary, found, unsolved):
        """Each case counts: one that Newton's method does not solve as the worst, one that the
        references do not solve with the time limit."""
        unsolved += len([row for row in found if row["ratio"] is None])
        bounds = self.find(found, is_upper_bound=True)
        ratios = [row["ratio"] for row in found if row["ratio"] is not None]
        key = "newton_over_prefactored"
        self.assertEqual(summary[key], None if unsolved or not ratios else max(ratios))
        self.assertEqual(summary[f"{key}_cases"], len(ratios) + unsolved)
        self.assertEqual(summary[f"{key}_bounds"], len(bounds))
        self.assertEqual(summary[f"{key}_unsolved"], unsolved)
        for row in bounds:
            self.assertRegex(row["reason"], "(L-BFGS|projective dynamics): .{10}")

    def check_case(self, rows):
        """Every program listed as present has results; the others have a reason."""
        solution, = self.find(rows, measure="solution")
        if solution["status"] != "ok":
            self.assertGreater(len(solution["reason"]), 10)
            self.assertEqual(len(rows), 1)
            return
        self.assertLess(solution["residual"], 1e-9)
        self.assertGreaterEqual(solution["iterations"], 1)
        arrivals = self.find(rows, measure="step")
        self.assertEqual([(row["method"], row["accuracy"]) for row in arrivals],
                         [(name, a) for name in self.METHODS for a in (1e-2, 1e-4, 1e-6)])
        for row in arrivals:
            self.assertIn(row["status"], self.ENDS)
            if row["status"] != "ok":
                self.assertGreater(len(row["reason"]), 10)
                self.assertEqual(row["status"] == "cut off", "at_least_ms" in row)
                self.assertNotIn("ms", row)
                continue
            self.assertLess(row["error"], row["accuracy"])
            self.assertGreater(row["ms"], 0)
            self.assertGreaterEqual(row["iterations"], 1)
            self.assertEqual("newton_rtol" in row, row["method"] in self.METHODS[:2])

    def check_descents(self, rows, is_easy):
        """They minimize the potential of the same step, and converge in easy cases."""
        for row in self.find(rows, measure="step", method="L-BFGS", accuracy=1e-2):
            if "cholmod" in row.get("reason", "") or "limit of the benchmark" in row.get("reason", ""):
                continue
            self.assertIn(row["status"], ("ok",) if is_easy else ("ok", "cut off"))

    def check_summary(self, result, out):
        rows, summary = result["rows"], result["summary"]
        self.assertEqual({key.replace("newton_over_", "") for key in summary},
                         {"tuned_factor_cloth32", "prefactored", "prefactored_cases",
                          "prefactored_bounds", "prefactored_unsolved"})
        for row in self.find(rows, measure="ratio", name="newton_over_tuned_factor", k=1e3):
            if round(1 / row["h"]) == 60:
                self.assertEqual(summary["newton_over_tuned_factor_cloth32"], row["ratio"])
        for factor in self.find(rows, measure="factor"):
            self.assertEqual(factor["status"] == "ok", factor.get("ms", 0) > 0)
        self.check_printed(summary, out)


class Forces(BenchTest):
    KEYS = {"cloth100": {"explicit_step_speedup_cloth100", "single_speedup_cloth100"},
            "cloth500": {"triad_fraction_cloth500", "two_threads_cloth500",
                         "single_speedup_cloth500"},
            "mesh500": {"irregular_speedup", "single_speedup_random"}, "cloth32": set(),
            "mesh100": set()}

    def check_scene(self, rows, cores):
        """The programs compared are listed, and their results agree."""
        scene, = self.find(rows, measure="scene")
        self.assertLess(scene["difference"], 1e-12)
        self.assertGreater(scene["bytes_per_step"], 104 * scene["particles"])
        runs = [row for row in rows if row["measure"] in ("step", "triad")]
        expected = {("msim", 1), ("msim single", 1), ("textbook", 1), ("triad", 1)}
        if cores > 1:
            expected |= {("msim", 2), ("triad", 2)}
        self.assertEqual({(row["name"], row["threads"]) for row in runs}, expected)
        for row in runs:
            self.assertEqual((row["status"], row["repeats"]), ("ok", 5))
            self.assertAlmostEqual(row["gb_per_s"] * row["us"] * 1e3, scene["bytes_per_step"],
                                   delta=1e-6 * scene["bytes_per_step"])
        for row in self.find(runs, measure="step"):
            self.assertAlmostEqual(row["springs_per_s"] * row["us"] * 1e-6, scene["springs"],
                                   delta=1e-6 * scene["springs"])

    def test_rows_and_summary(self):
        names = "cloth32", "cloth100", "mesh100"
        self.good("forces", "--quick", "--scene", ",".join(names), "--json", "out.json")
        result = self.result()
        self.assertEqual((result["bench"], result["quick"]), ("forces", True))
        for name in names:
            self.check_scene(self.find(result["rows"], scene=name), result["machine"]["cores"])
        self.assertEqual(set(result["summary"]), set().union(*map(self.KEYS.get, names)))
        speedup, = self.find(result["rows"], scene="cloth100", measure="ratio", name="speedup")
        self.assertEqual(speedup["ratio"], result["summary"]["explicit_step_speedup_cloth100"])
        self.assertGreater(speedup["ratio"], 1)

    def test_textbook_has_the_instruction_set_of_msim(self):
        for isa in "baseline", "avx2":
            with self.subTest(isa):
                self.good("forces", "--quick", "--scene", "cloth32", "--json", "out.json",
                          env={**os.environ, "MSIM_ISA": isa})
                result = self.result()
                row, = self.find(result["rows"], name="textbook")
                if isa in ["baseline"] + result["machine"]["isa"]:
                    self.assertEqual(row["isa"], isa)

    def test_all_scenes_in_a_minute(self):
        start = time.monotonic()
        self.good("forces", "--quick", "--json", "out.json")
        self.assertLess(time.monotonic() - start, 60)
        expected = set().union(*self.KEYS.values())
        if self.result()["machine"]["cores"] == 1:
            expected.remove("two_threads_cloth500")
        self.assertEqual(set(self.result()["summary"]), expected)


class Distributed(BenchTest):
    KEYS = {"explicit_speedup_2", "explicit_speedup_2_independent", "implicit_step_speedup_2",
            "one_rank_over_alone_explicit", "one_rank_over_alone_implicit",
            "iterations_over_alone", "iterations_over_alone_16",
            "iterations_over_alone_first_steps",
            "halo_bytes_over_model_2", "halo_bytes_over_model_64", "largest_over_mean",
            "bytes_a_particle_explicit", "bytes_a_particle_implicit"}

    def test_threads(self):
        out = self.good("distributed", "--quick", "--ranks", "1,2", "--json", "out.json")
        result = self.result()
        rows, summary = result["rows"], result["summary"]
        self.assertEqual(set(summary), self.KEYS)
        self.check_printed(summary, out)
        for row in self.find(rows, measure="strong"):
            with self.subTest(row):
                self.check_row(row)
        halves = self.find(rows, measure="halves")
        self.assertEqual([(row["ranks"], "exchanges" in row) for row in halves], 2 * [(2, False)])
        self.assertEqual(summary["explicit_speedup_2_independent"],
                         min(row["speedup"] for row in halves))
        self.check_parts(rows, summary)
        self.check_counts(rows, summary)
        self.check_model(self.find(rows, measure="model"))

    def check_row(self, row):
        self.assertEqual(row["status"], "ok")
        self.assertGreater(row["ms"], 0)
        self.assertEqual("exchanges" in row, row["ranks"] > 1)
        self.assertEqual(row.get("iterations", 0) > 0, row["method"] == "implicit")
        if row["ranks"] > 1 and row["method"] == "explicit":  # 20 forces, and one of the start
            self.assertAlmostEqual(row["exchanges"], 21 / 20)
        if row["contestant"] == "1 rank":
            alone = self.find(self.result()["rows"], measure="strong", scene=row["scene"],
                              contestant="alone")[0]
            self.assertEqual(row.get("iterations"), alone.get("iterations"))

    def check_parts(self, rows, summary):
        """The border of a half: two layers of a cloth of 64 x 64, one of a jelly of 16^3; inside
        there are 8 s + 16 and 6 s^2 + 12 s + 8 ghosts."""
        parts = {(row["scene"], row["ranks"]): row for row in self.find(rows, measure="parts")}
        self.assertEqual(parts["cloth64", 2]["bytes"], 24 * 2 * 64)
        self.assertEqual(parts["jelly16", 2]["bytes"], 24 * 16 * 16)
        self.assertEqual(parts["cloth64", 64]["model_bytes"], 24 * (8 * 8 + 16))
        self.assertAlmostEqual(parts["jelly16", 64]["model_bytes"], 24 * (6 * 16 + 12 * 4 + 8))
        self.assertEqual(summary["halo_bytes_over_model_2"], 1)
        self.assertLessEqual(summary["halo_bytes_over_model_64"], 1.15)
        self.assertLessEqual(summary["largest_over_mean"], 1.01)

    def check_counts(self, rows, summary):
        self.assertLessEqual(summary["iterations_over_alone"], 1.25)
        self.assertLessEqual(summary["iterations_over_alone_16"], 1.4)
        self.assertLessEqual(summary["iterations_over_alone_first_steps"], 1.25)
        memory = {(row["method"], row["ranks"]): row["bytes_a_particle"]
                  for row in self.find(rows, measure="memory")}
        for method in "explicit", "implicit":
            one, two = memory[method, 1], memory[method, 2]
            self.assertEqual(summary[f"bytes_a_particle_{method}"], one)
            # the scene, 209, on a further rank, and on both what they keep, cut beside the whole
            self.assertTrue(0 < two - one < 209 + 2 * 2 * 270, (one, two))

    def check_model(self, rows):
        self.assertEqual([row["ranks"] for row in rows], [64, 512, 4096])
        for row, more in zip(rows, rows[1:]):
            self.assertAlmostEqual(row["gb_explicit"] / more["gb_explicit"], 8)
            for key in "cloth_ms", "solid_ms", "iteration_ms":
                self.assertTrue(1 < row[key] / more[key] < 8)
            for key in "cloth_efficiency", "solid_efficiency":
                self.assertTrue(1 > row[key] > more[key] > 0)

    def test_processes(self):
        support.require(shutil.which("mpirun"), "mpirun")
        environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1",
                       "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                       "OMPI_MCA_rmaps_base_oversubscribe": "1",
                       "OMPI_MCA_mpi_yield_when_idle": "1"}
        command = ["mpirun", "-n", "2", self.PROGRAM, "distributed", "--quick"]
        done = subprocess.run([*command, "--json", "out.json"], cwd=self.folder, env=environment,
                              text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=100)
        support.require("msim_comm_mpi" not in done.stderr, "the plugin mpi")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        result = self.result()
        self.check_printed(result["summary"], done.stdout)
        self.assertEqual(done.stdout.count("Summary"), 1)
        self.assertEqual({row["ranks"] for row in result["rows"]}, {1, 2})
        done = subprocess.run([*command, "--ranks", "2"], cwd=self.folder, env=environment,
                              text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=100)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("omit --ranks", done.stderr)


if __name__ == "__main__":
    support.main()
