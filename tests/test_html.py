"""Pages of the recorder html: they hold the motion, whatever ends the run, and replace only
pages."""
import json
import math
import signal
import unittest

import support
from cli_support import PENDULUM, SCENES, CliTest, pendulum
from html_read import END, START, Page


class HtmlTest(CliTest):
    def page(self, *args, scene="scene.json"):
        self.good("run", scene, "--quiet", "--out", "out.html", *args)
        page = Page(self.folder / "out.html")
        self.assertTrue(page.is_complete)
        return page


class Numbers(HtmlTest):
    def assert_agrees_with_csv(self, scene, *args):
        """Positions within half a 65535th of the frame's box, speeds within half a 255th"""
        page = self.page(*args, scene=scene)
        self.good("run", scene, "--quiet", "--out", "out.csv", *args)
        rows = self.rows()
        self.assertEqual(len(rows), page.n * len(page.frames))
        self.assertEqual(len(page.frames), page.planned)
        for k, frame in enumerate(page.frames):
            sizes = [high - low for low, high in zip(frame["low"], frame["high"])]
            for row, x, speed in zip(rows[k * page.n:], frame["x"], frame["speed"]):
                self.assertEqual((frame["step"], frame["t"]), (int(row["step"]), float(row["t"])))
                for c, axis in enumerate("xyz"):
                    exact = float(row[axis])
                    self.assertLessEqual(abs(x[c] - exact),
                                         sizes[c] / 131070 * (1 + 1e-9) + 1e-15 * abs(exact))
                v = math.hypot(*(float(row[key]) for key in ("vx", "vy", "vz")))
                self.assertLessEqual(abs(speed - v), frame["fastest"] / 510 * (1 + 1e-9))
        return page

    def test_motion_of_all_scenes(self):
        for path in sorted(SCENES.glob("*.json")):
            with self.subTest(path.name):
                self.assert_agrees_with_csv(path, "--steps", "20", "--every", "10")

    def test_constants(self):
        cloth = {"type": "cloth", "n": [3, 4], "origin": [0, 0, 1], "row": [0, 1, 0],
                 "column": [1, 0, 0], "mass": 0.6, "k": {"structural": 100, "shear": 7},
                 "pinned": "corners"}
        planes = [{"normal": [0, 0, 2], "offset": -4}]
        bar = {"from": [0, 0, -9], "to": [1, 0, -9], "radius": 0.5, "friction": 0}
        colliders = [{"type": "sphere", "center": [0, 0, -9], "radius": 2, "friction": 0.25},
                     {"type": "capsule", **bar, "restitution": 1, "inside": False},
                     {"type": "cylinder", **bar, "restitution": 0.5, "inside": False},
                     {"type": "box", "center": [0, 0, 0], "size": [9, 99, 9], "friction": 0,
                      "rotation": [0, 0.1, 0], "restitution": 1, "inside": True}]
        self.scene({**PENDULUM, "objects": [cloth], "planes": planes, "colliders": colliders})
        page = self.page()
        self.assertEqual((page.name, page.gravity), ("pendulum", [0, 0, -9.81]))
        self.assertEqual(page.planes, [{"normal": [0, 0, 1], "offset": -2}])
        colliders[0].update(restitution=1, inside=False)
        self.assertEqual(page.colliders, colliders)
        self.assertEqual((page.n, len(page.k), len(page.faces)), (14, 30, 12))
        self.assertEqual(page.ij[:2], [0, 1])
        self.assertEqual(page.k[0], 100)
        self.assertAlmostEqual(page.rest[0], 0.4, 7)
        self.assertEqual({round(k) for k in page.k[1:]}, {100, 7})
        self.assertEqual([i for i in range(14) if page.pinned[i]], [0, 2, 5, 10, 13])
        self.assertEqual(page.mass[:2], [1, 1])
        self.assertAlmostEqual(page.mass[5], 0.05, 8)
        self.assertEqual({corner for face in page.faces for corner in face}, set(range(2, 14)))

    def test_poses_of_colliders(self):
        """Where colliders are in each frame: on a line until they stop"""
        move = {"t": [0, 0.5], "x": [[0, 0, -9], [1, 0, -8]], "rotation": [[0, 0, 0], [0, 3, 0]]}
        bar = {"type": "capsule", "from": [2, 0, -9], "to": [3, 0, -9], "radius": 0.5}
        ball = {"type": "sphere", "center": [7, 7, 7], "radius": 2, "motion": move}
        self.scene({**PENDULUM, "colliders": [bar, ball]})
        page = self.page("--t_end", "1", "--fps", "8")
        self.assertEqual(len(page.frames), 9)
        for frame in page.frames:
            s = min(1, frame["t"] / 0.5)
            rest, moved = frame["poses"]
            self.assertEqual(rest, [2.5, 0, -9, 0, 0, 0])
            for value, exact in zip(moved, [s, 0, -9 + s, 0, 3 * s, 0]):
                self.assertAlmostEqual(value, exact, 12)

    def test_samples_of_colliders(self):
        """Heights are in the page, single precision is enough; an sdf has its place alone."""
        field = {"type": "heightfield", "origin": [0, 0, -9], "spacing": [1, 2], "n": [2, 3],
                 "heights": [0, 0.125, 1, 2, 3, 4.5]}
        grid = {"type": "sdf", "origin": [0, 0, -20], "spacing": [1, 1, 1], "n": [2, 2, 2],
                "values": 8 * [1]}
        self.scene({**PENDULUM, "colliders": [field, grid]})
        usual = {"restitution": 1, "friction": 0, "inside": False}
        del grid["n"], grid["values"]
        page = self.page()
        self.assertEqual(page.colliders, [{**field, **usual}, {**grid, **usual}])

    def test_energies(self):
        self.scene()
        page = self.page("--final", "final.json", "--force")
        energy = self.final()["energy"]
        for name in "kinetic", "elastic", "gravitational":
            self.assertEqual(page.frames[-1][name], energy[name])

    def test_one_particle_one_frame(self):
        self.scene({"msim": 1, "particles": {"x": [[1e300, -3, 0.1]], "mass": 1},
                    "run": {"integrator": "verlet", "h": 1, "steps": 0}})
        page = self.page()
        self.assertEqual([frame["x"] for frame in page.frames], [[(1e300, -3, 0.1)]])
        self.assertEqual((page.name, page.ij, page.faces), ("", [], []))

    def test_numbers_beyond_single_precision(self):
        self.scene({**PENDULUM, "springs": {"ij": [[0, 1]], "k": 1e60}})
        page = self.page("--h", "1e-35", "--steps", "0")
        self.assertAlmostEqual(page.k[0] / (2 - 2**-23), 2.0**127)

    def test_large_coordinates(self):
        x = [[1e9, 0, -1e12], [1e9 + 0.5, 0.1, -1e12], [-1e100, 0, 0], [1e100, 1, 1]]
        far = {**PENDULUM, "particles": {"x": x, "mass": 1}, "gravity": [0, 0, 0]}
        self.scene(far)
        self.assert_agrees_with_csv("scene.json", "--steps", "3", "--every", "1")


