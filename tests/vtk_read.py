"""Reads a trajectory with VTK's own reader and compares it with what was recorded.

    vtk_read.py BASE              BASE.vtkhdf against BASE.csv (x, v of each frame) and BASE.json
                                  (the rest)
    vtk_read.py states REPLAY     the files that crashes leave, made by the program test_hdf5_replay

Frames that were planned but not written must be there and be empty. Exit status 77 without VTK, 1 where MSIM_COMPLETE is set.
"""
import csv
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkVersion
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader
except ImportError as reason:
    print(f"VTK is missing: {reason}")
    sys.exit(1 if "MSIM_COMPLETE" in os.environ else 77)


def read_csv(path, n):
    """Steps, times and the frames of x and v, by step."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name]) for row in rows]).reshape(-1, n)
               for name in ("t", "x", "y", "z", "vx", "vy", "vz")}
    x = np.stack([columns[name] for name in ("x", "y", "z")], axis=2)
    v = np.stack([columns[name] for name in ("vx", "vy", "vz")], axis=2)
    return columns["t"][:, 0], x, v


def equal(what, found, expected):
    """Bit for bit, so that -0.0 is not 0.0."""
    found = np.ascontiguousarray(found)
    expected = np.asarray(expected, dtype=found.dtype).reshape(found.shape)
    if found.tobytes() != expected.tobytes():
        worst = np.flatnonzero(found.ravel() != expected.ravel())[:1]
        sys.exit(f"{what}: differs, first at {worst}")


def array(data, name):
    found = data.GetAbstractArray(name)
    if found is None:
        sys.exit(f"{name} is missing")
    return vtk_to_numpy(found)


def piece(reader):
    """The poly data of the present step, which newer versions of VTK wrap in a collection."""
    data = reader.GetOutputDataObject(0)
    while data is not None and data.IsA("vtkCompositeDataSet"):
        iterator = data.NewIterator()
        iterator.InitTraversal()
        data = iterator.GetCurrentDataObject()
    return data


def open_file(path):
    reader = vtkHDFReader()
    reader.SetFileName(path)
    if not reader.CanReadFile(path):
        sys.exit(f"VTK cannot read {path}")
    reader.UpdateInformation()
    key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    information = reader.GetOutputInformation(0)
    return reader, [information.Get(key, i) for i in range(information.Length(key))]


def check_mesh(data, expected):
    equal("Mass", array(data.GetPointData(), "Mass"), expected["mass"])
    none = len(expected["faces"]) // 3 * [0]
    for name, key in (("Stiffness", "k"), ("RestLength", "rest"), ("Damping", "damping")):
        equal(name, array(data.GetCellData(), name), expected[key] + none)
    equal("Pinned", array(data.GetPointData(), "Pinned"),
          [i % 5 == 0 for i in range(len(expected["mass"]))])
    equal("polygons", vtk_to_numpy(data.GetPolys().GetConnectivityArray()), expected["faces"])
    equal("offsets of polygons", vtk_to_numpy(data.GetPolys().GetOffsetsArray()),
          np.arange(0, len(expected["faces"]) + 1, 3))
    equal("lines", vtk_to_numpy(data.GetLines().GetConnectivityArray()), expected["ij"])
    equal("offsets of lines", vtk_to_numpy(data.GetLines().GetOffsetsArray()),
          np.arange(0, len(expected["ij"]) + 1, 2))


def check_cells(data, i):
    """The values that sample_recording.h gives springs, faces and pins in frame i"""
    cells = np.arange(data.GetNumberOfLines() + data.GetNumberOfPolys())
    equal("Strain", array(data.GetCellData(), "Strain"), np.float32(0.25 * cells + i))
    equal("Tension", array(data.GetCellData(), "Tension"), np.float32(np.sin(cells + i)))
    components = np.arange(3 * data.GetNumberOfPoints())
    equal("Reaction", array(data.GetPointData(), "Reaction"),
          np.float32(np.where(components // 3 % 5 == 0, 0.5 * components - i, 0)).reshape(-1, 3))


def check_energy(data, name, value):
    """A field has one value per frame; some versions return those of all frames."""
    found = array(data.GetFieldData(), name)
    if len(found) != 1:
        sys.exit(f"{name} has {len(found)} values in one frame")
    equal(name, found, [value])


def count_points(path):
    """Number of points in each frame."""
    reader, steps = open_file(str(path))
    for t in steps:
        reader.UpdateTimeStep(t)
        data = piece(reader)
        yield 0 if data is None else data.GetNumberOfPoints()


def check_states(program):
    """In FOLDER/I_FRAMES.vtkhdf the first FRAMES frames have points, the later ones have none."""
    with tempfile.TemporaryDirectory() as folder:
        made = subprocess.run([program, "states", folder], check=False).returncode
        if made:
            sys.exit(made)
        files = sorted(Path(folder).glob("*.vtkhdf"))
        for path in files:
            points = list(count_points(path))
            whole = int(path.stem.split("_")[1])
            if points != whole * points[:1] + (len(points) - whole) * [0] or whole and not points[0]:
                sys.exit(f"{path.name}: points of the frames: {points}")
        print(f"VTK {vtkVersion.GetVTKVersion()}: {len(files)} states are readable")


def main(base):
    with open(base + ".json") as file:
        expected = json.load(file)
    times, x, v = read_csv(base + ".csv", len(expected["mass"]))
    reader, steps = open_file(base + ".vtkhdf")
    written = expected["frames"]
    equal("times", np.array(steps), expected["times"])
    equal("times of the frames", np.array(steps[:written]), times)
    for i, t in enumerate(steps):
        reader.UpdateTimeStep(t)
        data = piece(reader)
        if i >= written:
            if data is not None and data.GetNumberOfPoints() > 0:
                sys.exit(f"frame {i} was not written but is not empty")
            continue
        equal(f"x of frame {i}", vtk_to_numpy(data.GetPoints().GetData()), x[i])
        equal(f"v of frame {i}", array(data.GetPointData(), "Velocity"), v[i])
        check_mesh(data, expected)
        check_cells(data, i)
        check_energy(data, "ElasticEnergy", 0.5 * i)
        check_energy(data, "GravitationalEnergy", expected["potential"][i] - 0.5 * i)
        check_energy(data, "KineticEnergy", expected["kinetic"][i])
        check_energy(data, "PotentialEnergy", expected["potential"][i])
    print(f"VTK {vtkVersion.GetVTKVersion()}: {written} frames of {len(steps)} are equal")



if sys.argv[1] == "states":
    check_states(sys.argv[2])
else:
    main(sys.argv[1])
