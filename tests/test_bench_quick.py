"""Tests of msim_bench linear, precision, stability and skip as a whole: all keys, within a minute,
also on a busy machine."""

import csv
import importlib.util
import math
import time

import support
from bench_support import BenchTest, plot_bench

ALONE = {"jacobian_over_force", "auto_slowdown_when_other_core_busy_cloth64"}
BESIDE_CHOLMOD = {"auto_over_tuned_cholmod_cloth64", "auto_over_tuned_cholmod_cloth100",
                  "auto_over_tuned_cholmod_cloth200", "auto_over_tuned_cholmod_jelly16",
                  "auto_over_tuned_cholmod_stiff_cloth100", "expanded_jacobian_over_force",
                  "cholmod_step_over_bare_cloth100",
                  "cholmod_slowdown_when_other_core_busy_cloth64"}
BESIDE_DEFAULT = {"auto_over_default_cholmod_cloth100", "cholmod_step_over_default_cloth32",
                  "cholmod_step_over_default_cloth64", "cholmod_step_over_default_cloth100"}
PRECISION = {"auto_over_best_p80", "auto_over_best_worst", "auto_over_best_cells",
             "auto_over_best_missing", "auto_over_best_empty", "respa_over_velocity_verlet",
             "error_over_tol_worst", "single_over_double_1e2", "single_over_double_1e3",
             "single_over_double_1e4"}
SCENES = ["trampoline", "folding", "stiff", "damped", "lightly_damped", "damped_rope",
          "damped_jelly", "jelly", "chain", "dumbbells", "slide", "cord"]
DAMPED = ["damped", "lightly_damped", "damped_rope", "damped_jelly"]
FREE = [name for name in SCENES if name not in [*DAMPED, "jelly", "dumbbells", "slide"]]
OVER_SUNDIALS = {"best_over_sundials_": ("best", FREE + DAMPED),
                 "damped_over_sundials_": ("best", DAMPED),
                 "auto_over_sundials_": ("auto", FREE),
                 "auto_over_sundials_damped_": ("auto", DAMPED)}
BESIDE_SUNDIALS = {f"{name}{error}" for name in OVER_SUNDIALS for error in ("1e4", "1e6", "1e8")}


class QuickTest(BenchTest):
    def run_quick(self, bench, *more):
        start = time.monotonic()
        out = self.good(bench, "--quick", "--json", "out.json", *more)
        self.assertLess(time.monotonic() - start, 60)
        result = self.result()
        self.check_printed(result["summary"], out)
        return result

    def check_table(self, rows):
        self.assertEqual(plot_bench("out.json", "--csv", "out.csv", cwd=self.folder), (0, ""))
        with (self.folder / "out.csv").open(newline="") as file:
            table = list(csv.DictReader(file))
        self.assertEqual([row["measure"] for row in table], [row["measure"] for row in rows])

    def check_picture(self, *words):
        if not importlib.util.find_spec("matplotlib"):
            return
        self.assertEqual(plot_bench("out.json", "--svg", "out.svg", cwd=self.folder), (0, ""))
        text = (self.folder / "out.svg").read_text()
        for word in words:
            self.assertIn(word, text)


