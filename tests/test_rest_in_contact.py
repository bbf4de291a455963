"""`msim_cli rest` on balls, in bowls, valleys and corners: reactions that push, and friction within
Coulomb's cone, balance all forces, nothing is behind an obstacle, and without friction no
eigenvalue of the Lagrangian's Hessian is negative, all by the formulas of this file."""
import itertools
import math

import numpy as np

import support
from cli_support import CliTest
from test_rest_scenes import Scene, iterations

TOUCH = 1e-9  # m


class Obstacles:
    """Planes (normal, offset) and spheres (center, radius, inside) of one friction."""

    def __init__(self, planes=(), spheres=(), friction=0.0):
        self.planes = [(np.array(n, float) / np.linalg.norm(n), d) for n, d in planes]
        self.spheres = [(np.array(c, float), r, inside) for c, r, inside in spheres]
        self.friction = friction

    def add_to(self, tree):
        common = {"restitution": 0, "friction": self.friction}
        tree["planes"] = [{"normal": n.tolist(), "offset": d, **common} for n, d in self.planes]
        tree["colliders"] = [{"type": "sphere", "center": c.tolist(), "radius": r,
                              "inside": inside, **common} for c, r, inside in self.spheres]
        return tree

    def find(self, x):
        """Distance, normal and curvature of each obstacle at x; > 0: it bends away."""
        found = [(n @ x - d, n, 0.0) for n, d in self.planes]
        for center, radius, inside in self.spheres:
            away = x - center
            r, side = np.linalg.norm(away), -1 if inside else 1
            found.append((side * (r - radius), side * away / r, side / radius))
        return found

    def touching(self, x):
        return [(n, bend) for gap, n, bend in self.find(x) if gap < TOUCH]


def left_by_planes(normals, friction, f):
    """What reactions at these normals, and friction, leave of the force f: the least |f + C w|,
    w >= 0, C the edges of the cones along which friction acts against f, by enumeration."""
    edges = list(normals)
    for n in normals if friction else []:
        along = [f - f @ n * n] + [np.cross(n, m) for m in normals]
        for t in along:
            size = np.linalg.norm(t)
            if size > 1e-12:
                edges += [n + friction * t / size, n - friction * t / size]
    least = np.linalg.norm(f)
    for k in (1, 2, 3):
        for chosen in itertools.combinations(edges, k):
            C = np.array(chosen).T
            w = np.linalg.lstsq(C, -f, rcond=None)[0]
            if w.min() >= 0:
                least = min(least, np.linalg.norm(f + C @ w))
    return least


def least_eigenvalue(s, on, x):
    """Of K - sum N d^2 gap/dx^2 for motions that keep pressed particles on their surfaces, over the
    largest of K."""
    K, f, free = s.stiffness_matrix(x), s.forces(x), s.free()
    scale = np.abs(np.linalg.eigvalsh(K)).max()
    held = [np.zeros(3 * len(free))]
    for at, p in enumerate(free):
        contacts, row = on.touching(x[p]), slice(3 * at, 3 * at + 3)
        for n, bend in contacts:
            push = -f[p] @ n
            if push > 1e-9 * s.weight() or len(contacts) > 1:
                held.append(np.zeros(3 * len(free)))
                held[-1][row] = n
            if len(contacts) == 1:
                K[row, row] -= push * bend * (np.eye(3) - np.outer(n, n))
    basis = np.linalg.svd(np.array(held))[2][np.linalg.matrix_rank(np.array(held)):].T
    return np.linalg.eigvalsh(basis.T @ K @ basis).min(initial=0) / scale


# -- bodies ----------------------------------------------------------------------------------------

def block(random, k):
    """A lattice with diagonals, turned at random."""
    s, sizes = Scene(), random.integers(2, 4, 3)
    points = np.array(list(itertools.product(*map(range, sizes))), float) - (sizes - 1) / 2
    for x in points:
        s.add(0.1 * x)
    for i, j in itertools.combinations(range(len(points)), 2):
        if np.abs(points[i] - points[j]).max() <= 1:
            s.join(i, j, k)
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    s.x = (np.array(s.x) @ turn).tolist()
    return s


def cloth(random, k):
    n = int(random.integers(5, 8))
    s, step = Scene(), 0.8 / (n - 1)
    for r, c in np.ndindex(n, n):
        s.add([step * c - 0.4, step * r - 0.4, 0], 0.4 / n ** 2)
    for r, c in np.ndindex(n, n):
        for to in ((r, c + 1), (r + 1, c), (r + 1, c + 1), (r + 1, c - 1)):
            if to[0] < n and 0 <= to[1] < n:
                s.join(r * n + c, to[0] * n + to[1], 0.1 * k)
    return s


