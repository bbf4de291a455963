"""`msim_cli rest` above a floor: what reactions and friction leave of all forces, by Coulomb's law."""
import numpy as np

import support
from cli_support import CliTest
from test_rest_scenes import Scene, net


def sagging_net(slack, pinned):
    """A net over the floor, some of which it touches."""
    s = net(5, 5, slack, pinned=pinned)
    s.x = [[x, y, z + 0.05] for x, y, z in s.x]
    return s


def dropped_block(n, k):
    """A lattice that falls farther than it is high in the long steps of the search."""
    s = Scene()
    for i in range(n ** 3):
        s.add([0.1 * (i // n // n), 0.1 * (i // n % n), 0.02 + 0.1 * (i % n)], 0.1)
        for j in range(i):
            if max(abs(a - b) for a, b in zip(s.x[i], s.x[j])) < 0.11:
                s.join(j, i, k)
    return s


FLOOR = {
    "slack net, corners pinned": lambda: sagging_net(1.6, "corners"),
    "slack net, one edge pinned": lambda: sagging_net(1.3, "first"),
    "slack net, two edges pinned": lambda: sagging_net(1.8, "edges"),
    "block": lambda: dropped_block(2, 6e4),
    "larger block": lambda: dropped_block(3, 5e3),
}


class RestOnFloor(CliTest):
    def check_on_floor(self, s, friction):
        """Reactions and friction within Coulomb's cone balance all forces."""
        tree = s.json()
        tree["planes"] = [{"normal": [0, 0, 1], "offset": 0, "restitution": 0,
                           "friction": friction}]
        self.scene(tree)
        self.good("rest", "scene.json", "--final", "rest.json")
        x = np.array(self.final("rest.json")["x"])
        free = s.free()
        self.assertGreaterEqual(x[free, 2].min(), 0)
        left = s.forces(x)
        on = np.intersect1d(free, np.flatnonzero(x[:, 2] < 1e-10))
        self.assertGreater(len(on), 0)
        held = friction * np.maximum(0, -left[on, 2])
        pull = np.linalg.norm(left[on, :2], axis=1)
        left[on, :2] *= np.maximum(0, 1 - held / np.maximum(pull, 1e-300))[:, None]
        left[on, 2] = np.maximum(0, left[on, 2])
        self.assertLessEqual(np.linalg.norm(left[free], axis=1).max(), 1e-8 * s.weight())

    def test_on_a_floor(self):
        for name, make in FLOOR.items():
            for friction in (0, 0.1, 0.5):
                with self.subTest(name, friction=friction):
                    self.check_on_floor(make(), friction)


if __name__ == "__main__":
    support.main()