class Quick(QuickTest):
    def check_keys(self, result, expected):
        """Methods without a result are those for which there was no time, or no library."""
        found = {key for key, value in result["summary"].items() if value is not None}
        self.assertEqual(found - expected, set())
        self.assertEqual(expected - set(result["summary"]), set())
        for key in found:
            self.assertGreater(result["summary"][key], 0)
        late = [row for row in result["rows"] if "the time limit" in row.get("reason", "")]
        if found != expected and late:
            self.skipTest("the machine is too busy for " + ", ".join(sorted(expected - found)))
        self.assertEqual(found, expected)

    def test_linear(self):
        result = self.run_quick("linear")
        machine = result["machine"]
        solvers, references = machine["solvers"], machine["references"]
        expected = set(ALONE)
        if len(set(solvers) - {"auto"}) > 1:
            expected |= {"max_disagreement", "max_disagreement_stiff"}
        if "cholmod" in solvers:
            expected |= BESIDE_CHOLMOD
            if "default cholmod" in references:
                expected |= BESIDE_DEFAULT
        elif "default cholmod" in references:
            expected.add("auto_over_default_cholmod_cloth100")
        if "sundials-pcg" in solvers:
            expected.add("sundials_pcg_over_builtin_per_iteration_cloth100")
            if "stock sundials" in references:
                expected.add("sundials_pcg_over_stock_cloth100")
        if machine["cores"] == 1:
            expected = {key for key in expected if "other_core" not in key}
        self.check_keys(result, expected)

    def test_precision(self):
        result = self.run_quick("precision")
        rows, found = result["rows"], result["summary"]
        expected = PRECISION | (BESIDE_SUNDIALS if "ode" in result["machine"] else set())
        self.assertEqual(set(found) - expected, set())
        for value in found.values():
            self.assertTrue(value is None or value >= 0, value)
        truths = self.find(rows, measure="truth")
        self.assertEqual([row["scene"] for row in truths], SCENES)
        for truth in truths:
            with self.subTest(truth["scene"]):
                self.check_truth(truth, self.find(rows, scene=truth["scene"]))
                self.check_auto(truth, self.find(rows, scene=truth["scene"]))
                self.check_cells(truth, self.find(rows, scene=truth["scene"]))
        self.check_auto_over_best(self.find(rows, measure="cell"), found)
        self.check_single(rows, found)
        if "ode" in result["machine"]:
            self.check_over_sundials(rows, found)
        if "ode" in result["machine"]:
            self.check_split(rows, "cord", {"ARKODE IMEX", "ARKODE MRI"})
            self.check_split(rows, "damped", {"ARKODE IMEX"})
            self.check_split(rows, "damped_jelly", {"ARKODE IMEX"})
            self.check_split(rows, "folding", set())
        self.check_order(rows, "velocity-verlet", 2)
        self.check_order(rows, "rk4", 4)
        self.check_table(rows)
        self.check_picture(*SCENES)

    def test_stability(self):
        result = self.run_quick("stability")
        rows, found = result["rows"], result["summary"]
        self.assertEqual(set(found), {"limit_error", "cells", "refused", "silent", "crashes",
                                      "hangs", "detection_steps"})
        self.assertLessEqual(found["limit_error"], 1e-3)
        self.assertEqual({row["method"] for row in self.find(rows, measure="limit")},
                         {row["method"] for row in self.find(rows, measure="method")})
        self.assertLessEqual(found["detection_steps"], 200)
        self.assertGreater(found["cells"], 500)
        self.assertEqual([found[key] for key in ("silent", "crashes", "hangs")], [0, 0, 0])
        cells = self.find(rows, measure="cell")
        refused = self.find(cells, outcome="refused")
        self.assertEqual(len(refused), found["refused"])
        self.assertEqual(len(cells), found["cells"] + found["refused"])
        for cell in refused:
            self.assertRegex(cell["reason"], "depend on positions only|does not support planes")
        for cell in self.find(cells, outcome="reported"):
            self.assertRegex(cell["reason"], r"\Astep \d+, t = ")
        for outcome in "stable", "dissipated", "reported":
            self.assertTrue(self.find(cells, outcome=outcome))
        self.check_picture("implicit-midpoint")

    def check_truth(self, truth, rows):
        """No error below the accuracy of the reference is reported."""
        if truth["status"] != "ok":
            self.assertGreater(len(truth["reason"]), 10)
            return
        for point in self.find(rows, measure="point"):
            self.assertIn(point["status"], ("ok", "refused", "failed"))
            if point["status"] == "ok":
                self.assertGreaterEqual(point["error"], 10 * truth["error"])
                self.assertGreater(point["evaluations"], 0)
                continue
            self.assertGreater(len(point["reason"]), 5)
            if point["status"] == "refused":
                self.assertLess(point["error"], 10 * truth["error"])
        for level in self.find(rows, measure="level"):
            self.assertGreaterEqual(level["error"], 10 * truth["error"] * max(1, truth["growth"]))
            self.assertGreater(level["ms"], 0)

    def check_auto(self, truth, rows):
        """Where it is fast, `auto` is measured down to small tol, also if stability limits its
        steps; with tol, errors are below ten times tol."""
        if truth["status"] != "ok":
            return
        if truth["scene"] not in ("jelly", "slide"):
            last = self.find(rows, measure="point", method="auto, tol")[-1]
            self.assertLess(last["tol"], 2e-6)
        for run in self.find(rows, measure="point", of="msim", status="ok"):
            if run.get("tol", 0) < 0.9e-8 or truth["growth"] > 100:
                continue
            self.assertLess(run["error"] * truth["motion"], 10 * run["tol"] * truth["extent"])

    def check_cells(self, truth, rows):
        """A row for each error that the reference resolves, with the fastest of each side."""
        if truth["status"] != "ok":
            return
        cells = self.find(rows, measure="cell")
        known = 10 * truth["error"] * max(1, truth["growth"])
        self.assertEqual([cell["error"] for cell in cells],
                         [error for error in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10) if known <= error])
        for cell in cells:
            levels = self.find(rows, measure="level", error=cell["error"])
            chosen = self.find(levels, method="auto, tol")
            named = [row for row in self.find(levels, of="msim") if row not in chosen]
            for key, found in [("auto_ms", chosen), ("best_ms", named),
                               ("sundials_ms", self.find(levels, of="sundials"))]:
                self.assertEqual(cell.get(key), min((row["ms"] for row in found), default=None))

    def check_single(self, rows, found):
        """The worst of three scenes, by the levels of the fastest methods where these are known."""
        for error in 1e-2, 1e-3, 1e-4:
            ratios = self.find(rows, measure="single", error=error)
            self.assertLessEqual({row["scene"] for row in ratios}, {"trampoline", "folding", "stiff"})
            key = f"single_over_double_{error:.0e}".replace("e-0", "e")
            known = [row["ratio"] for row in ratios if row.get("ratio") is not None]
            self.check_same(found.get(key), max(known, default=None))
            for row in ratios:
                levels = self.find(rows, measure="level", scene=row["scene"], error=error)
                best = {of: min((one["ms"] for one in self.find(levels, of=of)
                                 if one["method"] != "auto, tol"), default=None)
                        for of in ("msim", "msim single")}
                if levels and None not in best.values():
                    self.check_same(row["ratio"], best["msim single"] / best["msim"])

    @staticmethod
    def ratio(a, b):
        """A missing result counts as the worse one."""
        if b is None:
            return None if a is None else 0
        return math.inf if a is None else a / b

    def check_same(self, found, ratio):
        """JSON cannot represent infinity."""
        if ratio is None or math.isinf(ratio):
            self.assertIsNone(found)
        else:
            self.assertAlmostEqual(found, ratio, delta=1e-6 * ratio)

    def check_auto_over_best(self, cells, found):
        ratios = [self.ratio(cell.get("auto_ms"), cell.get("best_ms")) for cell in cells]
        known = [ratio for ratio in ratios if ratio is not None]
        self.assertEqual(found["auto_over_best_cells"], len(known))
        self.assertEqual(found["auto_over_best_missing"], known.count(math.inf))
        self.assertEqual(found["auto_over_best_empty"], ratios.count(None))
        self.check_same(found.get("auto_over_best_worst"), max(known))

    def check_over_sundials(self, rows, found):
        for kind, (name, scenes) in OVER_SUNDIALS.items():
            for error in 1e-4, 1e-6, 1e-8:
                cells = [cell for cell in self.find(rows, measure="cell", error=error)
                         if cell["scene"] in scenes]
                key = f"{kind}{error:.0e}".replace("e-0", "e")
                worst, = self.find(rows, measure="worst", name=key)
                self.assertEqual(worst["scenes"], len(cells))
                self.assertEqual(worst["without_sundials"],
                                 sum("sundials_ms" not in cell for cell in cells))
                ratios = [self.ratio(cell.get(f"{name}_ms"), cell.get("sundials_ms"))
                          for cell in cells]
                known = [ratio for ratio in ratios if ratio is not None]
                self.check_same(found.get(key), max(known, default=None))

    def check_split(self, rows, scene, expected):
        """Multirate methods take part where the forces are split, and their results agree with
        those of the others, which get the faster forces."""
        rows = self.find(rows, scene=scene)
        kernel, = self.find(rows, measure="kernel")
        self.assertEqual("split_difference" in kernel, bool(expected))
        self.assertLess(kernel.get("split_difference", 0), 1e-12)
        self.assertEqual(kernel["sundials_gets"] == "component arrays",
                         kernel["loop_us"] < kernel["flat_us"])
        runs = [row for row in self.find(rows, measure="point", of="sundials")
                if row["method"].startswith(("ARKODE IMEX", "ARKODE MRI"))]
        self.assertEqual({row["method"][:11].strip() for row in runs}, expected)
        for name in expected:
            ended = [row for row in runs if row["method"].startswith(name)
                     and "aborted" not in row.get("reason", "")]
            methods = {row["method"] for row in ended}
            if ended:  # the coarsest run of a method may leave no time for another one
                most = 1e-4 if len(ended) > len(methods) else 1e-2
                self.assertLess(min(row.get("error", 1) for row in ended), most)

    def check_order(self, rows, method, order):
        """In a sweep over h that is neither too coarse nor at rounding level, half the step has
        2^-order of the error."""
        points = [row for row in self.find(rows, measure="point", scene="chain", method=method)
                 if row["status"] == "ok" and 1e-9 < row["error"] < 1e-5]
        ratios = [a["error"] / b["error"] for a, b in zip(points, points[1:])]
        if not ratios:
            self.skipTest("the machine is too busy for a sweep over h")
        for ratio in ratios:
            self.assertAlmostEqual(ratio / 2 ** order, 1, delta=0.3)


