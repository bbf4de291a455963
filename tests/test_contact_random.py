"""Tests that error control keeps tol for random bodies that fall on planes, bounce, slide and rest.

The reference is dop853 with fixed steps of 1/8000 s and every event located; with twice that step
the difference is far below tol."""
import math
import random
import tempfile
import unittest

import support
from test_accuracy import Runner

TOL, SPAN = 1e-6, 0.6
SEEDS = (*range(40), 81, 191)  # regressions: rk4 failed at an impact located on Hermite's cubic
METHODS = ("dop853", "auto", "rk4", "tr-bdf2")


def plane(rng, tilt):
    angle = rng.uniform(0, 2 * math.pi)
    return {"normal": [math.sin(tilt) * math.cos(angle), math.sin(tilt) * math.sin(angle),
                       math.cos(tilt)],
            "offset": -rng.uniform(0, 0.2), "restitution": rng.choice([0, 0.3, 0.7, 1]),
            "friction": rng.choice([0, 0, 0.1, 0.5, 1])}


def scene(seed):
    """1 to 5 masses, each on springs to all others, over 1 to 3 planes of up to 40 degrees."""
    rng = random.Random(seed)
    n, nplanes = rng.choice([1, 2, 2, 3, 4, 4, 5]), rng.choice([1, 1, 2, 3])
    pairs = [[i, j] for i in range(n) for j in range(i + 1, n)]
    fall = {"gravity": [0, 0, -9.81],
            "particles": {"x": [[rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4),
                                 rng.uniform(0.2, 0.9)] for _ in range(n)],
                          "v": [[rng.uniform(-1, 1) for _ in range(3)] for _ in range(n)],
                          "mass": [10 ** rng.uniform(-1, 0.3) for _ in range(n)]},
            "planes": [plane(rng, rng.choice([0, rng.uniform(0, 0.7)])) for _ in range(nplanes)]}
    if pairs:
        fall["springs"] = {"ij": pairs, "k": [10 ** rng.uniform(1, 2.3) for _ in pairs],
                           "damping": rng.choice([0, 0, 0.05])}
    return fall


def distance(one, other):
    return max(abs(a - b) for x, y in zip(one["x"], other["x"]) for a, b in zip(x, y))


class RandomContact(unittest.TestCase):
    def check(self, runner, fall):
        fine, coarse = (runner.run(fall, {"integrator": "dop853", "collision": "event",
                                          "h": SPAN / steps, "steps": steps})
                        for steps in (4800, 2400))
        columns = list(zip(*fall["particles"]["x"]))
        extent = max(max(c) - min(c) for c in columns) or 1
        for method in METHODS:
            end = runner.run(fall, {"integrator": method, "tol": TOL, "t_end": SPAN})
            allowed = 10 * TOL * extent + 20 * distance(fine, coarse)
            self.assertLessEqual(distance(end, fine), allowed, method)
            self.assertLess(end["stats"]["steps"], 20000, method)

    def test_tol_is_kept(self):
        support.setting("CLI")
        with tempfile.TemporaryDirectory() as folder:
            for seed in SEEDS:
                with self.subTest(seed=seed):
                    self.check(Runner(folder), scene(seed))


if __name__ == "__main__":
    support.main()
