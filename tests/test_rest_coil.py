"""`msim_cli rest` of a coil of angular springs, whose way to rest is long and curved."""
import math

import numpy as np

import support
from cli_support import CliTest
from test_rest_scenes import iterations

N, PER_TURN, K, K_ANGLE, MASS = 60, 20, 1e3, 0.05, 0.002
TURN = 2 * math.pi / PER_TURN * np.arange(N)
START = np.stack([0.1 * np.cos(TURN), 0.1 * np.sin(TURN), -0.03 / PER_TURN * np.arange(N)], 1)


def lengths_and_angles(x):
    d = x[1:] - x[:-1]
    lengths = np.sqrt(np.sum(d * d, axis=1))
    return lengths, np.arccos(-np.sum(d[1:] * d[:-1], axis=1) / (lengths[1:] * lengths[:-1]))


REST, BENT = lengths_and_angles(START)


def energy(x):
    lengths, angles = lengths_and_angles(x)
    elastic = K * np.sum((lengths - REST) ** 2) + K_ANGLE * np.sum((angles - BENT) ** 2)
    return elastic / 2 + 9.81 * MASS * np.sum(x[:, 2])


def coil(gravity, pinned):
    chain = np.arange(N)
    return {"msim": 1, "gravity": [0, 0, -gravity],
            "particles": {"x": START.tolist(), "mass": MASS, "pinned": pinned},
            "springs": {"ij": np.stack([chain[:-1], chain[1:]], 1).tolist(), "k": K,
                        "rest": REST.tolist()},
            "angles": {"ijk": np.stack([chain[:-2], chain[1:-1], chain[2:]], 1).tolist(),
                       "k": K_ANGLE, "rest": BENT.tolist()}}


class RestCoil(CliTest):
    def setUp(self):
        super().setUp()
        support.require("backend_cholmod" in support.plugins(), "the plugin cholmod")

    def test_hanging(self):
        """From its first two particles. The forces are derivatives of the energy by complex steps
        (Squire and Trapp 1998)."""
        self.scene(coil(9.81, [0, 1]))
        out = self.good("rest", "scene.json", "--final", "rest.json")
        self.assertIn("minimum     yes", out)
        self.assertLess(iterations(out), 1000)
        x = np.array(self.final("rest.json")["x"])
        self.assertLess(energy(x), energy(START))
        for p, c in np.ndindex(N - 2, 3):
            z = x.astype(complex)
            z[p + 2, c] += 1e-30j
            self.assertLessEqual(abs(energy(z).imag / 1e-30), 1e-8 * 9.81 * MASS * N)

    def test_start_at_rest(self):
        """Floating without gravity: the forces are rounding errors of k l, which are accepted."""
        self.scene(coil(0, []))
        self.assertEqual(iterations(self.good("rest", "scene.json")), 0)

    def test_straightening(self):
        """Without gravity, and without tensions at the start, which cannot be the measure of
        forces."""
        scene = coil(0, [])
        scene["angles"]["rest"] = math.pi
        self.scene(scene)
        self.good("rest", "scene.json", "--final", "rest.json")
        x = np.array(self.final("rest.json")["x"])
        np.testing.assert_allclose(np.linalg.norm(x[1:] - x[:-1], axis=1), REST, rtol=1e-9)
        self.assertAlmostEqual(np.linalg.norm(x[-1] - x[0]), REST.sum(), delta=1e-9)


if __name__ == "__main__":
    support.main()