class Skip(QuickTest):
    IMPLICIT = {"no_springs": "no_springs", "zero_rest_length": "zero_rest_length",
                "kept_factor": "kept_factor_jelly16", "two_d": "two_d", "pinned": "half_pinned"}
    KEYLESS = {"at_rest", "islands", "incomplete"}
    EXPLICIT = {"zero_rest_length, explicit", "two_d, explicit", "islands, explicit",
                "at_rest, explicit", "planes", "colliders", "damping", "drag", "gravity", "forces",
                "motions", "force_function", "angles", "breaking", "contacts", "sphere", "capsule",
                "cylinder", "box"}

    def test_quick(self):
        result = self.run_quick("skip")
        self.assertEqual((result["bench"], result["quick"]), ("skip", True))
        rows, summary = result["rows"], result["summary"]
        for name in self.IMPLICIT.keys() | self.KEYLESS | self.EXPLICIT:
            with self.subTest(name):
                self.check_skip([row for row in rows if row["skip"] == name], name, summary)
        self.assertEqual(set(summary), set(self.IMPLICIT.values()))

    def check_skip(self, rows, name, summary):
        steps = {row["way"]: row for row in rows if row["measure"] == "step"}
        factors = {row["over"]: row["factor"] for row in rows if row["measure"] == "factor"}
        ways = {"on", "off"} | ({"off, cholmod"} if name not in self.EXPLICIT else set())
        self.assertEqual(set(steps), ways)
        for way, row in steps.items():
            if row["status"] == "ok":
                self.assertGreater(row["ms"], 0)
                self.assertEqual(factors.get(way, 0) > 0, way != "on")
            else:
                self.assertGreater(len(row["reason"]), 10)
                self.assertNotIn(way, factors)
        if name in self.IMPLICIT:
            key = self.IMPLICIT[name]
            self.assertEqual(summary[key], factors.get("off, cholmod"))
            if summary[key] is not None:
                self.assertGreater(summary[key], 1)  # also on a busy machine
            for row in steps.values():
                if row["status"] == "ok":
                    self.assertGreater(row["least_kinetic"], 1e-4)
                    self.assertGreater(row["median_ms"], 0)


