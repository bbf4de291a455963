"""Tests of tools/plot_bench: pictures with the points that were measured, tables of all rows."""

import importlib.util
import json
import re
import subprocess
import sys
from xml.etree import ElementTree

import support
from bench_support import BenchTest, plot_bench

SVG = "{http://www.w3.org/2000/svg}"
MAIN = {"measure": "step", "k": 1000, "h": 1 / 60}


class PlotTest(BenchTest):
    def write_result(self, bench, rows, cpu="a CPU"):
        self.write("out.json", {"bench": bench, "quick": True, "machine": {"cpu": cpu},
                                "rows": rows, "summary": {}})

    def picture(self, bench, rows):
        """The texts of the picture, and its groups by their names."""
        support.require(importlib.util.find_spec("matplotlib"), "matplotlib")
        self.write_result(bench, rows)
        self.assertEqual(plot_bench("out.json", "--svg", "out.svg", cwd=self.folder), (0, ""))
        self.assertEqual(self.files(), ["out.json", "out.svg"])
        root = ElementTree.parse(self.folder / "out.svg").getroot()
        self.assertEqual(root.tag, SVG + "svg")
        texts = [text.text for text in root.iter(SVG + "text")]
        return texts, {group.get("id"): group for group in root.iter(SVG + "g")}

    def curves(self, groups):
        """The number of points of each curve."""
        return {name: len(list(group.iter(SVG + "use"))) for name, group in groups.items()
                if name and name.startswith("curve-")}


class Curves(PlotTest):
    def test_families_have_curves_of_their_own(self):
        rows = [{"measure": "step", "contestant": name, "scene": scene, "springs": springs,
                 "springs_per_s": 1e8 * (i + 1)}
                for i, name in enumerate(("msim, 1 thread", "textbook"))
                for scene, springs in (("cloth100", 59002), ("jelly16", 46620), ("cloth32", 5826))]
        rows.append({"measure": "triad", "contestant": "triad", "springs": 1, "springs_per_s": 1})
        texts, groups = self.picture("forces", rows)
        self.assertEqual(self.curves(groups), {"curve-0-0": 2, "curve-0-1": 1, "curve-1-0": 2,
                                               "curve-1-1": 1})
        self.assertIn("explicit steps; a CPU", texts)
        self.assertNotIn("triad", texts)
        for word in "msim, 1 thread", "textbook", "cloth100", "jelly16":
            self.assertEqual(texts.count(word), 1, word)

    def test_points_are_in_the_order_of_x(self):
        rows = [{**MAIN, "curve": "a", "accuracy": x, "ms": y}
                for x, y in ((1e-4, 1), (1e-2, 10), (1e-6, 100))]
        _, groups = self.picture("step", rows)
        path = groups["curve-0-0"].find(SVG + "path").get("d")
        points = [tuple(map(float, pair)) for pair in re.findall(r"([\d.]+) ([\d.]+)", path)]
        self.assertEqual(points, sorted(points))
        left, middle, right = points
        self.assertAlmostEqual(middle[0] - left[0], right[0] - middle[0], 3)  # decades
        self.assertAlmostEqual(middle[1] - left[1], 2 * (middle[1] - right[1]), 3)

    def test_what_was_not_measured_is_left_out(self):
        rows = [{**MAIN, "curve": "a", "accuracy": 1e-2, "ms": 3.0},
                {**MAIN, "curve": "a", "accuracy": 1e-4, "status": "left out"},
                {**MAIN, "curve": "a", "accuracy": 1e-6, "ms": None},
                {**MAIN, "curve": "a", "accuracy": None, "ms": 3.0},
                {**MAIN, "curve": "a", "accuracy": 1e-5, "ms": 3.0, "k": 100000},
                {**MAIN, "curve": "b", "accuracy": 1e-5, "ms": 3.0, "h": 1 / 240}]
        _, groups = self.picture("step", rows)
        self.assertEqual(self.curves(groups), {"curve-0-0": 1})

    def test_panels(self):
        rows = [{"measure": "point", "scene": scene, "method": method, "error": 10.0 ** -i,
                 "ms": 2.0 ** i, "near_best": method != "slow"}
                for scene in ("chain", "cord") for method in ("rk4", "respa", "slow")
                for i in range(4) if (scene, method) != ("chain", "respa")]
        texts, groups = self.picture("precision", rows)
        self.assertNotIn("slow", texts)
        self.assertEqual([name for name in texts if name in ("chain", "cord")], ["chain", "cord"])
        self.assertEqual(texts.count("rk4"), 2)
        self.assertEqual(texts.count("respa"), 1)
        self.assertEqual(len(re.findall('id="curve-[0-9-]*"',
                                        (self.folder / "out.svg").read_text())), 3)

    def test_nothing_to_plot(self):
        for bench in ("linear", "forces", "scaling", "skip", "step", "precision", "stability",
                      "distributed"):
            with self.subTest(bench):
                _, groups = self.picture(bench, [])
                self.assertEqual(self.curves(groups), {})
                self.assertIn("axes_1", groups)