class Names(HtmlTest):
    def test_any_name(self):
        for name in ("</script><script>alert(1)</script>", "a \"quoted\" \\ 'name'", "<!--",
                     "Härtetest ✓ 布\n\t\x01"):
            with self.subTest(name):
                self.scene({**PENDULUM, "name": name})
                page = self.page("--steps", "1")
                self.assertEqual(page.name, name)
                text = (self.folder / "out.html").read_text()
                self.assertEqual(text.split(START)[1].count("<"), END.count("<"))


class Files(HtmlTest):
    def test_player(self):
        self.scene()
        player = self.page().player
        self.assertTrue(player.startswith("<!doctype html>\n"))
        for word in "MIT License", "webgl2", "prefers-color-scheme", "aria-label":
            self.assertIn(word, player)
        for word in "@script@", "@style@", "http://", "https://", "src=", "import(", "fetch(":
            self.assertNotIn(word, player)

    def test_only_pages_are_replaced(self):
        self.scene()
        page, run = self.folder / "out.html", ("run", "scene.json", "--quiet", "--out", "out.html")
        page.write_text("<!doctype html>\n<!-- somebody's own -->\n")
        self.assert_refused(run, "out.html exists and is not a trajectory of msim")
        self.good(*run, "--force")
        self.good(*run, "--steps", "3")
        self.assertEqual(Page(page).frames[-1]["step"], 3)

    def test_not_resumed(self):
        self.scene()
        self.good("run", "scene.json", "--quiet", "--out", "out.html")
        self.assert_refused(["run", "scene.json", "--out", "out.html", "--resume"],
                            "cannot be resumed")

    def test_too_large_a_page(self):
        """No frame is computed, and the message says what to do; that does."""
        rope = {"type": "rope", "n": 5000, "from": [0, 0, 0], "to": [1, 0, 0], "mass": 1, "k": 1}
        self.scene({"msim": 1, "objects": [rope], "run": {"integrator": "verlet", "h": 1e-3}})
        run = ["run", "scene.json", "--t_end", "1000", "--out", "out.html", "--every"]
        self.assert_refused([*run, "100"], "out.html", "limited to 100 MB", "--every")
        status, _, err = self.cli(*run, "100")
        self.assertEqual(status, 1)
        fps = err.split("--fps ")[1].split()[0]
        self.assertRegex(fps, r"^\d[\d.]*$")
        with self.start(*run[:-1], "--fps", fps) as process:
            self.wait_for("out.html")
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)
        page = (self.folder / "out.html").read_text()
        planned = json.loads(page.split(START)[1].split("\n")[0])["frames"]
        self.assertGreater(planned * 5000 * 7, 0.6e8)  # what is refused is not far from the limit


class Interruptions(HtmlTest):
    def interrupted(self, number):
        """The page of a run that the signal ended after some frames"""
        self.scene(pendulum(integrator="velocity-verlet", h=1e-3))
        page = self.folder / "out.html"
        with self.start("run", "scene.json", "--t_end", "1000", "--out", "out.html", "--every",
                        "10") as process:
            self.wait_until(lambda: page.exists() and page.stat().st_size > 100000, "no frames")
            process.send_signal(number)
            process.communicate(timeout=60)
        self.assertEqual(self.files(), ["out.html", "scene.json"])
        return page

    def test_interrupted(self):
        page = Page(self.interrupted(signal.SIGINT))
        self.assertTrue(page.is_complete)
        self.assertGreater(len(page.frames), 100)
        self.assertLess(len(page.frames), page.planned)

    def test_killed(self):
        """What is there are whole lines, and perhaps a part of one, which the player leaves out."""
        text = self.interrupted(signal.SIGKILL).read_text()
        self.assertNotIn(END, text)
        (self.folder / "out.html").write_text(text[:text.rindex("\n") + 1])
        self.assertGreater(len(Page(self.folder / "out.html").frames), 100)


if __name__ == "__main__":
    support.main()
