"""Pages of the recorder html in a headless Chromium that draws in software: pictures, controls, no
errors, speed."""
import os
import struct
import unittest
import zlib
from pathlib import Path

import browser
import support
from cli_support import PENDULUM, SCENES, CliTest

WIDTH, HEIGHT = 1000, 700
BY_ID = "document.getElementById({!r})"
COUNT_FRAMES = """new Promise(done => {
  let count = 0;
  const start = performance.now();
  const next = () => {
    count++;
    DRAW
    if (performance.now() - start < 3000) requestAnimationFrame(next);
    else done(count / (performance.now() - start) * 1000);
  };
  requestAnimationFrame(next);
})"""


# As many triangles as a cloth of 64 x 64 has, the plain way
DRAW_TRIANGLES = """
    const canvas = document.querySelector("canvas") ??
                   document.body.appendChild(document.createElement("canvas"));
    canvas.width = 1000, canvas.height = 700;
    const g = canvas.getContext("2d");
    for (let i = 0; i < 2 * 63 * 63; i++) {
      const x = i * 37 % 988, y = i * 91 % 688;
      g.fillStyle = `rgb(${i % 256}, 80, 90)`;
      g.beginPath();
      g.moveTo(x, y), g.lineTo(x + 12, y), g.lineTo(x, y + 12);
      g.fill();
    }"""


def pixels(png):
    """Rows of (r, g, b) of a PNG file as Chromium writes it: 8 bits, RGB or RGBA"""
    at, data, header = 8, b"", None
    while at < len(png):
        size, kind = struct.unpack(">I4s", png[at:at + 8])
        if kind == b"IHDR":
            header = struct.unpack(">IIBB", png[at + 8:at + 18])
        if kind == b"IDAT":
            data += png[at + 8:at + 8 + size]
        at += size + 12
    width, height, _, colour = header
    step = {2: 3, 6: 4}[colour]
    raw, rows, above = zlib.decompress(data), [], bytes(step * width)
    for y in range(height):
        start = y * (step * width + 1)
        row = bytearray(raw[start + 1:start + 1 + step * width])
        above = unfilter(raw[start], row, above, step)
        rows.append([tuple(above[i:i + 3]) for i in range(0, len(above), step)])
    return rows


