"""Tests of `msim_cli rest` and `msim_cli modes`: what they print and write, and what they refuse."""
import json
import math
import signal
import time

import support
from cli_support import CliTest

CHAIN = {"msim": 1, "gravity": [0, 0, -9.81],
         "objects": [{"type": "rope", "n": 12, "from": [0, 0, 0], "to": [1, 0, 0], "mass": 1.2,
                      "k": 5000, "damping": 0.1, "pinned": [0]}]}
FALLING = {"msim": 1, "gravity": [0, 0, -10],
           "particles": {"x": [[0, 0, 0], [0, 0, 1]], "mass": 1},
           "springs": {"ij": [[0, 1]], "k": 10}}


class Rest(CliTest):
    def test_a_rope_comes_to_rest(self):
        """The spring below particle i carries the weight of all particles beyond it."""
        self.scene(CHAIN)
        out = self.good("rest", "scene.json", "--final", "rest.json")
        for word in ("force", "iterations", "minimum     yes", "energy"):
            self.assertIn(word, out)
        x = self.final("rest.json")["x"]
        z = [0]
        for i in range(1, 12):
            z.append(z[-1] - 1 / 11 - (12 - i) * 0.1 * 9.81 / 5000)
        for (px, py, pz), wanted in zip(x, z):
            self.assertAlmostEqual(math.hypot(px, py), 0, delta=1e-9)
            self.assertAlmostEqual(pz, wanted, delta=1e-9)

    def test_a_run_starts_at_rest(self):
        self.scene(CHAIN)
        self.assertEqual(self.good("rest", "scene.json", "--final", "rest.json", "--quiet"), "")
        self.good("run", "scene.json", "--init", "rest.json", "--integrator", "rk4", "--h", "1e-3",
                  "--t_end", "1", "--final", "end.json", "--quiet")
        for before, after in zip(self.final("rest.json")["x"], self.final("end.json")["x"]):
            for a, b in zip(before, after):
                self.assertAlmostEqual(a, b, delta=1e-8)

    def test_a_body_that_falls(self):
        """Status 2, one sentence, no file."""
        self.scene(FALLING)
        status, out, err = self.cli("rest", "scene.json", "--final", "rest.json")
        self.assertEqual((status, out), (2, ""))
        self.assert_sentence(err, "no equilibrium", "20 N", "particle 0")
        self.assertEqual(self.files(), ["scene.json"])

    def test_springs_that_would_break(self):
        """In balance spring i of a chain of masses m carries m g (n - i): up to 30 N here."""
        x = [[0, 0, -i] for i in range(4)]
        for key, limit, breaks in (("break_force", 31, False), ("break_force", 29, True),
                                   ("break_strain", 0.31, False), ("break_strain", 0.29, True)):
            with self.subTest(key=key, limit=limit):
                self.scene({"msim": 1, "gravity": [0, 0, -10],
                            "laws": [{"type": "linear", key: limit}],
                            "particles": {"x": x, "mass": 1, "pinned": [0]},
                            "springs": {"ij": [[2, 3], [1, 2], [0, 1]], "k": 100, "law": 1}})
                if not breaks:
                    self.good("rest", "scene.json")
                    continue
                status, _, err = self.cli("rest", "scene.json", "--final", "rest.json")
                self.assertEqual(status, 2)
                self.assert_sentence(err, "spring 2 would break", "0.3 m", "30 N", key)
                self.assertEqual(self.files(), ["scene.json"])

    def test_springs_that_do_not_break(self):
        """Those between pinned particles, and those that are broken, however long."""
        x = [[0, 0, 0], [0, 0, 2], [0, 0, -1]]
        self.scene({"msim": 1, "gravity": [0, 0, -10],
                    "laws": [{"type": "linear", "break_strain": 0.5}],
                    "particles": {"x": x, "mass": 1, "pinned": [0, 1]},
                    "springs": {"ij": [[0, 1], [1, 2], [0, 2]], "k": 100, "rest": 1, "law": 1}})
        self.good("run", "scene.json", "--integrator", "rk4", "--h", "1e-3", "--steps", "1",
                  "--final", "broken.json")
        self.assertEqual(self.final("broken.json")["broken"], [1])
        self.good("rest", "scene.json", "--init", "broken.json", "--final", "rest.json")
        self.assertAlmostEqual(self.final("rest.json")["x"][2][2], -1.1, delta=1e-9)

    def test_self_contact(self):
        """Refused by name; modes leave contacts aside."""
        scene = {**CHAIN, "run": {"integrator": "velocity-verlet", "h": 1e-4, "t_end": 1}}
        self.scene(scene)
        wanted = self.good("modes", "scene.json", "-n", "3")
        self.scene({**scene, "self_contact": {"thickness": 0.01}})
        self.assert_refused(["rest", "scene.json"], "does not support self_contact")
        self.assertEqual(self.good("modes", "scene.json", "-n", "3"), wanted)

    def test_refusals(self):
        self.scene(CHAIN)
        self.write("note.json", "mine")
        for flag, value in (("--ftol", "0"), ("--ftol", "1e-9x"), ("--ftol", "nan"),
                            ("--final", "note.json"), ("--final", "scene.json"),
                            ("--init", "note.json")):
            self.assert_refused(["rest", "scene.json", flag, value], value)
        for flag in ("--h", "--integrator", "--count"):
            self.assert_refused(["rest", "scene.json", flag, "3"], flag)

    def test_ctrl_c(self):
        """So large a cloth takes long to converge to 1e-300 N."""
        self.scene({**CHAIN, "objects": [{"type": "cloth", "n": [120, 120], "origin": [0, 0, 0],
                                          "row": [0, 1, 0], "column": [1, 0, 0], "mass": 1,
                                          "k": 100, "pinned": ["first_row"]}]})
        with self.start("rest", "scene.json", "--ftol", "1e-300", "--final", "rest.json") as process:
            time.sleep(1)
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 2)
        self.assert_sentence(err, "stopped")
        self.assertEqual(self.files(), ["scene.json"])


