"""Tests of the files that msim_cli run writes beside the motion: the last state and the table of
energies, and that files of others stay."""
import math
import resource

import support
from cli_support import FOR_EVER, PENDULUM, CliTest


class Final(CliTest):
    def test_a_file_of_others_is_replaced_by_force_only(self):
        """It is refused before the run, which here would never end."""
        self.scene()
        for content in ("old", PENDULUM, {"status": "ok"}, '{"msim": 1, "stat'):
            with self.subTest(content):
                path = self.folder / self.write("thesis.json", content)
                before = path.read_bytes()
                args = ["run", "scene.json", "--final", "thesis.json"]
                self.assert_refused([*args, *FOR_EVER], "thesis.json exists and is not", "--force")
                self.assertEqual(path.read_bytes(), before)
                self.good(*args, "--force", "--quiet")
                self.assertEqual(self.final("thesis.json")["step"], 100)

    def test_an_empty_file_is_filled(self):
        self.scene()
        self.write("final.json", "")
        self.assertEqual(self.run_final()["step"], 100)

    def test_contacts(self):
        """A particle that rests on a plane: m g h in the last step, if contacts are recorded"""
        self.scene({"msim": 1, "gravity": [0, 0, -10], "particles": {"x": [[0, 0, 0]], "mass": 2},
                    "planes": [{"normal": [0, 0, 1], "offset": 0, "restitution": 0}],
                    "run": {"integrator": "symplectic-euler", "h": 0.125, "steps": 4}})
        self.assertNotIn("contacts", self.run_final())
        found = self.run_final("--contacts", "on")["contacts"]
        self.assertEqual(found, [{"particle": 0, "plane": 0, "point": [0, 0, 0],
                                  "normal": [0, 0, 1], "impulse": [0, 0, 2.5]}])

    def test_broken_springs_stay_broken(self):
        """A rope breaks at its first link; what is left starts from there again."""
        self.scene({"msim": 1, "gravity": [0, 0, -9.81],
                    "laws": [{"type": "linear", "break_force": 4}],
                    "objects": [{"type": "rope", "n": 6, "from": [0, 0, 1], "to": [0, 0, 0],
                                 "mass": 0.6, "k": 200, "pinned": [0], "law": 1}],
                    "run": {"integrator": "velocity-verlet", "h": 1e-3, "steps": 200}})
        first = self.run_final()
        self.assertEqual((first["broken"], first["stats"]["broken"]), ([0], 1))
        whole = self.run_final("--steps", "300")
        self.write("first.json", first)
        again = self.run_final("--init", "first.json", "--steps", "100")
        self.assertEqual((again["broken"], again["x"]), ([0], whole["x"]))
        for broken, words in (([5], "there are 5 springs"), ("0", "must be an array"),
                              ([0.5], "must be the index")):
            self.write("bad.json", {**first, "broken": broken})
            self.assert_refused(["run", "scene.json", "--init", "bad.json"], "bad.json: broken",
                                words)