def unfilter(kind, row, above, step):
    """The filters of PNG: none, left, above, mean, Paeth"""
    if kind == 0:
        return row
    for i, value in enumerate(row):
        a = row[i - step] if i >= step else 0
        b, c = above[i], above[i - step] if i >= step else 0
        nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
        row[i] = (value + (0, a, b, (a + b) // 2, nearest)[kind]) & 255
    return row


def is_coloured(pixel):
    """Of the ramp or a mark, which backgrounds and grids, nearly grey, are not"""
    return max(pixel) - min(pixel) > 40


def cpu_seconds(root):
    """Of all processes below one, from /proc"""
    children, total = {}, 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        children.setdefault(int(fields[1]), []).append(
            (int(path.parent.name), int(fields[11]) + int(fields[12])))
    todo = [root]
    while todo:
        for child, ticks in children.get(todo.pop(), []):
            todo.append(child)
            total += ticks
    return total / os.sysconf("SC_CLK_TCK")


class PlayerTest(CliTest):
    @classmethod
    def setUpClass(cls):
        support.require(browser.PROGRAM, "chromium")
        cls.browser = browser.Browser()
        cls.addClassCleanup(cls.browser.close)

    def page(self, scene, *args):
        page = self.folder / "out.html"
        self.good("run", scene, "--quiet", "--out", page, "--force", *args)
        return page

    def open(self, page, **how):
        seconds = self.browser.open(page, **how)
        self.settle()
        return seconds

    def tearDown(self):
        self.assertEqual(self.browser.errors, [])

    def get(self, name, member):
        return self.browser.evaluate(f"{BY_ID.format(name)}.{member}")

    def key(self, key, **more):
        for kind in "keyDown", "keyUp":
            self.browser.page("Input.dispatchKeyEvent", type=kind, key=key, **more)
        self.settle()

    def mouse(self, kind, x, y, **more):
        self.browser.page("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def settle(self):
        """Waits until the page has drawn what has changed."""
        self.browser.evaluate("new Promise(done => requestAnimationFrame(() => "
                              "requestAnimationFrame(() => requestAnimationFrame(done))))")

    def picture(self):
        """The rows of pixels of the main element, at half size"""
        self.settle()
        box = self.browser.evaluate("(({x, y, width, height}) => ({x, y, width, height}))"
                                    "(document.querySelector('main').getBoundingClientRect())")
        return pixels(self.browser.screenshot(clip={**box, "scale": 0.5}))[1:-1]

    def coloured(self, columns=1, lines=1):
        """The share of coloured pixels in each tile of the picture, without the legend's column"""
        rows = [row[:-85] for row in self.picture()]
        high, wide = len(rows) / lines, len(rows[0]) / columns
        tiles = [[0] * columns for _ in range(lines)]
        for y, row in enumerate(rows):
            for x, pixel in enumerate(row):
                if is_coloured(pixel):
                    tiles[int(y / high)][int(x / wide)] += 1 / (high * wide)
        return tiles


class Pictures(PlayerTest):
    # Least and greatest share of coloured pixels at half time
    SHARES = {"bouncing_balls": (0.001, 0.05), "hanging_cloth": (0.03, 0.5),
              "jelly_drop": (0.01, 0.3), "pendulum": (0.001, 0.05), "rope": (0.001, 0.05),
              "three_particles": (0.002, 0.1)}

    def test_all_scenes(self):
        for path in sorted(SCENES.glob("*.json")):
            for dark in False, True:
                with self.subTest(path.stem, dark=dark):
                    page = self.page(path, "--fps", "30")
                    seconds = self.open(page, hash="#t=1", dark=dark)
                    self.assertLess(seconds, 2)
                    self.assertGreater(self.get("counts", "textContent").count("·"), 1)
                    low, high = self.SHARES[path.stem]
                    share = self.coloured()[0][0]
                    print(f"{path.stem}: first frame {seconds:.2f} s, coloured {share:.4f}")
                    self.assertTrue(low < share < high)
                    background = self.picture()[0][0]
                    self.assertTrue(max(background) < 60 if dark else min(background) > 200)

    def test_a_square_is_where_it_should_be(self):
        """A planar cloth from its front: tiles in the middle are full, those at the sides empty."""
        cloth = {"type": "cloth", "n": [9, 9], "origin": [0, 0, 0], "row": [0, 0, 1],
                 "column": [1, 0, 0], "mass": 1, "k": 100}
        self.scene({"msim": 1, "gravity": [0, 0, -9.81], "objects": [cloth],
                    "run": {"integrator": "verlet", "h": 1e-3, "steps": 0}})
        self.open(self.page("scene.json"))
        tiles = self.coloured(9, 7)
        for line in range(2, 5):
            self.assertGreater(tiles[line][5], 0.95)
            self.assertEqual(tiles[line][0] + tiles[line][8], 0)

    def shades(self, *colliders):
        """Where a picture of two particles, seen from its front, is not background: the shares of
        3 x 3 tiles of its middle"""
        ends = {"x": [[-1, 0, -1], [1, 0, 1], [-1, 0, 1], [1, 0, -1]], "mass": 1}
        self.scene({"msim": 1, "gravity": [0, 0, -9.81], "particles": ends,
                    "colliders": list(colliders), "run": {"integrator": "verlet", "h": 1e-3,
                                                          "steps": 0}})
        self.open(self.page("scene.json"))
        rows = self.picture()
        high, wide = len(rows), len(rows[0])
        side, background = high // 8, rows[high // 2][5]
        tiles = []
        for j in (-1, 0, 1):
            for i in (-1, 0, 1):
                part = [rows[high // 2 + j * side + y][wide // 2 + i * side + x]
                        for y in range(-side // 2, side // 2) for x in range(-side // 2, side // 2)]
                tiles.append(sum(p != background for p in part) / len(part))
        return tiles

    def test_colliders_are_where_they_should_be(self):
        ball = {"type": "sphere", "center": [0, 0, 0], "radius": 0.25}
        bar = {"from": [-0.8, 0, 0], "to": [0.8, 0, 0], "radius": 0.2}
        self.assertEqual(self.shades(), [0] * 9)
        around, middle = (0, 1, 2, 3, 5, 6, 7, 8), self.shades(ball)
        self.assertGreater(middle[4], 0.95)
        self.assertTrue(all(middle[i] < 0.5 for i in around), middle)
        for kind in "capsule", "cylinder":
            row = self.shades({"type": kind, **bar})
            self.assertTrue(all(row[i] > 0.6 for i in (3, 4, 5)), row)
            self.assertTrue(all(row[i] < 0.3 for i in (0, 1, 2, 6, 7, 8)), row)
        upright = self.shades({"type": "box", "center": [0, 0, 0], "size": [1.6, 0.4, 0.4],
                               "rotation": [0, 1.5708, 0]})
        self.assertTrue(all(upright[i] > 0.9 for i in (1, 4, 7)), upright)
        self.assertTrue(all(upright[i] < 0.5 for i in (0, 2, 3, 5, 6, 8)), upright)

    def test_colliders_that_move_are_where_they_should_be(self):
        """A flat box, which its motion has turned upright and moved to the middle"""
        upright = self.shades({"type": "box", "center": [9, 0, 0], "size": [1.6, 0.4, 0.4],
                               "motion": {"t": [-1, 0], "x": [[9, 0, 0], [0, 0, 0]],
                                          "rotation": [[0, 0, 0], [0, 1.5708, 0]]}})
        self.assertTrue(all(upright[i] > 0.9 for i in (1, 4, 7)), upright)
        self.assertTrue(all(upright[i] < 0.5 for i in (0, 2, 3, 5, 6, 8)), upright)

    def test_height_fields_are_drawn(self):
        """A ridge from the front, up to a fifth of a unit above the middle; an sdf is not drawn."""
        ridge = self.shades({"type": "heightfield", "origin": [-0.8, -0.1, -3], "n": [2, 3],
                             "spacing": [1.6, 0.1], "heights": [0, 3.2, 0, 0, 3.2, 0]})
        self.assertTrue(all(ridge[i] > 0.9 for i in (6, 7, 8)), ridge)
        self.assertTrue(all(ridge[i] < 0.3 for i in (0, 1, 2)), ridge)
        self.assertEqual(self.shades({"type": "sdf", "origin": [0, 0, 0], "n": [2, 2, 2],
                                      "spacing": [1, 1, 1], "values": 8 * [1]}), [0] * 9)

    def test_a_bowl_shows_its_inner_side(self):
        room = {"type": "sphere", "center": [0, 0, 0], "radius": 3, "inside": True}
        picture = self.shades(room)
        self.assertTrue(all(share == 1 for share in picture), picture)
        self.assertGreater(self.coloured()[0][0], 0)  # the particles in it

    def test_phone(self):
        page = self.page(SCENES / "rope.json", "--t_end", "1")
        self.open(page, width=360, height=640, ratio=3)
        self.assertEqual(self.browser.evaluate("document.documentElement.scrollWidth"), 360)
        for name in "play", "frame", "speed", "reset", "quantity":
            right = self.browser.evaluate(
                f"{BY_ID.format(name)}.getBoundingClientRect().right")
            self.assertLessEqual(right, 360)
        self.assertGreater(self.get("picture", "clientHeight"), 200)


class Controls(PlayerTest):
    def setUp(self):
        super().setUp()
        self.open(self.page(SCENES / "rope.json", "--fps", "20"), hash="#t=1")

    def frame(self):
        return int(self.get("frame", "value"))

    def test_keys(self):
        self.assertEqual(self.frame(), 20)
        self.key("ArrowRight")
        self.assertEqual(self.frame(), 21)
        self.key("ArrowLeft")
        self.key("ArrowLeft")
        self.assertEqual(self.frame(), 19)
        self.key("End")
        self.assertEqual(self.frame(), 100)
        self.key("Home")
        self.assertEqual(self.frame(), 0)
        self.key(" ")
        self.assertEqual(self.get("play", "ariaLabel"), "Pause")
        self.browser.evaluate("new Promise(done => setTimeout(done, 500))")
        self.key(" ")
        self.assertEqual(self.get("play", "ariaLabel"), "Play")
        self.assertGreater(self.frame(), 1)

    def test_every_control_has_a_name(self):
        unnamed = self.browser.evaluate(
            "[...document.querySelectorAll('button, input, select, canvas')].filter("
            "e => !e.ariaLabel && !e.labels?.length && !e.textContent.trim()).map(e => e.id)")
        self.assertEqual(unnamed, [])

    def test_slider_and_curves(self):
        self.browser.evaluate("(f => { f.value = 50; f.dispatchEvent(new Event('input')); })"
                              f"({BY_ID.format('frame')})")
        self.settle()
        self.assertEqual(self.get("time", "textContent"), "2.50 / 5.00 s")
        self.assertEqual(self.get("values", "children.length"), 4)
        right, y = self.browser.evaluate(
            "(b => [b.right, b.y + 20])(document.getElementById('chart').getBoundingClientRect())")
        self.mouse("mousePressed", right - 5, y, button="left", buttons=1)
        self.settle()
        self.assertGreaterEqual(self.frame(), 98)

    def assert_moved(self, before):
        after = self.picture()
        self.assertNotEqual(before, after)
        return after

    def test_turn_zoom_move_reset(self):
        first = before = self.picture()
        for button, buttons in ("left", 1), ("right", 2):
            self.mouse("mousePressed", 400, 300, button=button, buttons=buttons)
            self.mouse("mouseMoved", 460, 330, button=button, buttons=buttons)
            self.mouse("mouseReleased", 460, 330, button=button)
            before = self.assert_moved(before)
        self.mouse("mouseWheel", 400, 300, deltaX=0, deltaY=-300)
        before = self.assert_moved(before)
        self.browser.page("Input.dispatchTouchEvent", type="touchStart", touchPoints=[
            {"x": 300, "y": 300, "id": 1}, {"x": 400, "y": 300, "id": 2}])
        self.browser.page("Input.dispatchTouchEvent", type="touchMove", touchPoints=[
            {"x": 250, "y": 300, "id": 1}, {"x": 450, "y": 300, "id": 2}])
        self.browser.page("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        self.assert_moved(before)
        self.browser.evaluate(f"{BY_ID.format('reset')}.click()")
        self.assertEqual(self.picture(), first)

    def test_colours(self):
        before = self.picture()
        for quantity in "tension", "speed":
            self.browser.evaluate(f"(q => {{ q.value = '{quantity}'; q.onchange(); }})"
                                  f"({BY_ID.format('quantity')})")
            before = self.assert_moved(before)
            self.assertRegex(self.get("top", "textContent"),
                             {"tension": r"≥ [\d.]+ m?N", "speed": r"≥ [\d.]+ m/s"}[quantity])


class Damage(PlayerTest):
    def test_a_page_that_was_cut_off(self):
        """As after kill -9: the frames whose lines are complete are shown."""
        self.scene()
        page = self.page("scene.json", "--every", "1")
        text = page.read_text()
        lines = text.count("\n", text.index('id="recording">'))
        page.write_text(text[:-1000])
        self.open(page)
        frames = self.browser.evaluate(f"+{BY_ID.format('frame')}.max") + 1
        self.assertTrue(90 < frames < lines - 3)
        self.assertIn(f"{frames} frames of 101", self.get("counts", "textContent"))

    def test_names(self):
        for name in "</script><script>alert(1)</script>", "<b>\"Härte\" & 布\n'":
            self.scene({**PENDULUM, "name": name})
            self.open(self.page("scene.json", "--steps", "2", "--every", "1"))
            self.assertEqual(self.get("name", "textContent"), name)

    def test_extreme_scenes(self):
        """One particle, one frame, no springs, coordinates far away, nothing that moves"""
        far = [[1e9, 0, -1e12], [1e9 + 0.5, 0.1, -1e12]]
        for x, steps in (([[1e100, -3, 0.1]], 0), (far, 3), ([[0, 0, 0]], 3)):
            self.scene({"msim": 1, "particles": {"x": x, "mass": 1},
                        "run": {"integrator": "verlet", "h": 0.1, "steps": steps}})
            self.open(self.page("scene.json", "--every", "1"))
            self.assertGreater(self.coloured()[0][0], 0)
            text = self.browser.evaluate("document.body.innerText")
            self.assertNotRegex(text, "NaN|Infinity|undefined")


class Speed(PlayerTest):
    def test_cloth(self):
        """Counted in CPU time, which does not depend on what else runs, and compared with as many
        triangles drawn one by one: a fifth to a quarter of these, or 80 to 105 ms on a Zen 3."""
        page = self.page(SCENES / "hanging_cloth.json", "--fps", "84")
        first = min(self.browser.open(page) for _ in range(3))
        fps, used = self.measure("")
        self.browser.page("Page.navigate", url="about:blank")
        reference = self.measure(DRAW_TRIANGLES)[1]
        print(f"cloth 64 x 64: {page.stat().st_size} bytes, first frame {first:.2f} s, "
              f"{fps:.1f} frames/s, {1000 * used:.0f} ms of CPU a frame, the reference "
              f"{1000 * reference:.0f} ms")
        self.assertLess(first, 2)
        self.assertLess(used, 0.3 * reference)

    def measure(self, draw):
        """Frames a second, and CPU time of each"""
        before = cpu_seconds(self.browser.process.pid)
        fps = self.browser.evaluate(COUNT_FRAMES.replace("DRAW", draw))
        return fps, (cpu_seconds(self.browser.process.pid) - before) / (3 * fps)


if __name__ == "__main__":
    support.main()
