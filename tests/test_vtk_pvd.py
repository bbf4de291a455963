"""Tests of the built-in recorder pvd: VTK reads its frames, an interrupted run leaves a valid list,
and files of others stay."""
import os
import resource
import signal
import unittest
import xml.etree.ElementTree as ElementTree

import support
from cli_support import FOR_EVER, CliTest

try:
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader
except ImportError:
    np = None

CLOTH = {"msim": 1, "gravity": [0, 0, -9.81],
         "objects": [{"type": "cloth", "n": [5, 4], "origin": [0, 0, 1], "row": [0, 1, 0],
                      "column": [1, 0, 0], "mass": 0.3, "k": 1000, "pinned": ["first_corners"]}],
         "run": {"integrator": "velocity-verlet", "h": 1e-3, "t_end": 0.1, "every": 20}}


class PvdTest(CliTest):
    def setUp(self):
        super().setUp()
        self.scene(CLOTH)

    def record(self, *args):
        self.good("run", "scene.json", "--out", "run.pvd", "--quiet", *args)

    def frames_in(self, name="run.pvd"):
        """Times and files of the frames in a list, which is XML."""
        root = ElementTree.fromstring((self.folder / name).read_text())
        self.assertEqual((root.tag, root.get("type")), ("VTKFile", "Collection"))
        sets = root.findall("Collection/DataSet")
        return [(float(entry.get("timestep")), entry.get("file")) for entry in sets]

    def read(self, file):
        support.require(np, "VTK of PyPI")
        reader = vtkXMLPolyDataReader()
        reader.SetFileName(str(self.folder / file))
        reader.Update()
        self.assertEqual(reader.GetErrorCode(), 0)
        return reader.GetOutput()


class Content(PvdTest):
    def test_frames_are_those_of_the_run(self):
        self.record("--energies", "e.csv", "--reactions", "r.csv")
        self.good("run", "scene.json", "--out", "run.csv", "--quiet")
        rows, energies, reactions = (self.rows(name) for name in ("run.csv", "e.csv", "r.csv"))
        frames = self.frames_in()
        self.assertEqual([t for t, _ in frames], [float(row["t"]) for row in energies])
        self.assertEqual([file for _, file in frames], [f"run_frames/{i:06}.vtp" for i in range(6)])
        for (t, file), energy in zip(frames, energies):
            data = self.read(file)
            of_frame = [row for row in rows if float(row["t"]) == t]
            for name, columns in ((None, "xyz"), ("Velocity", ("vx", "vy", "vz"))):
                found = data.GetPointData().GetArray(name) if name else data.GetPoints().GetData()
                self.assertEqual(vtk_to_numpy(found).tolist(),
                                 [[float(row[c]) for c in columns] for row in of_frame])
            self.assertEqual(vtk_to_numpy(data.GetPointData().GetArray("Reaction"))[[0, 3]].tolist(),
                             [np.float32([row["fx"], row["fy"], row["fz"]]).tolist()
                              for row in reactions if float(row["t"]) == t])
            field = {name: data.GetFieldData().GetArray(name).GetValue(0) for name in
                     ("TimeValue", "Step", "KineticEnergy", "ElasticEnergy", "GravitationalEnergy")}
            self.assertEqual(list(field.values()), [
                t, float(energy["step"]),
                *(float(energy[key]) for key in ("kinetic", "elastic", "gravitational"))])

    def test_surfaces_with_strain(self):
        self.record()
        first, last = (self.read(self.frames_in()[i][1]) for i in (0, -1))
        x, x0 = (vtk_to_numpy(data.GetPoints().GetData()) for data in (last, first))
        ij = vtk_to_numpy(last.GetLines().GetConnectivityArray()).reshape(-1, 2)
        faces = vtk_to_numpy(last.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        self.assertEqual((last.GetNumberOfLines(), last.GetNumberOfPolys()), (len(ij), 24))
        self.assertEqual(last.GetNumberOfCells(), len(ij) + 24)
        length, rest = (np.linalg.norm(at[ij[:, 0]] - at[ij[:, 1]], axis=1) for at in (x, x0))
        strain = vtk_to_numpy(last.GetCellData().GetArray("Strain"))
        tension = vtk_to_numpy(last.GetCellData().GetArray("Tension"))
        expected = (length - rest) / rest
        np.testing.assert_allclose(strain[:len(ij)], expected, rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(tension[:len(ij)], 1000 * (length - rest), rtol=1e-5, atol=1e-9)
        self.assertGreater(strain.max(), 1e-4)
        of = {frozenset(ends): value for ends, value in zip(ij.tolist(), expected)}
        for corners, value in zip(faces.tolist(), strain[len(ij):]):
            edges = [frozenset(corners[i - 1:i + 1] or (corners[-1], corners[0])) for i in range(3)]
            self.assertAlmostEqual(value, np.mean([of[e] for e in edges if e in of]), delta=1e-8)
        pinned = vtk_to_numpy(last.GetPointData().GetArray("Pinned"))
        self.assertEqual(np.flatnonzero(pinned).tolist(), [0, 3])
        self.assertEqual(last.GetPointData().GetArray("Mass").GetValue(7), 0.3 / 20)

    def test_particles_alone(self):
        self.scene({"msim": 1, "particles": {"x": [[1, 2, 3], [4, 5, 6]], "mass": 2},
                    "run": {"integrator": "rk4", "t_end": 0.002}})
        self.record()
        data = self.read(self.frames_in()[-1][1])
        self.assertEqual((data.GetNumberOfPoints(), data.GetNumberOfCells()), (2, 0))

    def test_names_are_escaped(self):
        os.mkdir(self.folder / 'a "b"')
        name = 'a "b"/c & <d>.pvd'
        self.good("run", "scene.json", "--out", name, "--quiet")
        frames = self.frames_in(name)
        self.assertEqual(frames[5], (0.1, "c & <d>_frames/000005.vtp"))
        self.assertTrue((self.folder / 'a "b"' / frames[5][1]).exists())


class Interrupted(PvdTest):
    def stopped(self, number):
        """Frames of a run that a signal ends."""
        with self.start("run", "scene.json", "--steps", "10000000", "--every", "1000", "--out",
                        "run.pvd", "--quiet") as process:
            self.wait_for("run_frames/000009.vtp")
            process.send_signal(number)
            process.communicate(timeout=60)
        frames = self.frames_in()
        self.assertGreaterEqual(len(frames), 9)
        for t, file in frames:
            self.assertEqual(self.read(file).GetFieldData().GetArray("TimeValue").GetValue(0), t)
        return process.returncode

    def test_killed(self):
        self.assertEqual(self.stopped(signal.SIGKILL), -signal.SIGKILL)

    def test_ctrl_c(self):
        self.assertEqual(self.stopped(signal.SIGINT), 2)

    def test_a_full_disk(self):
        """The frame that did not fit is removed."""
        self.record("--steps", "0")
        size = (self.folder / "run_frames/000000.vtp").stat().st_size
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size - 1, size - 1))
        status, _, err = self.cli("run", "scene.json", "--out", "run.pvd", "--quiet",
                                  preexec_fn=limit)
        self.assertEqual(status, 1)
        self.assert_sentence(err, "run_frames/000000.vtp: cannot write the file: File too large")
        self.assertEqual(self.frames_in(), [])
        self.assertFalse((self.folder / "run_frames/000000.vtp").exists())


