"""Tests of msim_cli run --resume: runs that are killed at any moment, and resumed.

MSIM_KILLS: number of kills, by default 20."""
import os
import random
import re
import resource
import signal
import subprocess
import time
from pathlib import Path

import support
from cli_support import CliTest, pendulum

KILLS = int(os.environ.get("MSIM_KILLS", "20"))

CLOTH = {
    "msim": 1,
    "name": "a cloth",
    "gravity": [0, 0, -9.81],
    "objects": [{"type": "cloth", "n": [6, 6], "origin": [0, 0, 1], "row": [0, 1, 0],
                 "column": [1, 0, 0], "mass": 0.3, "k": 1000, "damping": 0.01,
                 "pinned": ["first_corners"]}],
    "planes": [{"normal": [0, 0, 1], "offset": 0.3, "restitution": 0.5}],
}
RUNS = ["--integrator linearly-implicit-euler --h 4e-3 --t_end 1.6 --every 1",
        "--integrator verlet --h 1e-4 --t_end 1 --fps 400",
        "--integrator bdf2 --h 1e-2 --t_end 2 --every 1",
        "--integrator dop853 --t_end 0.5 --fps 400",
        "--integrator auto --tol 1e-5 --t_end 1 --fps 100",
        "--integrator velocity-verlet --h 1e-4 --t_end 1 --fps 400 --sync on"]


class Resume(CliTest):
    def setUp(self):
        super().setUp()
        support.require(re.search(r"(?m)^  hdf5 +yes ", self.good("list")), "the recorder hdf5")
        self.write("scene.json", CLOTH)

    def command(self, options, file, *more):
        return ["run", "scene.json", *options.split(), "--out", file, "--quiet", *more]

    def read(self, file):
        return (self.folder / file).read_bytes()

    def interrupted(self, options, file, number):
        """A run that a signal ends as soon as its file exists; returns its exit status."""
        for _ in range(20):
            (self.folder / file).unlink(missing_ok=True)
            with self.start(*self.command(options, file)) as process:
                self.wait_for(file)
                process.send_signal(number)
                process.communicate(timeout=60)
            if process.returncode != 0:  # otherwise the run had ended before
                return process.returncode
        self.fail("no run was slow enough to be interrupted")

    def refuse(self, options, file, *words):
        before = self.read(file)
        status, _, err = self.cli(*self.command(options, file, "--resume"))
        self.assertEqual(status, 1)
        self.assert_sentence(err, *words)
        self.assertEqual(self.read(file), before)


class Kills(Resume):
    def good_frames(self, file):
        """Number of frames as another program reads them, checked by hash; -1 without a file."""
        if not (self.folder / file).exists():
            return -1
        program = Path(support.setting("BUILD")) / "bin/test_hdf5"
        frames, _, planned = support.run(program, "verify", self.folder / file).split()
        self.assertLessEqual(int(frames), int(planned))
        return int(frames)

    def kill_once(self, command, delay):
        """False if the run ended before the signal."""
        with self.start(*command) as process:
            try:
                process.wait(delay)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
            _, err = process.communicate()
        self.assertIn(process.returncode, (0, -signal.SIGKILL), err)
        return process.returncode != 0

    def end_of(self, options, kills, chance):
        """Kill and resume a run until it ends; returns the number of kills. No frame is lost."""
        begun = time.monotonic()
        tables = [[f"--{kind}", f"{name}_{kind}.csv"] for name in ("whole", "out")
                  for kind in ("energies", "reactions", "springs")]
        self.good(*self.command(options, "whole.vtkhdf", *sum(tables[:3], [])))
        length = time.monotonic() - begun
        (self.folder / "out.vtkhdf").unlink(missing_ok=True)
        command = self.command(options, "out.vtkhdf", "--resume", *sum(tables[3:], []))
        killed, frames = 0, -1
        while killed < kills and self.kill_once(command, chance.uniform(0, 0.8 * length)):
            killed += 1
            now = self.good_frames("out.vtkhdf")
            self.assertGreaterEqual(now, frames, "frames were lost")
            self.found.append(now)
            frames = now
        self.good(*command)
        self.assertEqual(self.read("out.vtkhdf"), self.read("whole.vtkhdf"))
        for whole, out in zip(tables[:3], tables[3:]):
            self.assertEqual(self.read(out[1]), self.read(whole[1]))
        return killed

    def test_kills(self):
        chance, killed, self.found = random.Random(1), 0, []
        while killed < KILLS:
            options = RUNS[len(self.found) % len(RUNS)]
            with self.subTest(options):
                killed += self.end_of(options, min(4, KILLS - killed), chance)
        print(f"{killed} kills, frames found (-1: no file):", *self.found)
        self.assertGreater(max(self.found), 0, "no run got far enough to be of any interest")


