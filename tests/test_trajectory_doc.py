"""Tests of docs/trajectory.md: its program reads what a run has written, and its tables name what
the file holds."""
import re
import sys
import unittest

import support
from cli_support import CliTest

try:
    import h5py
    import numpy
except ImportError:
    h5py = numpy = None

DOC = (support.SOURCE / "docs/trajectory.md").read_text()
PROGRAM = re.search(r"```python\n(.*?)```", DOC, re.S).group(1)

CLOTH = {"msim": 1, "gravity": [0, 0, -9.81],
         "objects": [{"type": "cloth", "n": [5, 4], "origin": [0, 0, 1], "row": [0, 1, 0],
                      "column": [1, 0, 0], "mass": 0.3, "k": 1000, "pinned": ["corners"]}],
         "planes": [{"normal": [0, 0, 2], "offset": -4, "restitution": 0.5, "friction": 0.25}]}


class Document(CliTest):
    def setUp(self):
        super().setUp()
        support.require(re.search(r"(?m)^  hdf5 +yes ", self.good("list")), "the recorder hdf5")
        support.require(h5py, "h5py of PyPI")
        self.scene(CLOTH)
        self.good("run", "scene.json", "--integrator", "velocity-verlet", "--h", "1e-3", "--steps",
                  "100", "--every", "20", "--out", "run.vtkhdf", "--energies", "e.csv", "--reactions", "r.csv", "--springs",
                  "s.csv", "--quiet")

    def test_the_program(self):
        out = support.run(sys.executable, "-c", PROGRAM, cwd=self.folder)
        self.assertIn("6 frames of 20 particles, t = 0 to 0.1 s\n", out)
        self.assertRegex(out, r"largest strain of a spring: 0\.\d{4}\n")
        self.assertRegex(out, r"change of the total energy: \d\.\d\de-\d+ J\n")

    def test_the_numbers(self):
        """Strain, tension and energies follow from positions, scene and velocities."""
        scope = {}
        with h5py.File(self.folder / "run.vtkhdf") as file:
            planes = file["msim/planes"][:]
            k, rest = (file["VTKHDF/CellData"][name][:] for name in ("Stiffness", "RestLength"))
            tension = file["VTKHDF/CellData/Tension"][:]
            energies = numpy.transpose([file["VTKHDF/FieldData"][name + "Energy"][:] for name in
                                        ("Kinetic", "Elastic", "Gravitational")])
            pinned = file["VTKHDF/PointData/Pinned"][:]
            mass, v, reaction = (file["VTKHDF/PointData"][name][:] for name in
                                 ("Mass", "Velocity", "Reaction"))
        exec(compile(PROGRAM.replace('"run.vtkhdf"', f'"{self.folder}/run.vtkhdf"'), "doc", "exec"),
             scope)
        x, ij, strain, n = (scope[key] for key in ("x", "ij", "strain", "springs"))
        k, rest = k[:n], rest[:n]
        length = numpy.linalg.norm(x[:, ij[:, 0]] - x[:, ij[:, 1]], axis=2)
        self.assertGreater(strain.max(), 1e-3)
        numpy.testing.assert_allclose(strain[:, :n], (length - rest) / rest, rtol=1e-6, atol=1e-9)
        numpy.testing.assert_allclose(tension.reshape(strain.shape)[:, :n], k * (length - rest),
                                      rtol=1e-6, atol=1e-9)
        table = [[float(row[key]) for key in ("kinetic", "elastic", "gravitational")]
                 for row in self.rows("e.csv")]
        self.assertEqual(energies.tolist(), table)
        force = numpy.zeros_like(x)  # without damping
        pull = (k * (length - rest) / length)[..., None] * (x[:, ij[:, 1]] - x[:, ij[:, 0]])
        for frame in range(len(x)):
            numpy.add.at(force[frame], ij[:, 0], pull[frame])
            numpy.add.at(force[frame], ij[:, 1], -pull[frame])
        force += mass[:, None] * [0, 0, -9.81]
        numpy.testing.assert_allclose(reaction.reshape(x.shape), -force * pinned[:, None],
                                      rtol=1e-6, atol=1e-6)
        self.assertGreater(abs(reaction).max(), 0.5)
        self.assertEqual(
            [numpy.float32([row["fx"], row["fy"], row["fz"]]).tolist() for row in self.rows("r.csv")],
            reaction.reshape(x.shape)[:, pinned == 1].reshape(-1, 3).tolist())
        springs = [[float(row[key]) for key in ("tension", "elongation", "strain")]
                   for row in self.rows("s.csv")]
        elongation = (length - rest).ravel()
        numpy.testing.assert_allclose(springs, numpy.transpose(
            [numpy.tile(k, len(x)) * elongation, elongation, elongation / numpy.tile(rest, len(x))]),
            rtol=1e-9, atol=1e-12)
        self.assertEqual(planes.tolist(), [[0, 0, 1, -2, 0.5, 0.25]])
        self.assertEqual(numpy.flatnonzero(pinned).tolist(), [0, 3, 16, 19])
        self.assertEqual(scope["triangles"].shape, (24, 3))

    def test_the_tables(self):
        """Every dataset that they name is there, and every one of the file is named, but those that
        only VTK needs."""
        named = re.findall(r"`([A-Za-z/0-9]+)`", "".join(re.findall(r"(?m)^\| [^|]*\|", DOC)))
        with h5py.File(self.folder / "run.vtkhdf") as file:
            found = set()
            file.visititems(lambda name, item: found.add(name) if hasattr(item, "shape") else None)
        known = {name.rsplit("/", 1)[-1] for name in named}
        own = {name for name in found if not re.search(r"/Steps/|Number|Offsets|Vertices|Strips", name)}
        self.assertEqual({name for name in own if name.rsplit("/", 1)[-1] not in known}, set())
        short = {name.rsplit("/", 1)[-1] for name in found}
        self.assertEqual(known - short - {"out", "pvd", "csv", "VTKHDF", "msim"}, set())


if __name__ == "__main__":
    support.main()