def rope(random, k):
    n = int(random.integers(8, 16))
    s = Scene()
    for i in range(n):
        s.add([1.6 * i / (n - 1) - 0.8, 0, 0], 0.3 / n)
        if i:
            s.join(i - 1, i, k)
    return s


# -- places ----------------------------------------------------------------------------------------

def slope(angle, towards):
    return ([math.sin(angle) * math.cos(towards), math.sin(angle) * math.sin(towards),
             math.cos(angle)], 0)


def valley(random):
    return {"planes": [slope(random.uniform(0.3, 1.2), at) for at in (0, math.pi)]}


def corner(random):
    towards = [2 * math.pi * i / 3 + random.uniform(-0.4, 0.4) for i in range(3)]
    return {"planes": [slope(random.uniform(0.3, 1.1), at) for at in towards]}


def bowl(random):
    r = random.uniform(1.2, 2)
    return {"spheres": [([0, 0, r], r, True)]}


def ball_on_floor(random):
    r = random.uniform(0.25, 0.5)
    return {"spheres": [([0.03, -0.02, r], r, False)], "planes": [([0, 0, 1], 0)]}


class RestInContact(CliTest):
    def setUp(self):
        super().setUp()
        support.require("backend_cholmod" in support.plugins(), "the plugin cholmod")
        self.iterations = 0

    def rest(self, s, on, *options):
        self.scene(on.add_to(s.json()))
        out = self.good("rest", "scene.json", "--final", "rest.json", *options)
        return out, np.array(self.final("rest.json")["x"])

    def check(self, s, on):
        """Returns the positions at rest."""
        out, x = self.rest(s, on)
        self.iterations += iterations(out)
        f = s.forces(x)
        for p in s.free():
            self.assertGreaterEqual(min(gap for gap, _, _ in on.find(x[p])), -1e-12)
            normals = [n for n, _ in on.touching(x[p])]
            self.assertLessEqual(left_by_planes(normals, on.friction, f[p]), 1e-8 * s.weight())
        if not on.friction:
            self.assertIn("minimum     yes", out)
            self.assertGreaterEqual(least_eigenvalue(s, on, x), -1e-9)
        return x

    def check_drawn(self, body, place, friction, seed):
        """Lifted so that the start is free"""
        with self.subTest(body=body.__name__, place=place.__name__, friction=friction, seed=seed):
            random = np.random.default_rng(seed)
            s = body(random, 10 ** random.uniform(2.5, 4.5))
            on = Obstacles(**place(random), friction=friction)
            s.x = (np.array(s.x) + [0.03, -0.05, 0]).tolist()
            while min(gap for x in s.x for gap, _, _ in on.find(np.array(x))) < 0.01:
                s.x = (np.array(s.x) + [0, 0, 0.02]).tolist()
            self.check(s, on)

    def test_bodies_in_places(self):
        """All have an equilibrium, found in less than 500 iterations on average."""
        for seed, (body, place, friction) in enumerate(itertools.product(
                (block, cloth, rope), (valley, corner, bowl, ball_on_floor), (0, 0.2, 0.6))):
            self.check_drawn(body, place, friction, seed)
        self.assertLess(self.iterations, 500 * 36)

    def test_sets_that_come_round_again(self):
        """Where each particle may stick or slide, as in a rope in a bowl, sets of those that slide
        may come round again; in the last steps of the block nothing moves up to rounding."""
        for seed in range(20, 64):
            self.check_drawn(rope, bowl, 0.2, seed)
        self.check_drawn(block, valley, 0.6, 4)

    def check_is_not_held(self, s, on, *words):
        self.scene(on.add_to(s.json()))
        status, _, err = self.cli("rest", "scene.json")
        self.assertEqual(status, 2)
        self.assert_sentence(err, *words, "held by no obstacle")

    def pair(self, x, y):
        """Two particles on a spring, short against the obstacles"""
        s = Scene()
        s.join(s.add(x), s.add(y), 1e4)
        return s

    def test_the_bottom_of_a_bowl(self):
        """A bar of length l in a frictionless bowl is horizontal, sqrt(R^2 - l^2/4) below its
        center; with sin a = l/(2 R) the ends push it with m g tan a."""
        s = self.pair([0.1, 0.2, 0.3], [0.5, 0.2, 0.4])
        x = self.check(s, Obstacles(spheres=[([0, 0, 1], 1, True)]))
        length = np.linalg.norm(x[1] - x[0])
        sine = length / 2
        self.assertAlmostEqual(1e4 * (s.rest[0] - length), 0.981 * sine / math.sqrt(1 - sine ** 2),
                               delta=1e-7)
        for z in x[:, 2]:
            self.assertAlmostEqual(z, 1 - math.sqrt(1 - sine ** 2), delta=1e-7)

    def test_the_bottom_of_a_valley(self):
        """A bar along a valley of two frictionless planes comes to rest in its lowest line."""
        s = self.pair([0.3, 0, 0.6], [0.4, 0.5, 0.8])
        x = self.check(s, Obstacles(planes=[slope(0.5, 0), slope(0.9, math.pi)]))
        np.testing.assert_allclose(x[:, [0, 2]], 0, rtol=0, atol=1e-12)

    def test_a_bar_on_top_of_a_ball(self):
        """Without friction the balance is unstable: the bar slides off, past the ball."""
        balanced = self.pair([-0.1, 0, 0], [0.1, 0, 0])
        h = math.sqrt(1 - 0.01)
        balanced.x = [[-0.1, 0, h], [0.1, 0, h]]
        # tan a m g stretches the spring
        balanced.rest[0] = 0.2 - 0.981 * (0.1 / h) / 1e4
        self.scene(Obstacles(spheres=[([0, 0, 0], 1, False)]).add_to(balanced.json()))
        status, out, err = self.cli("rest", "scene.json", "--final", "rest.json")
        self.assertEqual((status, out), (2, ""))
        self.assert_sentence(err, "no equilibrium near the start", "1.96 N", "held by no obstacle")
        self.assertEqual(self.files(), ["scene.json"])

    def test_friction_holds_a_bar_on_a_ball(self):
        """Where the slope is below mu it stays; above, it slides off."""
        for angle, holds in ((0.35, True), (0.5, False)):
            with self.subTest(angle=angle):
                n = np.array([math.sin(angle), 0, math.cos(angle)])
                y = np.array([0, 0.02, 0])
                s = self.pair(1.001 * n - y, 1.001 * n + y)
                on = Obstacles(spheres=[([0, 0, 0], 1, False)], friction=math.tan(0.4))
                if holds:
                    self.check(s, on)
                    continue
                self.check_is_not_held(s, on)

    def test_a_slope(self):
        """A body slides along planes that do not face its weight, unless friction holds it."""
        for friction, holds in ((0, False), (math.tan(0.29), False), (math.tan(0.31), True)):
            with self.subTest(friction=friction):
                s = self.pair([0, 0, 0.5], [0.1, 0, 0.5])
                on = Obstacles(planes=[slope(0.3, 0)], friction=friction)
                if holds:
                    self.check(s, on)
                    continue
                self.check_is_not_held(s, on, "1.96 N")

    def test_friction_stops_what_slides(self):
        """A particle slides down a slope until friction holds it by the spring above it: at a
        tension from m g (sin a - mu cos a), mu up to 1 % less in the last steps."""
        for angle, friction, k in ((0.8, 0.5, 1000), (0.5, 0.3, 200), (1.1, 0.2, 1e4)):
            with self.subTest(angle=angle):
                down = np.array([math.cos(angle), 0, -math.sin(angle)])
                s = Scene()
                s.join(s.add(-down, pinned=True), s.add([0, 0, 0]), k)
                x = self.check(s, Obstacles(planes=[slope(angle, 0)], friction=friction))
                weight, limit = 0.981 * math.sin(angle), 0.981 * friction * math.cos(angle)
                self.assertGreaterEqual(k * (down @ x[1]), weight - limit - 1e-8)
                self.assertLessEqual(k * (down @ x[1]), weight - 0.99 * limit + 1e-8)

    def test_curved_in_one_direction(self):
        """A bar across a trough, a cylinder inside out: as in a bowl, and free along the axis. On a
        cylinder lying on its side it slides off."""
        for inside in (True, False):
            s = self.pair([0.2, 0.1, 0.5 if inside else 1.1], [-0.2, 0.1, 0.5 if inside else 1.1])
            tree = s.json()
            tree["colliders"] = [{"type": "cylinder", "from": [0, -3, 0], "to": [0, 3, 0], "radius": 1,
                                  "inside": inside}]
            self.scene(tree)
            if not inside:
                status, _, err = self.cli("rest", "scene.json")
                self.assertEqual(status, 2)
                self.assert_sentence(err, "held by no obstacle")
                continue
            out = self.good("rest", "scene.json", "--final", "rest.json")
            self.assertIn("minimum     yes", out)
            x = np.array(self.final("rest.json")["x"])
            np.testing.assert_allclose(np.hypot(x[:, 0], x[:, 2]), 1, rtol=0, atol=1e-12)
            np.testing.assert_allclose(x[0, 2], x[1, 2], rtol=0, atol=1e-7)
            self.assertLess(x[0, 2], -0.9)

    def test_threads(self):
        """The same bits by any number of threads."""
        random = np.random.default_rng(5)
        s, on = cloth(random, 1000), Obstacles(**ball_on_floor(random), friction=0.3)
        s.x = (np.array(s.x) + [0, 0, 1.1]).tolist()
        one, two = (self.rest(s, on, "--threads", n)[1] for n in ("1", "2"))
        np.testing.assert_array_equal(one, two)


if __name__ == "__main__":
    support.main()
