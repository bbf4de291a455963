"""Tests of the Debian packages that tools/deb made, in a bare Debian 12 below build: they install with
what they depend on, run, serve a program's author, and leave nothing when they are removed.

Needs root, for chroot, and mmdebstrap; tools/full.sh runs it."""
import os
import shutil
import subprocess
import unittest
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent.parent
ROOT = TOP / "build" / "debian-root"
PACKAGES = sorted((TOP / "build" / "packages").glob("*.deb"))
NAMES = ["libmsim-dev", "libmsim0", "libmsim0-cholmod", "libmsim0-hdf5", "libmsim0-klu",
         "libmsim0-sundials", "msim"]
QUIET = {**os.environ, "DEBIAN_FRONTEND": "noninteractive", "LC_ALL": "C.UTF-8"}


def run(*command):
    done = subprocess.run(command, env=QUIET, text=True, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    if done.returncode:
        raise AssertionError(f"{command}\nexit status {done.returncode}\n{done.stdout[-3000:]}")
    return done.stdout


def inside(script):
    return run("chroot", ROOT, "bash", "-e", "-c", script)


def files():
    """All files but those that apt, dpkg and ldconfig keep for themselves."""
    own = ("var/lib/apt", "var/lib/dpkg", "var/cache", "var/log", "etc/ld.so.cache", "tmp", "proc")
    return {str(path.relative_to(ROOT)) for path in ROOT.rglob("*")
            if not str(path.relative_to(ROOT)).startswith(own)}


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(ROOT, ignore_errors=True)
        run("mmdebstrap", "--mode=root", "--variant=apt", "--include=gcc,libc6-dev,pkg-config",
            "bookworm", ROOT)
        cls.before = files()
        (ROOT / "tmp/packages").mkdir()
        for package in PACKAGES:
            shutil.copy(package, ROOT / "tmp/packages")
        shutil.copy(TOP / "tests/install/pendulum.c", ROOT / "tmp")
        for file in "/etc/resolv.conf", "/etc/hosts":
            if Path(file).is_file():
                shutil.copy(file, ROOT / "etc")
        inside("apt-get update; apt-get install -y --no-install-recommends /tmp/packages/*.deb")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(ROOT, ignore_errors=True)

    def test_1_all_are_there(self):
        self.assertEqual(sorted(package.name.split("_")[0] for package in PACKAGES), NAMES)

    def test_2_programs_run(self):
        listed = inside("msim_cli list")
        for word in "cholmod", "klu", "sundials-pcg", "hdf5":
            line = next(line for line in listed.splitlines() if line.split()[:1] == [word])
            self.assertNotIn("missing", line)
        inside("cd /tmp; msim_cli run /usr/share/msim/scenes/hanging_cloth.json --t_end 0.2"
               " --integrator linearly-implicit-euler --h 0.01 --solver cholmod --out a.vtkhdf;"
               " test -s a.vtkhdf")

    def test_3_a_program_is_built(self):
        out = inside("cd /tmp; cc pendulum.c $(pkg-config --cflags --libs msim) -o pendulum;"
                     " ./pendulum")
        self.assertIn("t = 2 s", out)

    def test_4_nothing_is_left(self):
        inside("apt-get purge -y --autoremove " + " ".join(NAMES))
        self.assertEqual([name for name in files() - self.before if "msim" in name], [])
        self.assertEqual(inside("dpkg -l | grep -c msim || true").strip(), "0")


if __name__ == "__main__":
    unittest.main(verbosity=2)
