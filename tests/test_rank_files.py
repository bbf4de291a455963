"""Tests of .vtkhdf files under mpirun: they have the bits of one process, ranks may be killed at any
moment, and other numbers of ranks resume the run.

MSIM_KILLS: number of kills, by default 2."""
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import support
from cli_support import CLI, CliTest

try:
    import h5py
    import numpy
except ImportError:
    h5py = numpy = None
try:
    from vtkmodules.vtkIOHDF import vtkHDFReader
except ImportError:
    vtkHDFReader = None

KILLS = int(os.environ.get("MSIM_KILLS", "2"))

CLOTH = {
    "msim": 1,
    "gravity": [0, 0, -9.81],
    "objects": [{"type": "cloth", "n": [24, 20], "origin": [0, 0, 0], "row": [0, 1, 0],
                 "column": [1, 0, 0], "mass": 0.3, "k": {"structural": 100, "shear": 50},
                 "damping": 0.001, "pinned": ["first_corners"]}],
    "planes": [{"normal": [0, 0, 1], "offset": -0.3, "restitution": 0.5, "friction": 0.2}],
}
PARTICLES = 480
EXPLICIT = "--integrator velocity-verlet --h 5e-4 --steps 600 --every 30"
IMPLICIT = "--integrator linearly-implicit-euler --h 1e-3 --steps 400 --every 20"


class RankFiles(CliTest):
    PROGRAM = "mpirun"

    def setUp(self):
        super().setUp()
        listed = subprocess.run([CLI, "list"], capture_output=True, text=True, check=True).stdout
        support.require(re.search(r"(?m)^  hdf5 +yes ", listed), "the recorder hdf5")
        self.write("scene.json", CLOTH)

    scene_file = "scene.json"

    def command(self, n, options, file, *more):
        """Arguments of mpirun; n = 1: one process, which opens no MPI."""
        return ["-n", str(n), CLI, "run", self.scene_file, *options.split(), "--out", file,
                "--quiet", *more]

    def record(self, n, options, file, *more):
        with self.start(*self.command(n, options, file, *more)) as process:
            _, err = process.communicate(timeout=300)  # long where other programs share the cores
        self.assertEqual(process.returncode, 0, err)

    def read(self, file):
        return (self.folder / file).read_bytes()

    def contents(self, file):
        """All datasets but the checkpoints, which count and bound what each rank does."""
        support.require(h5py, "h5py of PyPI")
        found = {}

        def add(name, item):
            found.update({f"{name}@{key}": numpy.asarray(value).tobytes()
                          for key, value in item.attrs.items()})
            if isinstance(item, h5py.Dataset) and not name.startswith("msim/checkpoint"):
                found[name] = item[()].tobytes()

        with h5py.File(self.folder / file, "r") as opened:
            opened.visititems(add)
        return found

    def assert_same_frames(self, one, other):
        a, b = self.contents(one), self.contents(other)
        self.assertEqual([name for name in a if a[name] != b.get(name)], [])
        self.assertEqual(a.keys(), b.keys())

    def ranks_of(self, process):
        """The processes that mpirun has started"""
        with open(f"/proc/{process.pid}/task/{process.pid}/children", encoding="ascii") as file:
            return [int(word) for word in file.read().split()]

    def is_running(self, rank):
        try:
            stat = Path(f"/proc/{rank}/stat").read_text(encoding="ascii")
        except (FileNotFoundError, ProcessLookupError):
            return False
        return stat.rpartition(")")[2].split()[0] != "Z"

    def wait_for_mpirun(self, process, ranks):
        """Returns what it has printed on stderr. Open MPI 4.1.4 itself deadlocks in
        PMIx_server_finalize() one time in some hundred, when all ranks have ended: it is killed
        then."""
        try:
            return process.communicate(timeout=60)[1]
        except subprocess.TimeoutExpired:
            if any(map(self.is_running, ranks)):
                raise
            print("mpirun did not end, but all ranks had")
            process.kill()
            return process.communicate()[1]

    def kill_a_rank(self, command, delay, chance, file=None):
        """After a delay, from where the file exists on; False if the run had ended before. mpirun
        ends within 5 s."""
        with self.start(*command) as process:
            if file:
                self.wait_for(file)
            try:
                process.wait(delay)
            except subprocess.TimeoutExpired:
                pass
            ranks = self.ranks_of(process) if process.poll() is None else []
            killed = time.monotonic()
            if ranks:
                os.kill(chance.choice(ranks), signal.SIGKILL)
            err = self.wait_for_mpirun(process, ranks)
        if ranks and process.returncode not in (0, -signal.SIGKILL):
            self.assertLess(time.monotonic() - killed, 5)
        elif not ranks:
            self.assertEqual(process.returncode, 0, err)
        return process.returncode != 0

    def check_file(self, file):
        """Number of frames by h5py, which VTK and the hashes confirm; -1 without a file"""
        path = self.folder / file
        if not path.exists():
            return -1
        program = Path(support.setting("BUILD")) / "bin/test_hdf5"
        verified = int(support.run(program, "verify", path).split()[0])
        with h5py.File(path, "r") as opened:
            count = int(opened["msim/frames/NCommitted"][0])
        self.assertIn(verified - count, (0, 1))
        if vtkHDFReader and verified > 0:
            reader = vtkHDFReader()
            reader.SetFileName(str(path))
            self.assertEqual(reader.CanReadFile(str(path)), 1)
            reader.UpdateInformation()
            reader.SetStep(verified - 1)
            reader.Update()
            data = reader.GetOutputDataObject(0)
            self.assertEqual(data.GetNumberOfElements(0), PARTICLES)
        return verified


