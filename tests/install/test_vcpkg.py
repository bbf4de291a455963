"""Tests of packaging/vcpkg without vcpkg: the portfile is run with stand-ins for vcpkg's functions
(vcpkg_stand_in.cmake), and the packages are used as the file `usage` says. Libraries are those of the
system. tools/full.sh (recipes) runs it."""
import json
import os
import re
import shutil
import subprocess
import unittest
from pathlib import Path

import support

HERE = Path(__file__).resolve().parent
PORT = support.SOURCE / "packaging/vcpkg/msim"
WORK = support.SOURCE / "build/recipes/vcpkg"
MANIFEST = json.loads((PORT / "vcpkg.json").read_text())
PLUGINS = {"assimp", "cholmod", "hdf5", "klu", "mpi", "sundials"}


def build_port(linkage, *features):
    """The package, by the portfile."""
    work = WORK / "-".join((linkage, *features))
    shutil.rmtree(work, ignore_errors=True)
    support.run("cmake", f"-DCURRENT_PORT_DIR={PORT}", f"-DWORK={work}",
                f"-DVCPKG_LIBRARY_LINKAGE={linkage}", f"-DFEATURES={';'.join(('core', *features))}",
                "-P", HERE / "vcpkg_stand_in.cmake")
    return work / "package"


def available(package):
    """The plugins that msim_cli lists as available."""
    listed = subprocess.run([package / "tools/msim/msim_cli", "list"], check=True, text=True,
                            stdout=subprocess.PIPE, env={
                                **os.environ, "LD_LIBRARY_PATH": str(package / "lib")}).stdout
    return {name for name in PLUGINS if re.search(rf"(?m)^  {name}(-pcg)? +yes ", listed)}


class Port(unittest.TestCase):
    def check_package(self, package):
        """What vcpkg requires of every package."""
        for file in "copyright", "usage", "msim-config.cmake", "msim-targets-debug.cmake":
            self.assertTrue((package / "share/msim" / file).is_file(), file)
        self.assertTrue((package / "include/msim/msim.h").is_file())
        for absent in ("debug/include", "debug/share", "lib/cmake", "debug/lib/cmake", "bin",
                       "debug/bin", "share/doc", "libexec"):
            self.assertFalse((package / absent).exists(), absent)
        for folder in package.rglob("*"):
            self.assertFalse(folder.is_dir() and not any(folder.iterdir()), f"{folder} is empty")
        for file in package.rglob("*"):
            if file.suffix in (".cmake", ".pc", ".h", ".json"):
                self.assertNotIn(str(package), file.read_text(), file)

    def use(self, package, *solvers):
        """Builds a program by the lines of `usage`, for both build types; runs it with the solvers."""
        lines = re.findall(r"(?m)^  (\w+\(.*\))$", (package / "share/msim/usage").read_text())
        source = package.parent / "consumer"
        source.mkdir()
        shutil.copy(HERE / "pendulum.c", source)
        (source / "CMakeLists.txt").write_text("\n".join((
            "cmake_minimum_required(VERSION 3.21)", "project(main LANGUAGES C)", lines[0],
            "add_executable(main pendulum.c)", *lines[1:])))
        for kind in "Debug", "Release":
            build = source / kind
            support.run("cmake", "-S", source, "-B", build, f"-DCMAKE_BUILD_TYPE={kind}",
                        f"-DCMAKE_PREFIX_PATH={package}")
            support.run("cmake", "--build", build, "--verbose")
            for solver in ("auto", *solvers):
                self.assertIn("t = 2 s", support.run(build / "main", "linearly-implicit-euler", solver))
            link = (build / "build.ninja" if (build / "build.ninja").exists() else
                    build / "CMakeFiles/main.dir/link.txt").read_text()
            self.assertEqual(f"{package}/debug/lib/libmsim" in link, kind == "Debug")

    def test_manifest(self):
        text = (support.SOURCE / "CMakeLists.txt").read_text()
        self.assertEqual(MANIFEST["version"], re.search(r"project\(msim VERSION (\S+)", text)[1])
        self.assertEqual(MANIFEST["name"], PORT.name)
        self.assertEqual(set(MANIFEST["features"]), PLUGINS | {"tools"})
        python = (support.SOURCE / "tools/python/cholmod/pyproject.toml").read_text()
        self.assertIn(f'license = "{MANIFEST["features"]["cholmod"]["license"]}"', python)
        self.assertNotIn("cholmod", MANIFEST["default-features"])

    def test_static(self):
        package = build_port("static", "hdf5", "klu", "sundials")
        self.check_package(package)
        self.assertFalse(list(package.rglob("*.so*")))
        self.assertFalse((package / "tools").exists())
        linked = (package / "lib/pkgconfig/msim.pc").read_text()
        for plugin in PLUGINS:
            self.assertEqual(plugin in linked, plugin in ("hdf5", "klu", "sundials"), plugin)
        self.use(package, "klu", "sundials-pcg")

    def test_dynamic(self):
        package = build_port("dynamic", "cholmod", "mpi", "tools")
        self.check_package(package)
        self.assertFalse(list(package.rglob("*.a")))
        self.assertEqual(available(package), {"cholmod", "mpi"})
        self.use(package, "cholmod")


if __name__ == "__main__":
    support.main()