class Energies(CliTest):
    HEAD = "step,t,kinetic,elastic,gravitational,total,work"

    def table(self, *args):
        self.scene()
        self.good("run", "scene.json", "--energies", "e.csv", "--quiet", *args)
        return [[float(value) for value in row.values()] for row in self.rows("e.csv")]

    def test_a_row_per_frame(self):
        table = self.table("--every", "30", "--final", "final.json")
        self.assertEqual((self.folder / "e.csv").read_text().split("\n")[0], self.HEAD)
        self.assertEqual([row[0] for row in table], [0, 30, 60, 90, 100])
        self.assertEqual(table[0][1:3], [0, 0.5])
        self.assertEqual(table[-1][1:], [0.1, *self.final()["energy"].values(), 0])
        for row in table:
            self.assertAlmostEqual(row[2] + row[3] + row[4], row[5], delta=1e-12)

    def test_the_work_of_motions(self):
        """The total energy changes by the work of a moving pin; a resumed table continues it."""
        self.scene({**PENDULUM, "motions": [{"particles": [0], "t": [0, 0.05, 0.1],
                                             "x": [[[0, 0, 0]], [[0.05, 0, 0]], [[0.02, 0, 0.04]]]}]})
        self.good("run", "scene.json", "--h", "1e-5", "--energies", "e.csv", "--quiet")
        table = [[float(value) for value in row.values()] for row in self.rows("e.csv")]
        self.assertGreater(max(abs(row[6]) for row in table), 0.05)
        for row in table:
            self.assertAlmostEqual(row[5] - table[0][5], row[6], delta=1e-4)

    def test_frames_are_those_of_the_motion(self):
        for how in (["--fps", "70"], ["--integrator", "dop853", "--fps", "70"],
                    ["--integrator", "dop853", "--every", "3"]):
            with self.subTest(how):
                table = self.table("--out", "out.csv", *how)
                self.assertEqual([row[1] for row in table],
                                 list(dict.fromkeys(float(row["t"]) for row in self.rows())))
                self.assertEqual(table, self.table(*how))  # as well alone

    def test_an_interrupted_run_leaves_the_rows_so_far(self):
        self.scene()
        with self.start("run", "scene.json", *FOR_EVER, "--every", "10", "--energies", "e.csv",
                        "--quiet") as process:
            self.wait_until(lambda: (self.folder / "e.csv").exists() and
                            (self.folder / "e.csv").stat().st_size > 5000, "no rows")
            process.kill()
            process.wait()
        steps = [int(row["step"]) for row in self.rows("e.csv")[:-1]]
        self.assertEqual(steps, list(range(0, 10 * len(steps), 10)))
        self.assertEqual(len(self.table("--every", "50")), 3)  # replaced, as it is a table of msim

    def test_what_is_refused(self):
        self.scene()
        self.write("thesis.csv", "chapter,words\n1,2000\n")
        self.write("motion.csv", "step,t,particle,x,y,z,vx,vy,vz\n")
        (self.folder / "folder").mkdir()
        run = ["run", "scene.json", "--energies"]
        self.assert_refused([*run, "thesis.csv", *FOR_EVER], "thesis.csv exists and is not", "--force")
        self.assert_refused([*run, "motion.csv"], "motion.csv", "not a table of energies")
        self.assert_refused([*run, "scene.json", "--force"], "is the scene")
        self.assert_refused([*run, "folder"], "a folder")
        self.assert_refused([*run, "missing/e.csv", "--out", "o.csv"], "missing/e.csv")
        self.assert_refused([*run, "a.csv", "--out", "./a.csv"], "both --out and --energies")
        self.assert_refused([*run, "a.csv", "--final", "a.csv"], "both --final and --energies")
        self.assert_refused([*run, "a.csv", "--springs", "a.csv"], "both --energies and --springs")
        self.write("old.csv", "step,t,kinetic,elastic,gravitational,total\n")  # without work
        self.assert_refused([*run, "old.csv"], "old.csv", "not a table of energies")
        self.assertEqual(len(self.table("--steps", "0")), 1)
        self.good(*run, "thesis.csv", "--force", "--quiet")
        self.assertEqual(self.rows("thesis.csv")[-1]["step"], "100")

    def test_reactions_and_springs(self):
        """A pin balances the pull of its spring and its weight."""
        self.scene()
        self.good("run", "scene.json", "--reactions", "r.csv", "--springs", "s.csv", "--out",
                  "out.csv", "--every", "25", "--quiet", "--final", "final.json")
        reactions, springs, motion = (self.rows(name) for name in ("r.csv", "s.csv", "out.csv"))
        self.assertEqual([row["particle"] for row in reactions], ["0"] * 5)
        self.assertEqual([row["spring"] for row in springs], ["0"] * 5)
        for reaction, spring, bob in zip(reactions, springs, motion[1::2]):
            self.assertEqual(reaction["t"], bob["t"])
            x = [float(bob[key]) for key in "xyz"]
            length = math.hypot(*x)
            self.assertAlmostEqual(float(spring["tension"]), 100 * (length - 0.4))
            self.assertAlmostEqual(float(spring["elongation"]), length - 0.4)
            self.assertAlmostEqual(float(spring["strain"]), length / 0.4 - 1)
            for key, component, weight in zip(("fx", "fy", "fz"), x, (0, 0, 9.81)):
                self.assertAlmostEqual(float(reaction[key]),
                                       weight - 100 * (length - 0.4) * component / length)
        self.assertEqual([float(reactions[-1][key]) for key in ("fx", "fy", "fz")],
                         self.final()["reactions"][0])

    def test_a_full_disk_ends_the_run(self):
        """As does any other output; the rows so far are whole lines or one part of a line."""
        self.scene()
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
        status, _, err = self.cli("run", "scene.json", "--steps", "10000", "--every", "1",
                                  "--energies", "e.csv", "--quiet", preexec_fn=limit)
        self.assertEqual(status, 1)
        self.assert_sentence(err, "cannot write 'e.csv'", "File too large")


if __name__ == "__main__":
    support.main()
