"""Tests impacts on moving spheres against an independent event-driven reference: particles under
gravity, 100 random scenes, spheres on piecewise linear and cubic paths, and a bowl that moves."""
import json
import math
import random
import subprocess
import tempfile
import unittest
from pathlib import Path

import support

GRAVITY = (0.0, 0.0, -9.81)
SPAN, KNOTS, SAMPLES = 0.7, 5, 2800
METHODS = (("velocity-verlet", 0.07), ("dop853", 0.05), ("rk4", 0.01))  # in turn


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def combine(a, f, b):
    return [p + f * q for p, q in zip(a, b)]


class Ball:
    """A sphere on a path: restitution e, friction mu; inside: a bowl."""

    def __init__(self, rng, inside):
        self.inside, self.e, self.mu = inside, rng.uniform(0.4, 1), rng.uniform(0, 0.4)
        self.radius = 2.5 if inside else rng.uniform(0.2, 0.5)
        self.cubic = rng.random() < 0.5
        self.t = [SPAN * (k / (KNOTS - 1)) * 1.1 - 0.02 for k in range(KNOTS)]
        wide = 0.3 if inside else 1.2
        self.x = [[rng.uniform(-wide, wide) for _ in range(3)] for _ in range(KNOTS)]
        self.slope = [self.slope_at(k) for k in range(KNOTS)]

    def slope_at(self, k):
        """Of the parabola through three points; 0 at both ends"""
        if k in (0, KNOTS - 1):
            return [0.0] * 3
        t0, t1, t2 = self.t[k - 1:k + 2]
        return [((b - a) * (t2 - t1) / (t1 - t0) + (c - b) * (t1 - t0) / (t2 - t1)) / (t2 - t0)
                for a, b, c in zip(*self.x[k - 1:k + 2])]

    def place(self, t, after=True):
        """Center and velocity, at a time of the path those of the interval after it, or before"""
        k = max(i for i in range(KNOTS) if i == 0 or self.t[i] < t or (after and self.t[i] <= t))
        if k == KNOTS - 1 or t < self.t[0]:
            return self.x[k], [0.0] * 3
        size = self.t[k + 1] - self.t[k]
        s = (t - self.t[k]) / size
        first, last = self.x[k], self.x[k + 1]
        if not self.cubic:
            return ([a + s * (b - a) for a, b in zip(first, last)],
                    [(b - a) / size for a, b in zip(first, last)])
        shape = ((1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s),
                 size * s * (1 - s) ** 2, -size * s * s * (1 - s))
        rate = (-6 * s * (1 - s) / size, 6 * s * (1 - s) / size,
                (1 - s) * (1 - 3 * s), s * (3 * s - 2))
        of = list(zip(first, last, self.slope[k], self.slope[k + 1]))
        return [dot(shape, p) for p in of], [dot(rate, p) for p in of]

    def gap(self, x, t):
        distance = math.dist(x, self.place(t)[0]) - self.radius
        return -distance if self.inside else distance

    def reflect(self, x, v, t):
        """The velocity after an impact, and the relative normal speed over the speed before"""
        center, u = self.place(t)
        sign = (-1 if self.inside else 1) / math.dist(x, center)
        n = [sign * (a - b) for a, b in zip(x, center)]
        w = combine(v, -1, u)
        normal, size = dot(n, w), math.sqrt(dot(w, w))
        along = combine(w, -normal, n)
        speed = math.sqrt(dot(along, along))
        keep = max(0, 1 - self.mu * (1 + self.e) * -normal / speed) if speed else 0
        after = combine([keep * a for a in along], -self.e * normal, n)
        return combine(after, 1, u), -normal / size

    def scene(self):
        return {"type": "sphere", "center": self.x[0], "radius": self.radius,
                "restitution": self.e, "friction": self.mu, "inside": self.inside,
                "motion": {"t": self.t, "x": self.x,
                           "interpolation": "cubic" if self.cubic else "linear"}}


def fly(x, v, t):
    return (combine(combine(x, t, v), t * t / 2, GRAVITY), combine(v, t, GRAVITY))


def next_impact(x, v, t, balls):
    """The first ball met after t, and when: by samples, then bisection"""
    step = SPAN / SAMPLES
    before = t + 1e-9
    while before < SPAN:
        after = min(before + step, SPAN)
        hit = [b for b in balls if b.gap(fly(x, v, after - t)[0], after) < 0]
        if hit:
            found = []
            for ball in hit:
                low, high = before, after
                for _ in range(60):
                    middle = (low + high) / 2
                    inside = ball.gap(fly(x, v, middle - t)[0], middle) < 0
                    low, high = (low, middle) if inside else (middle, high)
                found.append((high, ball))
            return min(found, key=lambda f: f[0])
        before = after
    return SPAN, None


def follow(x, v, balls):
    """The end of the path, its number of impacts, and how grazing they were"""
    t, impacts, graze, least = 0.0, 0, 1.0, 1.0
    while True:
        when, ball = next_impact(x, v, t, balls)
        least = min(least, when - t if impacts else 1)
        x, v = fly(x, v, when - t)
        t = when
        if ball is None:
            return x, v, impacts, min(graze, 50 * least)
        v, share = ball.reflect(x, v, t)
        graze, impacts = min(graze, share), impacts + 1
        if impacts > 5:
            return x, v, impacts, 0.0


def random_scene(rng):
    balls = [Ball(rng, False) for _ in range(2)]
    if rng.random() < 0.5:
        balls.append(Ball(rng, True))
    x = [rng.uniform(-0.5, 0.5) for _ in range(3)]
    v = [rng.uniform(-4, 4) for _ in range(3)]
    free = all(b.gap(x, 0) > 0.02 for b in balls)
    return (balls, x, v) if free else random_scene(rng)


class MovingBilliards(unittest.TestCase):
    def run_scene(self, folder, scene, method, h):
        path, final = Path(folder, "scene.json"), Path(folder, "final.json")
        path.write_text(json.dumps(scene))
        subprocess.run([support.setting("CLI"), "run", str(path), "--integrator", method, "--h",
                        str(h), "--t_end", str(SPAN), "--collision", "event", "--final",
                        str(final), "--quiet"], check=True)
        return json.loads(final.read_text())

    def test_random_scenes(self):
        rng = random.Random(11)
        done = impacts = 0
        with tempfile.TemporaryDirectory() as folder:
            while done < 100:
                balls, x, v = random_scene(rng)
                end, speed, count, graze = follow(x, v, balls)
                if graze < 0.1 or count == 0:
                    continue
                scene = {"msim": 1, "gravity": GRAVITY,
                         "particles": {"x": [x], "v": [v], "mass": 1},
                         "colliders": [b.scene() for b in balls]}
                for method, h in (("velocity-verlet", SPAN), METHODS[done % 3]):
                    with self.subTest(scene=done, method=method, h=h):
                        final = self.run_scene(folder, scene, method, h)
                        self.assertEqual(final["stats"]["contacts"], count)
                        for a, b in zip(final["x"][0] + final["v"][0], end + speed):
                            self.assertAlmostEqual(a, b, delta=1e-6)
                done, impacts = done + 1, impacts + count
        self.assertGreater(impacts, 140)


if __name__ == "__main__":
    support.main()