class Modes(CliTest):
    def test_a_pendulum(self):
        """w^2 = g/l in two directions, and the vibration along the spring, w^2 = k/m."""
        self.scene({"msim": 1, "gravity": [0, 0, -10],
                    "particles": {"x": [[0, 0, 0], [0, 0, -2]], "mass": 0.5, "pinned": [0]},
                    "springs": {"ij": [[0, 1]], "k": 1000, "rest": 1.995}})
        out = self.good("modes", "scene.json", "-n", "3", "--json", "modes.json")
        modes = self.final("modes.json")
        wanted = [math.sqrt(5), math.sqrt(5), math.sqrt(2000)]
        for line, f, w in zip(out.splitlines(), modes["frequency"], wanted):
            self.assertAlmostEqual(f, w / (2 * math.pi), delta=1e-9)
            self.assertAlmostEqual(float(line.split()[1]), f, delta=1e-7)
        (first, last) = modes["shape"][2]
        self.assertEqual(first, [0, 0, 0])
        self.assertAlmostEqual(abs(last[2]), math.sqrt(2), delta=1e-9)

    def test_ten_modes_about_the_state_of_init(self):
        self.scene(CHAIN)
        self.good("rest", "scene.json", "--final", "rest.json")
        lines = self.good("modes", "scene.json", "--init", "rest.json").splitlines()
        self.assertEqual(len(lines), 10)
        self.assertTrue(all(float(line.split()[1]) > 0.3 for line in lines))

    def test_refusals(self):
        self.scene(CHAIN)
        self.write("note.json", json.dumps({"frequency": []}))
        for flag, value in (("-n", "0"), ("-n", "1.5"), ("-n", "34"), ("--count", "x"),
                            ("--json", "note.json"), ("--json", "scene.json")):
            self.assert_refused(["modes", "scene.json", flag, value], value)
        for flag in ("--ftol", "--tol", "--final"):
            self.assert_refused(["modes", "scene.json", flag, "1"], flag)


if __name__ == "__main__":
    support.main()
