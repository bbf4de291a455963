"""Tests of the Debian packages that tools/deb made, in a bare Debian 12 below build: they install with
what they depend on, run, serve a program's author, and leave nothing when they are removed.

Needs root, for chroot, and mmdebstrap; tools/full.sh runs it."""
import os
import re
import shutil
import subprocess
import unittest
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent.parent
ROOT = TOP / "build" / "debian-root"
PACKAGES = sorted((TOP / "build" / "packages").glob("*.deb"))
NAMES = ["libmsim-dev", "libmsim0", "libmsim0-assimp", "libmsim0-cholmod", "libmsim0-hdf5",
         "libmsim0-klu", "libmsim0-mpi", "libmsim0-petsc", "libmsim0-sundials", "msim"]
PLUGINS = {"cholmod": "--solver cholmod --out a.csv", "hdf5": "--solver pcg --out a.vtkhdf",
           "klu": "--solver klu --out a.csv", "mpi": "--solver pcg --out a.csv",
           "petsc": "--solver petsc --out a.csv", "sundials": "--solver sundials-pcg --out a.csv"}
BESIDES = {"mpi": ["openmpi-bin"]}  # recommended by the plugin's package
RUN = ("cd /tmp; rm -f a.*; {start} msim_cli run /usr/share/msim/scenes/hanging_cloth.json --t_end 0.2"
       " --integrator linearly-implicit-euler --h 0.01 --quiet {options}; test -s a.*")
MPIRUN = "mpirun --allow-run-as-root --oversubscribe -n 2"
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
        (ROOT / "tmp/packages").mkdir()
        for package in PACKAGES:
            shutil.copy(package, ROOT / "tmp/packages")
        shutil.copy(TOP / "tests/install/pendulum.c", ROOT / "tmp")
        for file in "/etc/resolv.conf", "/etc/hosts":
            if Path(file).is_file():
                shutil.copy(file, ROOT / "etc")
        inside("apt-get update")
        cls.before = files()
        inside("apt-get install -y --no-install-recommends /tmp/packages/*.deb")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(ROOT, ignore_errors=True)

    def test_1_all_are_there(self):
        self.assertEqual(sorted(package.name.split("_")[0] for package in PACKAGES), NAMES)

    def test_2_programs_run(self):
        self.assertEqual(self.available(), set(PLUGINS))
        inside(RUN.format(start="", options="--solver cholmod --out a.vtkhdf"))
        inside("test -s /usr/share/man/man1/msim_cli.1; test -s /usr/share/msim/scene.schema.json")

    def test_3_a_program_is_built(self):
        out = inside("cd /tmp; cc pendulum.c $(pkg-config --cflags --libs msim) -o pendulum;"
                     " ./pendulum")
        self.assertIn("t = 2 s", out)

    def test_4_nothing_is_left(self):
        self.purge(*NAMES)

    def test_5_each_plugin_alone(self):
        for plugin, options in PLUGINS.items():
            with self.subTest(plugin):
                names, besides = ["libmsim0", "msim", f"libmsim0-{plugin}"], BESIDES.get(plugin, [])
                inside("cd /tmp/packages; apt-get install -y --no-install-recommends "
                       + " ".join([f"./{name}_*.deb" for name in names] + besides))
                self.assertEqual(self.available(), {plugin})
                inside(RUN.format(start=MPIRUN if plugin == "mpi" else "", options=options))
                self.purge(*names, *besides)

    def available(self):
        """The plugins that msim_cli lists as available."""
        listed = inside("msim_cli list")
        return {plugin for plugin in PLUGINS if re.search(rf"(?m)^  {plugin}(-pcg)? +yes ", listed)}

    def purge(self, *names):
        inside("apt-get purge -y --autoremove " + " ".join(names))
        self.assertEqual([name for name in files() - self.before if "msim" in name], [])
        self.assertEqual(inside("dpkg -l | grep -c msim || true").strip(), "0")


if __name__ == "__main__":
    unittest.main(verbosity=2)
