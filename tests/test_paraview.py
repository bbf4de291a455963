"""Tests of trajectories in the ParaView of the distribution, without a display: it opens *.pvd files
and shows cloths as surfaces with strain."""
import json
import shutil
import subprocess
import unittest

import support
from test_vtk_pvd import PvdTest

SCRIPT = '''
import json, sys
from paraview.simple import PVDReader, ExtractSurface, Threshold, UpdatePipeline
from paraview import servermanager

reader = PVDReader(FileName=sys.argv[1])
reader.UpdatePipelineInformation()
times = list(reader.TimestepValues)
shown = []
for t in times:
    surface = ExtractSurface(Input=reader)
    UpdatePipeline(time=t, proxy=surface)
    data = servermanager.Fetch(surface)
    strain = data.GetCellData().GetArray("Strain")
    shown.append({
        "points": data.GetNumberOfPoints(), "lines": data.GetNumberOfLines(),
        "polygons": data.GetNumberOfPolys(), "strains": strain.GetNumberOfTuples(),
        "strain": strain.GetRange(), "tension": data.GetCellData().GetArray("Tension").GetRange(),
        "pinned": data.GetPointData().GetArray("Pinned").GetRange(),
        "speed": data.GetPointData().GetArray("Velocity").GetRange(-1)})
version = servermanager.vtkSMProxyManager.GetVersionMajor(), servermanager.vtkSMProxyManager.GetVersionMinor()
with open(sys.argv[2], "w") as out:
    json.dump({"version": version, "times": times, "shown": shown}, out)
'''


class ParaView(PvdTest):
    def shown(self):
        support.require(shutil.which("pvbatch"), "ParaView")
        self.write("show.py", SCRIPT)
        done = subprocess.run(["pvbatch", "show.py", "run.pvd", "shown.json"], cwd=self.folder,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, timeout=300)
        self.assertNotRegex(done.stdout, "(?i)error|warning|ERR|WARN")
        self.assertEqual(done.returncode, 0, done.stdout)
        return json.loads((self.folder / "shown.json").read_text())

    def test_surfaces_with_strain(self):
        self.record()
        found = self.shown()
        print("ParaView", *found["version"])
        for value, expected in zip(found["times"], range(6)):
            self.assertAlmostEqual(value, expected / 50)
        self.assertEqual(len(found["times"]), 6)
        for i, frame in enumerate(found["shown"]):
            self.assertEqual((frame["points"], frame["polygons"]), (20, 24))
            self.assertEqual(frame["strains"], frame["lines"] + 24)
            self.assertEqual(frame["pinned"], [0, 1])
            self.assertEqual(frame["strain"][1] > 1e-7, i > 0)
            self.assertEqual(frame["speed"][1] > 1e-3, i > 0)
        self.assertGreater(found["shown"][-1]["tension"][1], 0.1)

    def test_a_run_that_was_killed(self):
        with self.start("run", "scene.json", "--steps", "10000000", "--every", "1000", "--out",
                        "run.pvd", "--quiet") as process:
            self.wait_for("run_frames/000009.vtp")
            process.kill()
            process.wait()
        frames = self.frames_in()
        found = self.shown()
        self.assertEqual(found["times"], [t for t, _ in frames])
        self.assertEqual({frame["polygons"] for frame in found["shown"]}, {24})


if __name__ == "__main__":
    support.main()