class Ends(Resume):
    OPTIONS = "--integrator verlet --h 1e-3 --every 10 --t_end "

    def test_a_whole_run(self):
        self.good(*self.command(self.OPTIONS + "0.5", "out.vtkhdf"))
        before = self.read("out.vtkhdf")
        self.good(*self.command(self.OPTIONS + "0.5", "out.vtkhdf", "--resume"))
        self.assertEqual(self.read("out.vtkhdf"), before)

    def test_stopped_between_frames(self):
        options = "--integrator verlet --h 1e-5 --every 200 --t_end 1"
        self.assertEqual(self.interrupted(options, "out.vtkhdf", signal.SIGINT), 2)
        self.good(*self.command(options, "out.vtkhdf", "--resume"))
        self.good(*self.command(options, "whole.vtkhdf"))
        self.assertEqual(self.read("out.vtkhdf"), self.read("whole.vtkhdf"))

    def test_another_end(self):
        """A resumed run keeps to the plan of the file, which was made for the later end."""
        options = "--integrator verlet --h 1e-5 --every 200 --t_end "
        self.interrupted(options + "1", "out.vtkhdf", signal.SIGINT)  # with at least one frame
        for t_end in "0.8", "1":
            self.good(*self.command(options + t_end, "out.vtkhdf", "--resume"))
        self.good(*self.command(options + "1", "whole.vtkhdf"))
        self.assertEqual(self.read("out.vtkhdf"), self.read("whole.vtkhdf"))
        self.refuse(options + "1.1", "out.vtkhdf", "created for 501 frames", "551")
        self.refuse(options + "0.8", "out.vtkhdf", "it already contains 501 frames", "401")

    def test_what_differs_is_named(self):
        self.good(*self.command(self.OPTIONS + "0.5", "out.vtkhdf"))
        self.refuse("--integrator heun --h 1e-3 --every 10 --t_end 0.5", "out.vtkhdf", "integrator")
        self.refuse("--integrator verlet --h 5e-4 --every 20 --t_end 0.5", "out.vtkhdf", "h is")
        self.refuse("--integrator verlet --h 1e-3 --every 5 --t_end 0.5", "out.vtkhdf", "frames")
        self.write("scene.json", {**CLOTH, "gravity": [0, 0, -9.8]})
        self.refuse(self.OPTIONS + "0.5", "out.vtkhdf", "gravity")

    def test_beginning(self):
        """The same command starts a run and resumes it."""
        args = self.command(self.OPTIONS + "0.1", "out.vtkhdf", "--resume")[:-2] + ["--resume"]
        _, _, err = self.cli(*args)
        self.assert_sentence(err, "note: the file of --out does not exist: the run starts")
        self.good(*self.command(self.OPTIONS + "0.1", "whole.vtkhdf"))
        self.assertEqual(self.read("out.vtkhdf"), self.read("whole.vtkhdf"))

    def test_formats_without_checkpoints(self):
        """They are refused before the first run, not only when it has to be resumed."""
        for name in "out.csv", "out.html", "out.pvd":
            self.assert_refused(["run", "scene.json", *(self.OPTIONS + "0.1").split(), "--out", name,
                                 "--resume"], name, "has no checkpoints; use a .vtkhdf file")

    def test_what_is_not_ours(self):
        self.write("scene.json", pendulum(integrator="verlet", steps=3))
        for name in "out.vtkhdf", "out.csv":
            self.write(name, "a diary\n")
            self.assert_refused(["run", "scene.json", "--out", name], name, "--force")
            self.assertEqual(self.read(name), b"a diary\n")
            self.assert_refused(["run", "scene.json", "--out", name, "--resume"], name)
            self.good("run", "scene.json", "--out", name, "--force", "--quiet")
            self.good("run", "scene.json", "--out", name, "--quiet")  # a trajectory may be replaced


class Limits(Resume):
    OPTIONS = "--integrator verlet --h 1e-5 --every 200 --t_end 1"

    def test_two_writers(self):
        with self.start(*self.command(self.OPTIONS, "out.vtkhdf")) as process:
            self.wait_for("out.vtkhdf")
            process.send_signal(signal.SIGSTOP)
            for more in [], ["--resume"], ["--force"]:
                status, _, err = self.cli(*self.command(self.OPTIONS, "out.vtkhdf", *more))
                self.assertEqual(status, 1)
                self.assert_sentence(err, "out.vtkhdf", "is in use by another recorder")
            process.kill()
        self.good(*self.command(self.OPTIONS, "out.vtkhdf", "--resume"))  # the lock is released

    def test_no_room(self):
        """A message before the run, without a signal and without a crash at exit."""
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (200000, 200000))
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        status, _, err = self.cli(*self.command(self.OPTIONS, "out.vtkhdf"), preexec_fn=limit)
        self.assertEqual(status, 1)
        self.assert_sentence(err, "out.vtkhdf", "disk space", "File too large")
        self.assertEqual(self.files(), ["scene.json"])

    def test_small_disk(self):
        disk = self.folder / "disk"
        disk.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
        if subprocess.run(mount, stderr=subprocess.DEVNULL).returncode != 0:
            self.skipTest("no file system may be mounted here")
        try:
            status, _, err = self.cli(*self.command(self.OPTIONS, "disk/out.vtkhdf"))
            self.assertEqual(status, 1)
            self.assert_sentence(err, "disk/out.vtkhdf", "No space left")
            self.assertEqual(list(disk.iterdir()), [])
        finally:
            support.run("umount", disk)

    def test_sync(self):
        self.good(*self.command(self.OPTIONS + " --steps 400 --every 20 --sync on", "out.vtkhdf"))
        self.good(*self.command(self.OPTIONS + " --steps 400 --every 20", "whole.vtkhdf"))
        self.assertEqual(self.read("out.vtkhdf"), self.read("whole.vtkhdf"))
        self.good(*self.command(self.OPTIONS + " --steps 400 --every 20 --sync on", "out.csv"))


if __name__ == "__main__":
    support.main()
