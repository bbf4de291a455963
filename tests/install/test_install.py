"""Tests that a user's program and a third-party plugin build against an installed and then moved
msim, by CMake and by pkg-config."""
import json
import os
import re
import shlex
import shutil
import tempfile
import unittest
from pathlib import Path

import support

HERE = Path(__file__).resolve().parent
EXAMPLE = HERE.parent / "plugin_example"
RECORDER, IMPORTER = HERE.parent / "recorder_example", HERE.parent / "importer_example"


class Install(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="msim-install-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        cls.first, cls.prefix = cls.folder / "first", cls.folder / "moved"
        support.run(support.setting("CMAKE"), "--install", support.setting("BUILD"),
                    "--prefix", cls.first)
        cls.first.rename(cls.prefix)
        cls.library = next(cls.prefix.rglob("libmsim.*"))
        cls.sanitize = support.setting("SANITIZE") and [f"-fsanitize={support.setting('SANITIZE')}"]

    def try_pendulum(self, program):
        def x(*arguments):
            text = support.run(program, *arguments)
            self.assertRegex(text, r"^t = 2 s, x = \S+ \S+ \S+ m\n$")
            return [float(word) for word in text.split()[6:9]]

        explicit = x("velocity-verlet")
        self.assertEqual(x(), explicit)
        there = support.run(self.prefix / "bin/msim_cli", "list")
        for solver in ("auto", "cholmod", "klu", "sundials-pcg", "sundials-spgmr"):
            if not re.search(rf"(?m)^  {solver} +yes ", there):
                continue
            implicit = x("linearly-implicit-euler", solver)
            self.assertLess(max(abs(a - b) for a, b in zip(explicit, implicit)), 0.1)

    def cmake(self, source):
        """Builds a project against the installed msim; returns its build folder."""
        build = self.folder / source.name
        support.run(support.setting("CMAKE"), "-S", source, "-B", build,
                    "-DCMAKE_BUILD_TYPE=Release", f"-DCMAKE_PREFIX_PATH={self.prefix}",
                    f"-DCMAKE_C_COMPILER={support.setting('CC')}",
                    "-DCMAKE_C_FLAGS=-Wall -Wextra -Werror " + " ".join(self.sanitize))
        support.run(support.setting("CMAKE"), "--build", build)
        return build

    def pkg_config(self, *what):
        support.require(shutil.which("pkg-config"), "pkg-config")
        folder = self.library.parent / "pkgconfig"
        return shlex.split(support.run("pkg-config", *what, "msim",
                                       env=dict(os.environ, PKG_CONFIG_PATH=str(folder))))

    def test_uninstall(self):
        other, manifest = self.folder / "other", self.folder / "manifest.txt"
        shutil.copytree(self.prefix, other / "msim")
        (other / "mine").write_text("mine")
        manifest.write_text("".join(f"{path}\n" for path in other.rglob("*")
                                    if "msim/" in str(path) and not path.is_dir()))
        script = support.SOURCE / "tools/cmake/uninstall.cmake"
        support.run(support.setting("CMAKE"), "-D", f"MANIFEST={manifest}", "-P", script)
        left = [path for path in other.rglob("*") if not path.is_dir()]
        self.assertEqual(left, [other / "mine"])
        self.assertFalse(list(other.rglob("msim")))
        self.assertFalse(manifest.exists())

    def test_cmake(self):
        self.try_pendulum(self.cmake(HERE) / "pendulum")

    def test_documents(self):
        """The manual page, completions and the schema, as the installed program prints them."""
        if not (self.prefix / "bin/msim_cli").exists():
            self.skipTest("a build without programs")
        for file, command in (("man/man1/msim_cli.1", ("help", "man")),
                              ("msim/scene.schema.json", ("help", "scene", "--json")),
                              ("bash-completion/completions/msim_cli", ("completion", "bash")),
                              ("zsh/site-functions/_msim_cli", ("completion", "zsh"))):
            self.assertEqual((self.prefix / "share" / file).read_text(),
                             support.run(self.prefix / "bin/msim_cli", *command))

    def test_pkg_config(self):
        flags = self.pkg_config("--cflags", "--libs",
                                *([] if support.setting("SHARED") == "1" else ["--static"]))
        program = self.folder / "pendulum"
        support.run(support.setting("CC"), "-std=c99", *self.sanitize, HERE / "pendulum.c",
                    "-o", program, *flags, f"-Wl,-rpath,{self.library.parent}")
        self.try_pendulum(program)

    def test_cpp(self):
        """The program of README is also one of C++17."""
        support.require(shutil.which("c++"), "c++")
        flags = self.pkg_config("--cflags", "--libs",
                                *([] if support.setting("SHARED") == "1" else ["--static"]))
        program = self.folder / "pendulum_cpp"
        support.run("c++", "-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror",
                    *self.sanitize, "-x", "c++", HERE / "pendulum.c", "-x", "none", "-o", program,
                    *flags, f"-Wl,-rpath,{self.library.parent}")
        self.try_pendulum(program)

    def rope(self, solver, plugins):
        """The positions of the rope after 50 implicit steps."""
        final = self.folder / f"{solver}.json"
        support.run(self.prefix / "bin/msim_cli", "run",
                    self.prefix / "share/msim/scenes/rope.json", "--integrator",
                    "linearly-implicit-euler", "--h", "5e-3", "--steps", 50, "--solver", solver,
                    "--solver.rtol", "1e-12", "--final", final, "--quiet",
                    env=dict(os.environ, MSIM_PLUGIN_PATH=str(plugins)))
        return [c for x in json.loads(final.read_text())["x"] for c in x]

    def try_plugin(self, folder):
        ours, theirs = self.rope("pcg", folder), self.rope("dense-lapack", folder)
        self.assertEqual(len(theirs), 3 * 42)
        self.assertLess(max(abs(a - b) for a, b in zip(ours, theirs)), 1e-9)

    def need_lapack(self):
        try:
            support.run(support.setting("CC"), "-shared", "-x", "c", os.devnull, "-llapack",
                        "-o", self.folder / "probe.so")
        except AssertionError:
            support.require(False, "LAPACK")

    def record_net(self, *plugins):
        """The frames of a scene *.net as *.xyz, by the plugins of these folders."""
        scene, out = self.folder / "scene.net", self.folder / "motion.xyz"
        scene.write_text("particle 0 0 2 1\nparticle 0.5 0 2 0.2\npinned 0\n"
                         "spring 0 1 500 0.5\ngravity 0 0 -9.81\n")
        support.run(self.prefix / "bin/msim_cli", "run", scene, "--integrator", "velocity-verlet",
                    "--h", "1e-3", "--steps", 20, "--every", 10, "--out", out, "--quiet",
                    env=dict(os.environ, MSIM_PLUGIN_PATH=":".join(map(str, plugins))))
        return out.read_text()

    def try_formats(self, *plugins):
        lines = self.record_net(*plugins).splitlines()
        self.assertEqual(len(lines), 3 * 4)
        self.assertEqual(lines[:4], ["2", "msim step 0, t = 0 s", "P 0 0 2", "P 0.5 0 2"])
        self.assertLess(float(lines[11].split()[3]), 1.999)  # it has fallen

    def test_recorder_and_importer_by_cmake(self):
        recorder, importer = self.cmake(RECORDER), self.cmake(IMPORTER)
        self.try_formats(recorder, importer)
        with self.assertRaisesRegex(AssertionError, "scene.net is not a JSON scene; unknown importer "
                                    "'net': msim_importer_net.so was not found"):
            self.record_net(recorder)
        with self.assertRaisesRegex(AssertionError, "unknown recorder 'xyz': "
                                    "msim_recorder_xyz.so was not found"):
            self.record_net(importer)

    def test_recorder_and_importer_by_the_lines_in_the_headers(self):
        folder = self.folder / "formats"
        folder.mkdir()
        for source in (RECORDER / "xyz.c", IMPORTER / "net.c"):
            kind = source.parent.name.split("_")[0]
            support.run(support.setting("CC"), "-shared", "-fPIC", "-DMSIM_PLUGIN",
                        *self.pkg_config("--cflags"), source,
                        "-o", folder / f"msim_{kind}_{source.stem}.so")
        self.try_formats(folder)

    def test_plugin_by_cmake(self):
        self.need_lapack()
        self.try_plugin(self.cmake(EXAMPLE))

    def test_plugin_by_the_line_in_the_header(self):
        self.need_lapack()
        folder = self.folder / "by_hand"
        folder.mkdir()
        support.run(support.setting("CC"), "-shared", "-fPIC", "-DMSIM_PLUGIN",
                    *self.pkg_config("--cflags"), EXAMPLE / "dense_lapack.c", "-llapack",
                    "-o", folder / "msim_backend_dense-lapack.so")
        self.try_plugin(folder)

    def test_command_line(self):
        scene = self.prefix / "share/msim/scenes/hanging_cloth.json"
        support.run(self.prefix / "bin/msim_cli", "run", scene, "--steps", 2, "--quiet")
        support.run(self.prefix / "bin/msim_bench", "--version")

    def test_plugins_moved_along(self):
        words = support.run(self.prefix / "bin/msim_cli", "list").split()
        found = {Path(word).resolve() for word in words if re.fullmatch(r"/\S+\.so", word)}
        folder = self.prefix.resolve() / self.library.parent.relative_to(self.prefix) / "msim"
        self.assertEqual(found, {folder / f"msim_{name}.so" for name in support.plugins()})

    def test_nothing_remembers_where_it_was_built(self):
        places = [str(self.first), support.setting("BUILD"), str(support.SOURCE)]
        for path in self.prefix.rglob("*"):
            is_text = path.is_file() and path.is_relative_to(self.prefix / "share")
            if is_text or path.suffix in (".cmake", ".pc", ".h"):
                for place in places:
                    self.assertNotIn(place, path.read_text(), path)
            elif path.name.startswith(("msim_cli", "msim_bench")) or ".so" in path.suffixes:
                text = support.run("readelf", "-d", "-W", path)
                for folder in re.findall(r"\((?:RUNPATH|RPATH)\)[^\[]*\[([^\]]*)\]", text):
                    known = folder.startswith(("$ORIGIN", "/usr/lib/")) # MPI has folders there
                    self.assertTrue(known, f"{path}: {folder}")


class Documentation(unittest.TestCase):
    def test_its_program_is_the_one_tried_here(self):
        program = (HERE / "pendulum.c").read_text()
        page = (support.SOURCE / "docs" / "c_program.md").read_text()
        self.assertTrue(f"```c\n{program}```\n" in page, "c_program.md shows another pendulum.c")


if __name__ == "__main__":
    support.main()