class Files(RankFiles):
    def test_bits_of_one_process(self):
        options = "--integrator velocity-verlet --h 5e-4 --steps 300 --every 100"
        for n in 1, 2, 3:
            self.record(n, options, f"{n}.vtkhdf")
        self.assert_same_frames("1.vtkhdf", "2.vtkhdf")
        self.assert_same_frames("2.vtkhdf", "3.vtkhdf")

    def test_resume_begins_where_there_is_no_file(self):
        self.record(2, EXPLICIT + " --steps 200", "out.vtkhdf", "--resume")
        self.record(3, EXPLICIT + " --steps 200", "out.vtkhdf", "--resume")
        self.record(2, EXPLICIT + " --steps 200", "whole.vtkhdf")
        self.assertEqual(self.read("out.vtkhdf"), self.read("whole.vtkhdf"))

    def test_what_differs_is_named(self):
        self.record(2, EXPLICIT + " --steps 200", "out.vtkhdf")
        before = self.read("out.vtkhdf")
        for options, word in ((EXPLICIT + " --steps 200 --skip.planes off", "skip.planes"),
                              (EXPLICIT + " --steps 900", "created for 8 frames")):
            status, _, err = self.cli(*self.command(2, options, "out.vtkhdf", "--resume"))
            self.assertEqual(status, 1)
            self.assertEqual(err.count("msim_cli: "), 1, err)
            self.assertIn(word, err)
            self.assertEqual(self.read("out.vtkhdf"), before)


class Parts(RankFiles):
    """Scenes of which each rank reads a part"""
    scene_file = "scene.h5"

    def setUp(self):
        super().setUp()
        support.require(h5py, "h5py of PyPI")
        chance = numpy.random.default_rng(1)
        side = 15
        at = numpy.arange(side * side).reshape(side, side)
        pairs = [(at[:, 1:], at[:, :-1]), (at[1:], at[:-1]), (at[1:, 1:], at[:-1, :-1])]
        self.ij = numpy.concatenate([numpy.stack([a.ravel(), b.ravel()], 1) for a, b in pairs])
        with h5py.File(self.folder / "scene.h5", "w") as file:
            file["msim"] = 1
            file["gravity"] = [0, 0, -9.81]
            file["particles/x"] = numpy.stack([at.ravel() % side, at.ravel() // side,
                                               chance.random(side * side)], 1) / side
            file["particles/mass"] = 1e-3 * (1 + chance.random(side * side))
            file["particles/pinned"] = [0, side - 1]
            file["springs/ij"] = self.ij
            file["springs/k"] = 50 + chance.random(len(self.ij))
            file["springs/rest"] = 0.08 * (1 + chance.random(len(self.ij)))
            file["springs/damping"] = 1e-4
            file["faces"] = numpy.stack([at[1:, 1:].ravel(), at[:-1, 1:].ravel(),
                                         at[1:, :-1].ravel()], 1)

    def test_bits_of_one_process(self):
        options = "--integrator velocity-verlet --h 2e-4 --steps 200 --every 40"
        for n in 1, 2, 3:
            self.record(n, options, f"{n}.vtkhdf")
        self.assert_same_frames("1.vtkhdf", "2.vtkhdf")
        self.assert_same_frames("2.vtkhdf", "3.vtkhdf")
        before = self.read("2.vtkhdf")
        self.record(3, options, "2.vtkhdf", "--resume")
        self.assertEqual(self.read("2.vtkhdf"), before)

    def test_resume_under_another_number_of_ranks(self):
        """The last frame is lost, and computed again."""
        options = "--integrator velocity-verlet --h 2e-4 --steps 100 --every 20"
        self.record(1, options, "whole.vtkhdf")
        for n, m in (1, 2), (2, 3), (3, 1):
            self.record(n, options, "out.vtkhdf", "--force")
            with h5py.File(self.folder / "out.vtkhdf", "a") as file:
                file["msim/frames/NCommitted"][0] -= 1
                file["VTKHDF/Points"][-1] = 0
            self.record(m, options, "out.vtkhdf", "--resume")
            self.assert_same_frames("whole.vtkhdf", "out.vtkhdf")

    def test_springs_without_rest(self):
        """Their lengths are between particles of both ranks; one that is not finite is named."""
        options = "--integrator velocity-verlet --h 2e-4 --steps 50 --every 10"
        with h5py.File(self.folder / "scene.h5", "a") as file:
            del file["springs/rest"]
        for n in 1, 3:
            self.record(n, options, f"{n}.vtkhdf")
        self.assert_same_frames("1.vtkhdf", "3.vtkhdf")
        with h5py.File(self.folder / "scene.h5", "a") as file:
            file["particles/x"][len(file["particles/x"]) - 1] = [1e300, 0, 0]
        first = int(numpy.argmax((self.ij == self.ij.max()).any(axis=1)))
        status, out, err = self.cli(*self.command(2, options, "out.vtkhdf"))
        self.assertEqual((status, out, err.count("msim_cli: ")), (1, "", 1), err)
        self.assertIn(f"the length of springs.ij[{first}] is beyond the range", err)

    def test_an_array_that_is_too_long(self):
        with h5py.File(self.folder / "scene.h5", "a") as file:
            n = len(file["particles/x"])
            del file["particles/mass"]
            file["particles/mass"] = numpy.ones(n + 1)
        status, out, err = self.cli(*self.command(2, EXPLICIT, "out.vtkhdf"))
        self.assertEqual((status, out, err.count("msim_cli: ")), (1, "", 1), err)
        self.assertRegex(err, rf"scene\.h5: particles\.mass .*an array of {n}")

    def test_a_fault_in_one_part(self):
        """The rank that has it is named, and the row in the file."""
        last = len(self.ij) - 1
        with h5py.File(self.folder / "scene.h5", "a") as file:
            file["springs/k"][last] = -1
        status, out, err = self.cli(*self.command(2, EXPLICIT, "out.vtkhdf"))
        self.assertEqual((status, out, err.count("msim_cli: ")), (1, "", 1), err)
        self.assertRegex(err, rf"msim_cli: rank 1 of 2 on host [^ ]+: scene\.h5: springs\.k\[{last}\] ")
        self.assertEqual(self.files(), ["scene.h5", "scene.json"])


