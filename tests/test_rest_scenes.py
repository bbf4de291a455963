"""`msim_cli rest` on scenes that are hard to bring to rest: what it finds is an equilibrium and a
minimum by the forces and the stiffness matrix of this file, or it says why there is none."""
import json
import math

import numpy as np

import support
from cli_support import CliTest

DOWN = (0, 0, -9.81)


class Scene:
    """Particles, springs and angular springs, which are straight at rest."""

    def __init__(self, gravity=DOWN):
        self.gravity = np.array(gravity, float)
        self.x, self.mass, self.pinned, self.force = [], [], [], []
        self.ij, self.k, self.rest, self.law = [], [], [], []
        self.ijk, self.stiffness = [], []

    def add(self, x, mass=0.1, pinned=False, force=(0, 0, 0)):
        """A particle; returns its number."""
        if pinned:
            self.pinned.append(len(self.x))
        self.x.append([float(c) for c in x])
        self.mass.append(mass)
        self.force.append([float(c) for c in force])
        return len(self.x) - 1

    def join(self, i, j, k=1000.0, slack=1.0, law="linear"):
        """A spring of `slack` times the length at the start."""
        self.ij.append([i, j])
        self.k.append(k)
        self.rest.append(slack * math.dist(self.x[i], self.x[j]))
        self.law.append(law)

    def stiffen(self, i, j, k, stiffness):
        self.ijk.append([i, j, k])
        self.stiffness.append(stiffness)

    def json(self):
        kinds = ["linear", "tension", "compression"]
        return {"msim": 1, "gravity": list(self.gravity),
                "particles": {"x": self.x, "mass": self.mass, "pinned": self.pinned,
                              "force": self.force},
                "laws": [{"type": kind} for kind in kinds],
                "springs": {"ij": self.ij, "k": self.k, "rest": self.rest,
                            "law": [kinds.index(law) for law in self.law]},
                "angles": {"ijk": self.ijk, "k": self.stiffness, "rest": math.pi}}

    def weight(self):
        """The largest force by which external forces are balanced, N; 1 without any."""
        of_gravity = sum(self.mass) * np.linalg.norm(self.gravity)
        return (of_gravity + np.linalg.norm(self.force, axis=1).sum()) or 1.0

    # -- forces and stiffness ----------------------------------------------------------------------

    def free(self):
        return np.setdiff1d(np.arange(len(self.x)), self.pinned)

    def spring_slopes(self, lengths):
        """df/dl of each spring and f/l."""
        stretch = lengths - np.array(self.rest)
        law = np.array(self.law)
        acts = ~((law == "tension") & (stretch <= 0) | (law == "compression") & (stretch >= 0))
        k = np.where(acts, self.k, 0.0)
        return k, k * stretch / lengths

    def forces(self, x):
        """The sum of all forces on each particle, n x 3; also for complex x."""
        f = np.array(self.force) + np.outer(self.mass, self.gravity) + 0 * x
        if self.ij:
            i, j = np.array(self.ij).T
            d = x[j] - x[i]
            tension = self.spring_slopes(np.linalg.norm(d, axis=1))[1][:, None] * d
            np.add.at(f, i, tension)
            np.add.at(f, j, -tension)
        for (i, j, k), stiffness in zip(self.ijk, self.stiffness):
            on_i, on_k = bending_forces(x[i] - x[j], x[k] - x[j], stiffness)
            f[i] += on_i
            f[k] += on_k
            f[j] -= on_i + on_k
        return f

    def stiffness_matrix(self, x):
        """K = -dF/dx of free particles; that of angular springs by complex steps (Squire and Trapp
        1998)."""
        n = len(x)
        K = np.zeros((n, 3, n, 3))
        if self.ij:
            i, j = np.array(self.ij).T
            d = x[j] - x[i]
            lengths = np.linalg.norm(d, axis=1)
            u = d / lengths[:, None]
            along, across = self.spring_slopes(lengths)
            uu = u[:, :, None] * u[:, None, :]
            block = along[:, None, None] * uu + across[:, None, None] * (np.eye(3) - uu)
            for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
                np.add.at(K, (a, slice(None), b), sign * block)
        for ijk, stiffness in zip(self.ijk, self.stiffness):
            for column in range(9):
                z = x[ijk].astype(complex)
                z.flat[column] += 1e-30j
                on_i, on_k = bending_forces(z[0] - z[1], z[2] - z[1], stiffness)
                rows = np.array([on_i, -on_i - on_k, on_k]).imag / 1e-30
                for at, row in zip(ijk, rows):
                    K[at, :, ijk[column // 3], column % 3] -= row
        free = self.free()
        return K[free][:, :, free].reshape(3 * len(free), 3 * len(free))


def bending_forces(p, q, stiffness):
    """-k phi dphi/dp and -k phi dphi/dq, phi the angle between p and -q. With c = cos phi = 1 - t,
    phi/sin phi = 1 + t/3 + 2 t^2/15 + O(t^3)."""
    a, b = np.sqrt(np.sum(p * p)), np.sqrt(np.sum(q * q))
    u, v = p / a, q / b
    t = np.sum((u + v) ** 2) / 2
    ratio = 1 + t / 3 + 2 * t * t / 15 + 2 * t ** 3 / 35
    if abs(t) > 1e-4:
        ratio = np.arccos(1 - t) / np.sqrt(t * (2 - t))
    # across the edges: v + (1 - t) u, without cancellation of the parts along them
    return (-stiffness * ratio / a * ((u + v) - t * u), -stiffness * ratio / b * ((u + v) - t * v))


# -- scenes ----------------------------------------------------------------------------------------

def net(rows, columns, slack, law="linear", pinned="corners", k=1000.0):
    """A horizontal net of cells of 0.1 m."""
    s = Scene()
    for r in range(rows):
        for c in range(columns):
            corner = r in (0, rows - 1) and c in (0, columns - 1)
            s.add([0.1 * c, 0.1 * r, 0], 0.01,
                  {"corners": corner, "edges": r in (0, rows - 1), "first": r == 0}[pinned])
            p = r * columns + c
            if c:
                s.join(p - 1, p, k, slack, law)
            if r:
                s.join(p - columns, p, k, slack, law)
    return s


def hung_cloth(n, k):
    """A horizontal cloth of 1 m with diagonals, hung by two corners, which hangs in folds at rest"""
    s = Scene()
    for p in range(n * n):
        r, c = p // n, p % n
        s.add([c / (n - 1), r / (n - 1), 0], 0.3 / n ** 2, p in (0, n - 1))
        if c:
            s.join(p - 1, p, k)
        for d in (-1, 0, 1):
            if r and 0 <= c + d < n:
                s.join(p - n + d, p, k)
    return s


def slack_cable():
    """A cable ten times as long as the distance of its ends, all in a horizontal line."""
    s = Scene()
    for i in range(41):
        s.add([i / 400, 0, 0], 0.02, i in (0, 40))
        if i:
            s.join(i - 1, i, 1e4, 10)
    return s


def loose_net_with_a_load():
    s = net(7, 7, 1.5, "tension")
    s.mass[24] = 5.0
    return s


def column(load, n=16, compressed=False):
    """A clamped column of n springs with bending stiffness EI = 0.5 N m^2 and length 1 m, under a
    load at its top; Euler's load is pi^2 EI/4 = 1.23 N."""
    s = Scene((0, 0, 0))
    for i in range(n + 2):
        top = i == n + 1
        s.add([0, 0, (i - 1) / n], 0.01, i < 2, (0, 0, -load if top else 0))
        if i > 1:
            s.join(i - 1, i, 5000, 1.01 if compressed else 1)
        if i > 1:
            s.stiffen(i - 2, i - 1, i, 0.5 * n)
    return s


def floating_beam():
    s = column(0, 60)
    s.pinned = []
    return s


def heavy_column():
    """The same column under its own weight, beyond Greenhill's 7.84 EI/l^2 = 3.9 N."""
    s = column(0)
    s.gravity = np.array(DOWN)
    s.mass = [0.1] * len(s.mass)
    return s


def lattice_column(load):
    """3 x 3 x 9 particles with diagonals, its bottom pinned, the load on its top."""
    s, number = Scene(), {}
    for z in range(9):
        for y in range(3):
            for x in range(3):
                force = (0, 0, -load / 9 if z == 8 else 0)
                number[x, y, z] = s.add([0.1 * x, 0.1 * y, 0.1 * z], 0.01, z == 0, force)
    for (x, y, z), p in number.items():
        for d in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1),
                  (0, 1, 1), (0, 1, -1)):
            if (x + d[0], y + d[1], z + d[2]) in number:
                s.join(p, number[x + d[0], y + d[1], z + d[2]], 500)
    return s