class Files(PvdTest):
    def test_a_shorter_run_replaces_a_longer_one(self):
        self.record()
        self.write("run_frames/notes.txt", "mine")
        self.record("--steps", "40")
        self.assertEqual(len(self.frames_in()), 3)
        self.assertEqual(sorted(os.listdir(self.folder / "run_frames")),
                         ["000000.vtp", "000001.vtp", "000002.vtp", "notes.txt"])

    def test_files_of_others_stay(self):
        run = ["run", "scene.json", "--out", "run.pvd", *FOR_EVER, "--every", "10000000"]
        self.write("run.pvd", "<VTKFile/>")
        self.assert_refused(run, "run.pvd exists and is not a trajectory", "--force")
        os.remove(self.folder / "run.pvd")
        self.write("run_frames", "a file")
        self.assert_refused(run, "run_frames: ", "Not a directory")
        os.remove(self.folder / "run_frames")
        os.mkdir(self.folder / "run_frames")
        self.write("run_frames/000123.vtp", "<VTKFile/>")
        self.assert_refused(run, "run_frames/000123.vtp exists and is not a frame of msim")
        self.assert_refused([*run, "--force"], "run_frames/000123.vtp exists")
        self.assertEqual((self.folder / "run_frames/000123.vtp").read_text(), "<VTKFile/>")

    def test_refusals_leave_nothing(self):
        run = ["run", "scene.json", "--out", "run.pvd"]
        self.assert_refused([*run, "--final", "missing/final.json"], "missing")
        self.assert_refused([*run, "--integrator", "dop853", "--every", "5"], "fps")
        self.assert_refused(["run", "scene.json", "--out", "missing/run.pvd"], "missing/run.pvd")
        self.record("--steps", "0")
        self.assert_refused([*run, "--resume"], "cannot be resumed")


if __name__ == "__main__":
    support.main()