class Duels(BenchTest):
    """Runs with two methods only, for their additional keys."""
    KEYS = {"auto_over_tuned_cholmod_jelly16", "auto_over_tuned_cholmod_cloth64"}

    def test_who_ran(self):
        self.good("linear", "--quick", "--scene", "jelly16,cloth64", "--json", "out.json")
        result = self.result()
        rows = {row["name"]: row for row in result["rows"] if row["measure"] == "pair"}
        self.assertEqual(set(rows), self.KEYS)
        for key, row in rows.items():
            with self.subTest(key):
                self.assertEqual(row["k"], 1000)
                self.assertTrue(0 < row["t"] <= 0.5)
                self.assertAlmostEqual(row["h"], 1 / 60)
                self.assertEqual((row["over"], row["under"]), ("auto", "cholmod"))
                if "cholmod" not in result["machine"]["solvers"]:
                    self.assertIsNone(result["summary"][key])
                    self.assertIn("cholmod", row["reason"])
                    continue
                for role in "over", "under":
                    self.assertGreater(row[f"{role}_least_kinetic"], 1e-5)  # it never comes to rest
                    self.assertGreater(row[f"{role}_median_ms"], 0)
                self.assertEqual(row["series"], 16 if "jelly" in key else 4)
                self.assertEqual(row["under_ran"], "cholmod")
                self.assertEqual(row["ratio"], result["summary"][key])
                # medians of ratios and ratios of medians agree roughly, also on a busy machine
                self.assertLess(abs(math.log(row["ratio"] * row["under_ms"] / row["over_ms"])), 1)


if __name__ == "__main__":
    support.main()