def compressed_plate():
    """A plane net, too large for its pinned border, without gravity."""
    s = net(8, 8, 1.1)
    s.gravity = np.zeros(3)
    s.pinned = [p for p in range(64) if p // 8 in (0, 7) or p % 8 in (0, 7)]
    return s


def tension_only_nets():
    """Pinned at random points; springs of random rest lengths, many slack."""
    random = np.random.default_rng(3)
    s = Scene()
    for p in range(60):
        s.add(random.random(3), 0.1 + random.random(), p < 4)
        for q in random.choice(p, min(p, 3), replace=False) if p >= 4 else []:
            s.join(int(q), p, 100 + 1000 * random.random(), 0.5 + random.random(), "tension")
    return s


def collapsed_chain():
    """Springs of 0.1 m, of which almost nothing is left at the start."""
    s = Scene()
    for i in range(6):
        s.add([0, 1e-9 * (i % 2), -1e-9 * i], pinned=i == 0)
        if i:
            s.join(i - 1, i)
            s.rest[-1] = 0.1
    return s


def spoked_wheel():
    """A hub on 12 pretensioned spokes to a pinned rim, loaded beyond the pretension."""
    s = Scene()
    hub = s.add([0, 0, 0], 30)
    for i in range(12):
        a = 2 * math.pi * i / 12
        s.join(hub, s.add([math.cos(a), 0.2 * (-1) ** i, math.sin(a)], 1, True), 2e4, 0.999,
               "tension")
    return s


def inverted_chain(n, k, straight=True):
    """A chain that stands on its pinned end: an equilibrium, but no minimum, if it is straight and
    its springs carry the weight."""
    s = Scene()
    for i in range(n):
        s.add([0 if straight else 0.01 * (i % 2), 0, 0.1 * i], 0.05, i == 0)
        if i:
            s.join(i - 1, i, k)
            s.rest[-1] += (n - i) * 0.05 * 9.81 / k if straight else 0
    return s


def inverted_sheet():
    """A cloth in a vertical plane, above the row that is pinned."""
    s = net(10, 10, 1.0, pinned="first", k=300.0)
    s.x = [[x, 0, y] for x, y, _ in s.x]
    return s


def snapped_truss():
    """A shallow pyramid whose top begins below its feet, under a load that pushes up."""
    s = Scene()
    top = s.add([0, 0, -0.2], 0.1, force=(0, 0, 40))
    for i in range(3):
        a = 2 * math.pi * i / 3
        s.join(top, s.add([math.cos(a), math.sin(a), 0], 1, True), 500)
    return s


def inverted_tetrahedron():
    """A tetrahedron turned inside out through its pinned base."""
    s = Scene()
    for i in range(3):
        a = 2 * math.pi * i / 3
        s.add([math.cos(a), math.sin(a), 0], 1, True)
    top = s.add([0, 0, 1.2], 0.5)
    for i in range(3):
        s.join(i, top, 200)
    s.x[top] = [0, 0, 0]
    return s


def bar(gravity, *forces):
    s = Scene(gravity)
    for i, force in enumerate(forces):
        s.add([i, 0, 0], 0.5, force=force)
        if i:
            s.join(i - 1, i, 100)
    return s


def floating_bodies():
    """A tetrahedron, a ring and a particle, deformed, without gravity."""
    s = Scene((0, 0, 0))
    for i in range(4):
        s.add([i % 2, i // 2, i % 3], 0.2)
        for j in range(i):
            s.join(j, i, 100, 1.3)
    for i in range(10):
        s.add([5 + math.cos(i), math.sin(i), 0.1 * i], 0.2)
        if i:
            s.join(3 + i, 4 + i, 50, 0.9)
    s.join(13, 4, 50, 0.9)
    s.add([9, 9, 9])
    return s


def with_a_floating_part():
    s = net(4, 4, 1.0)
    s.join(s.add([3, 0, 0]), s.add([4, 0, 0]))
    return s


def net_that_lets_go():
    """A particle on a spring that only pushes falls away from it."""
    s = Scene()
    s.join(s.add([0, 0, 1], pinned=True), s.add([0, 0, 0.5]), law="compression")
    return s


def spring_of_no_stiffness():
    s = Scene()
    s.join(s.add([0, 0, 0], pinned=True), s.add([1, 0, 0]), k=0)
    return s


MINIMA = {
    "slack net": lambda: net(8, 8, 1.3),
    "slack net, tension only": lambda: net(8, 8, 1.3, "tension"),
    "slack net between edges": lambda: net(9, 6, 2.0, "tension", "edges"),
    "hung cloth": lambda: hung_cloth(8, 1000),
    "hung cloth, soft": lambda: hung_cloth(12, 30),
    "slack cable": slack_cable,
    "loose net with a load": loose_net_with_a_load,
    "column below its buckling load": lambda: column(1.1),
    "buckled column": lambda: column(1.5),
    "buckled column, three times its load": lambda: column(3.7),
    "compressed column": lambda: column(1.5, compressed=True),
    "column under its weight": heavy_column,
    "column of a lattice": lambda: lattice_column(200),
    "compressed plate": compressed_plate,
    "tension-only net": tension_only_nets,
    "collapsed chain": collapsed_chain,
    "spoked wheel": spoked_wheel,
    "inverted pendulum": lambda: inverted_chain(2, 1e4),
    "inverted chain": lambda: inverted_chain(12, 1e4),
    "inverted chain, stiff": lambda: inverted_chain(12, 1e7),
    "inverted zigzag": lambda: inverted_chain(20, 500, False),
    "inverted sheet": inverted_sheet,
    "snapped truss": snapped_truss,
    "inverted tetrahedron": inverted_tetrahedron,
    "floating bodies": floating_bodies,
    "floating beam": floating_beam,
    "bar pulled at both ends": lambda: bar((0, 0, 0), (-3, 0, 0), (0, 0, 0), (3, 0, 0)),
    "bar pushed at both ends": lambda: bar((0, 0, 0), (3, 0, 0), (-3, 0, 0)),
    "bar that a couple turns": lambda: bar((0, 0, 0), (0, 2, 0), (0, -2, 0)),
    "bar held up by a force": lambda: bar((0, 0, -10), (0, 0, 10), (0, 0, 0)),
}

NONE = {
    "falling bar": (lambda: bar(DOWN, (0, 0, 0), (0, 0, 0)), ("9.81 N", "particle 0")),
    "bar pushed along": (lambda: bar((0, 0, 0), (1, 0, 0), (1, 0, 0)), ("2 N", "particle 0")),
    "net with a floating part": (with_a_floating_part, ("1.96 N", "particle 16")),
    "net that lets go": (net_that_lets_go, ("no equilibrium near", "particle 1 moves away")),
    "spring of no stiffness": (spring_of_no_stiffness, ("particle 1 moves away",)),
}


def iterations(out):
    """How many `rest` made, by its output"""
    return int(out.split("iterations")[1].split()[0])


class RestScenes(CliTest):
    def setUp(self):
        super().setUp()
        support.require("backend_cholmod" in support.plugins(), "the plugin cholmod")

    def check_minimum(self, s):
        """No force is left, and no eigenvalue of K is below 0 by more than K changes with the
        positions: those of mechanisms are 0."""
        self.scene(s.json())
        out = self.good("rest", "scene.json", "--final", "rest.json")
        self.assertIn("minimum     yes", out)
        x = np.array(self.final("rest.json")["x"])
        np.testing.assert_array_equal(x[s.pinned], np.array(s.x)[s.pinned])
        free = s.free()
        left = np.linalg.norm(s.forces(x)[free], axis=1).max()
        self.assertLessEqual(left, 1e-8 * s.weight())
        w = np.linalg.eigvalsh(s.stiffness_matrix(x))
        self.assertGreaterEqual(w[0], -1e-9 * w[-1])
        return iterations(out)

    def test_minima(self):
        """All in less than 90 iterations on average: with a line search that interpolates by
        parabolas it took 100, most of them along springs that hardly stretch."""
        sum_of_all = 0
        for name, make in MINIMA.items():
            with self.subTest(name):
                sum_of_all += self.check_minimum(make())
        self.assertLess(sum_of_all, 90 * len(MINIMA))

    def test_few_iterations(self):
        """The clamped matrix is too stiff for motions of cloth out of its surface: it took 349 and
        741."""
        for name in ("hung cloth", "hung cloth, soft"):
            with self.subTest(name):
                self.assertLess(self.check_minimum(MINIMA[name]()), 150)

    def check_modes(self, s, x, n, solver="auto"):
        """w^2 of `modes` against LAPACK's of M^-1/2 K M^-1/2, to 1e-9 or 4e-14 of the largest one,
        about an unstable state 1e-12, and K u = w^2 M u."""
        root = np.repeat(np.sqrt(np.array(s.mass)[s.free()]), 3)
        K = s.stiffness_matrix(x)
        wanted = np.linalg.eigvalsh(K / np.outer(root, root))
        n = min(n, len(wanted))
        self.write("at.json", json.dumps({"msim": 1, "status": "ok", "step": 0, "t": 0,
                                          "x": x.tolist(), "v": np.zeros_like(x).tolist()}))
        self.good("modes", "scene.json", "--init", "at.json", "-n", str(n), "--json", "modes.json",
                  "--solver", solver)
        modes = self.final("modes.json")
        w2 = np.sign(modes["frequency"]) * (2 * math.pi * np.array(modes["frequency"])) ** 2
        rounding = abs(wanted).max() * (1e-12 if wanted[0] < -1e-9 * wanted[-1] else 4e-14)
        np.testing.assert_allclose(w2, wanted[:n], rtol=1e-9, atol=rounding)
        shape = np.array(modes["shape"])
        self.assertEqual(abs(shape[:, s.pinned]).max(initial=0), 0)
        u = shape[:, s.free()].reshape(n, -1)
        left = K @ u.T / root[:, None] - w2 * u.T * root[:, None]
        self.assertLessEqual(np.linalg.norm(left, axis=0).max(), 1e-6 * abs(wanted).max())
        np.testing.assert_allclose(u * root ** 2 @ u.T, np.eye(n), rtol=0, atol=1e-9)

    def test_modes(self):
        """At the start, where many states are unstable, and at rest."""
        for name, make in MINIMA.items():
            s = make()
            self.scene(s.json())
            self.good("rest", "scene.json", "--final", "rest.json")
            for n in (1, 10, 30):
                with self.subTest(name, n=n):
                    self.check_modes(s, np.array(s.x), n)
                    self.check_modes(s, np.array(self.final("rest.json")["x"]), n)

    def test_modes_by_iterations(self):
        """By pcg, whose errors of a rigid motion are above low theta."""
        for name in ("buckled column", "floating bodies"):
            with self.subTest(name):
                s = MINIMA[name]()
                self.scene(s.json())
                self.good("rest", "scene.json", "--final", "rest.json")
                self.check_modes(s, np.array(self.final("rest.json")["x"]), 10, "pcg")

    def test_no_equilibrium(self):
        for name, (make, words) in NONE.items():
            with self.subTest(name):
                self.scene(make().json())
                status, out, err = self.cli("rest", "scene.json", "--final", "rest.json")
                self.assertEqual((status, out), (2, ""))
                self.assert_sentence(err, *words)
                self.assertEqual(self.files(), ["scene.json"])

    def test_the_stiffness_is_that_of_the_forces(self):
        """K by this file against differences of its forces."""
        random = np.random.default_rng(1)
        for make in (lambda: column(1), tension_only_nets, floating_bodies):
            s = make()
            x = np.array(s.x) + 1e-3 * random.standard_normal((len(s.x), 3))
            free, u = s.free(), random.standard_normal((len(s.x), 3))
            u[s.pinned] = 0
            difference = (s.forces(x - 1e-7 * u) - s.forces(x + 1e-7 * u))[free] / 2e-7
            product = s.stiffness_matrix(x) @ u[free].ravel()
            np.testing.assert_allclose(product, difference.ravel(), rtol=0,
                                       atol=1e-5 * np.abs(product).max())


if __name__ == "__main__":
    support.main()