class BarsAndMaps(PlotTest):
    def named(self, groups, prefix):
        return sorted(name for name in groups if name and name.startswith(prefix))

    def test_bars(self):
        rows = [{**MAIN, "solver": solver, "scene": scene, "ms": ms}
                for solver, scene, ms in (("auto", "cloth32", 1), ("pcg", "cloth32", 10),
                                          ("auto", "cloth64", 100))]
        texts, groups = self.picture("linear", [*rows, {**MAIN, "solver": "klu", "status": "failed"}])
        self.assertEqual(self.named(groups, "bar-"), ["bar-0-0", "bar-0-1", "bar-1-0"])
        self.assertLessEqual({"auto", "pcg", "cloth32", "cloth64"}, set(texts))
        self.assertNotIn("klu", texts)

    def test_map(self):
        rows = [{"measure": "cell", "method": method, "scene": scene, "h": h, "outcome": outcome}
                for method, scene, h, outcome in (
                    ("heun", "soft", 1e-3, "silent"), ("heun", "soft", 1e-3, "stable"),
                    ("heun", "soft", 1e-1, "reported"), ("rk4", "soft", 1e-3, "refused"),
                    ("rk4", "soft", None, "stable"),
                    ("rk4", "stack", 1e-2, "hang"))]
        texts, groups = self.picture("stability", rows)
        self.assertEqual(self.named(groups, "cell-"), ["cell-0-0", "cell-2-0", "cell-9-1"])
        colour = {name: groups[name].find(SVG + "path").get("style")
                  for name in ("cell-0-0", "cell-2-0", "cell-9-1")}
        self.assertIn("#d73027", colour["cell-0-0"])  # the worst of two
        self.assertIn("#fdae61", colour["cell-2-0"])
        self.assertIn("#000000", colour["cell-9-1"] or "#000000")  # SVG's default
        self.assertLessEqual({"heun", "rk4", "soft", "stack", "stable", "hang"}, set(texts))


class Bytes(PlotTest):
    def test_the_same_result_gives_the_same_picture(self):
        rows = [{"measure": "step", "way": way, "skip": skip, "ms": 1.5}
                for way in ("on", "off") for skip in ("pinned", "drag & <others>")]
        pictures = []
        for _ in range(2):
            self.picture("skip", rows)
            pictures.append((self.folder / "out.svg").read_bytes())
        self.assertEqual(*pictures)
        self.assertNotRegex(pictures[0].decode(), r"dc:date|matplotlib\.org")

    def test_table(self):
        rows = [{"measure": "a, b", "n": 3, "ms": 0.1234567890123, "ok": True},
                {"measure": 'say "so"', "ms": None, "is_bound": False, "h": 1e-6}]
        self.write_result("linear", rows)
        self.assertEqual(plot_bench("out.json", "--csv", "out.csv", cwd=self.folder), (0, ""))
        self.assertEqual((self.folder / "out.csv").read_text(),
                         'measure,n,ms,ok,is_bound,h\n"a, b",3,0.123456789,1,,\n'
                         '"say ""so""",,,,0,1e-06\n')

    def test_of_a_run(self):
        support.require(importlib.util.find_spec("matplotlib"), "matplotlib")
        for bench, scenes, words in (
                ("forces", "cloth32,jelly8", ("msim, 1 thread", "cloth32", "jelly8")),
                ("scaling", "cloth32,jelly8", ("auto", "jelly8")),
                ("step", "cloth32", ("relative error",)),
                ("linear", "cloth32", ("auto", "pcg", "cloth32"))):
            with self.subTest(bench):
                self.good(bench, "--quick", "--scene", scenes, "--json", "out.json")
                done = plot_bench("out.json", "--svg", "out.svg", "--csv", "out.csv", cwd=self.folder)
                self.assertEqual(done, (0, ""))
                text = (self.folder / "out.svg").read_text()
                for word in words:
                    self.assertIn(word, text)
                lines = (self.folder / "out.csv").read_text().splitlines()
                self.assertEqual(len(lines), 1 + len(self.result()["rows"]))


class Refusals(PlotTest):
    def test_sentences(self):
        self.write("list.json", "[]")
        self.write("text.json", "no JSON")
        self.write("other.json", {"bench": "none such", "rows": []})
        self.write_result("linear", [])
        (self.folder / "old.csv").write_text("old")
        for args, word in ((["missing.json", "--csv", "a"], "missing.json: No such file"),
                           (["list.json", "--csv", "a"], "list.json is not a result"),
                           (["text.json", "--csv", "a"], "text.json is not JSON"),
                           (["other.json", "--csv", "a"], "'none such'; there are: linear"),
                           (["out.json", "--csv", "folder/a"], "cannot write folder/a: No such")):
            with self.subTest(" ".join(args)):
                status, err = plot_bench(*args, cwd=self.folder)
                self.assertEqual((status, err.count("\n")), (1, 1))
                self.assertIn(word, err)
        self.assertEqual(plot_bench("out.json", cwd=self.folder)[0], 2)
        self.assertEqual(self.files(), ["list.json", "old.csv", "other.json", "out.json",
                                        "text.json"])

    def test_without_matplotlib(self):
        self.write_result("linear", [])
        (self.folder / "out.svg").write_text("old")
        program = support.SOURCE / "tools/plot_bench"
        code = ("import runpy, sys; sys.modules['matplotlib'] = None; "
                "sys.argv = ['plot_bench', 'out.json', '--svg', 'out.svg']; "
                f"runpy.run_path({json.dumps(str(program))}, run_name='__main__')")
        done = subprocess.run([sys.executable, "-c", code], cwd=self.folder, text=True,
                              capture_output=True)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertEqual(done.stderr,
                         "plot_bench: --svg needs matplotlib: pip install matplotlib\n")
        self.assertEqual((self.folder / "out.svg").read_text(), "old")

    def test_every_bench_has_a_plot(self):
        """One that has none is refused, and named together with those that have."""
        self.write("other.json", {"bench": "", "rows": []})
        known = plot_bench("other.json", "--csv", "a", cwd=self.folder)[1].partition("there are: ")[2]
        benches = re.findall(r"(?m)^  ([a-z]+) {2,}", self.good("--help").partition("Options")[0])
        self.assertEqual(sorted(known.strip().split(", ")), sorted(benches))


if __name__ == "__main__":
    support.main()