class Kills(RankFiles):
    def end_of(self, options, kills, chance):
        """Kill one rank at a time, and go on under another number of them; returns the kills."""
        killed, frames, n = 0, -1, chance.choice((1, 2, 3))
        (self.folder / "out.vtkhdf").unlink(missing_ok=True)
        while killed < kills:
            n = chance.choice([k for k in (2, 3) if k != n])
            command = self.command(n, options, "out.vtkhdf", "--resume")
            # before the file exists, where MPI starts, and after that in turn
            file, delay = None, chance.uniform(0.1, self.length)
            if len(self.found) % 2:
                file, delay = "out.vtkhdf", delay / 4
            if not self.kill_a_rank(command, delay, chance, file):
                break
            killed += 1
            now = self.check_file("out.vtkhdf")
            self.assertGreaterEqual(now, frames, "frames were lost")
            self.found.append(now)
            frames = now
        self.record(chance.choice((1, 2, 3)), options, "out.vtkhdf", "--resume")
        return killed

    def kill_ranks(self, options):
        support.require(h5py, "h5py of PyPI")
        begun = time.monotonic()
        self.record(2, options, "whole.vtkhdf")
        self.length, self.found = time.monotonic() - begun, []
        chance, killed = random.Random(1), 0
        while killed < KILLS:
            killed += self.end_of(options, min(3, KILLS - killed), chance)
            yield
        print(f"{killed} kills, frames found (-1: no file):", *self.found)
        self.assertGreaterEqual(max(self.found), 0, "no run got far enough to be of any interest")

    def test_explicit_runs_end_as_without_kills(self):
        for _ in self.kill_ranks(EXPLICIT):
            self.assert_same_frames("out.vtkhdf", "whole.vtkhdf")

    def test_implicit_runs_end(self):
        """From the same file the same number of ranks writes the same bytes."""
        support.require(h5py, "h5py of PyPI")
        self.record(2, IMPLICIT, "whole.vtkhdf")
        with self.start(*self.command(2, IMPLICIT, "out.vtkhdf")) as process:
            self.wait_for("out.vtkhdf")
            os.kill(self.ranks_of(process)[1], signal.SIGKILL)
            process.communicate(timeout=30)
        frames = self.check_file("out.vtkhdf")
        shutil.copy(self.folder / "out.vtkhdf", self.folder / "again.vtkhdf")
        for file in "out.vtkhdf", "again.vtkhdf":
            self.record(3, IMPLICIT, file, "--resume")
            self.assertEqual(self.check_file(file), 21)
        self.assertEqual(self.read("out.vtkhdf"), self.read("again.vtkhdf"))
        self.assertLess(frames, 21, "the run had ended before it was killed")


if __name__ == "__main__":
    if shutil.which("mpirun") is None:
        sys.exit(77)
    support.main()
