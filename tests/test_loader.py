"""Tests of loading plugins in msim_cli that need a process of their own, or a compiler."""
import os
import pwd
import re
import shutil
import subprocess
from pathlib import Path

import support
from cli_support import CLI, CliTest

FAKES = Path(support.setting("BUILD")) / "tests/fakes"

# Two free particles and a spring, the smallest coupled system.
SCENE = {"msim": 1, "gravity": [0, 0, -9.81],
         "particles": {"x": [[0, 0, 0], [1, 0, 0]], "mass": 1},
         "springs": {"ij": [[0, 1]], "k": 100},
         "run": {"integrator": "linearly-implicit-euler", "h": 0.01, "steps": 2}}


class Loader(CliTest):
    def setUp(self):
        super().setUp()
        self.scene(SCENE)

    def attempt(self, solver, *plugin_path, program=CLI, **environment):
        """Runs the scene with this solver; returns the exit status and stderr."""
        path = ":".join(map(str, plugin_path))
        done = subprocess.run([program, "run", "scene.json", "--quiet", "--solver", solver],
                              cwd=self.folder, text=True, capture_output=True,
                              env=dict(os.environ, MSIM_PLUGIN_PATH=path, **environment))
        self.assertEqual(done.stdout, "")
        return done.returncode, done.stderr

    def put(self, name):
        """The plugin with the fault that its name says."""
        shutil.copy(FAKES / "msim_backend_good.so", self.folder / f"msim_backend_{name}.so")

    def test_environment(self):
        self.assertEqual(self.attempt("good", FAKES), (0, ""))
        self.assertEqual(self.attempt("good", "/nowhere", FAKES), (0, ""))
        status, err = self.attempt("good", "/nowhere")
        self.assertEqual(status, 1)
        self.assert_sentence(err, "msim_cli: unknown solver 'good': msim_backend_good.so was not "
                                  "found in /nowhere, ")

    def test_exit_status_and_one_line(self):
        for name, status, sentence in (
                ("wrong_abi", 1, "was built for backend ABI 99, but msim "),
                ("fails", 1, "fails: analyze failed on request"),
                ("invents_a_status", 1, "returned status 77, which is not one that a backend may return"),
                ("never_spd", 2, "step 1, t = 0.01 s: never_spd: the system matrix is not "
                                 "positive definite"),
                ("liar", 2, "solver liar reached a relative residual of ")):
            with self.subTest(name):
                self.put(name)
                code, err = self.attempt(name, self.folder)
                self.assertEqual(code, status, err)
                self.assert_sentence(self.without_advice(err), sentence)

    def test_names_stay_on_one_line(self):
        for name in ("../good", str(FAKES / "good"), "go\nod", "good\x1b[2J"):
            with self.subTest(name):
                code, err = self.attempt(name, FAKES)
                self.assertEqual(code, 1)
                self.assert_sentence(err, "is not a valid name of a backend; names consist of a-z, 0-9, '_' "
                                          "and '-'")

    def test_library_behind_a_plugin_is_missing(self):
        compiler = support.setting("CC")
        (self.folder / "gone.c").write_text("int gone(void); int gone(void) { return 1; }\n")
        support.run(compiler, "-shared", "-fPIC", "gone.c", "-o", "libgone.so", cwd=self.folder)
        support.run(compiler, "-shared", "-fPIC", "-DMSIM_PLUGIN", "-I", support.SOURCE / "include",
                    support.SOURCE / "tests/fake_backend.c", "-o", "msim_backend_orphan.so",
                    "-Wl,--no-as-needed", "-L.", "-lgone", "-Wl,-rpath,$ORIGIN", cwd=self.folder)
        self.assertEqual(self.attempt("orphan", self.folder), (0, ""))
        (self.folder / "libgone.so").unlink()
        code, err = self.attempt("orphan", self.folder)
        self.assertEqual(code, 1)
        self.assert_sentence(err, f"solver 'orphan': {self.folder}/msim_backend_orphan.so cannot "
                                  "be loaded: libgone.so: ")

    def test_a_plugin_that_was_not_built_names_its_package(self):
        library = support.shared_library().resolve()
        shutil.copy(library, self.folder / "libmsim.so.0")
        packages = (support.SOURCE / "tools/packages").read_text()
        recipe = (support.SOURCE / "packaging/conda/meta.yaml").read_text()
        debian = (support.SOURCE / "tests/install/test_debian.py").read_text()
        pip = (support.SOURCE / "tools/python/cholmod/pyproject.toml").read_text()
        for solver in ("cholmod", "klu", "petsc", "sundials-pcg"):
            code, err = self.attempt(solver, LD_LIBRARY_PATH=str(self.folder))
            self.assertEqual(code, 1)
            self.assert_sentence(err, f"msim_backend_{solver}.so was not found in {self.folder}/")
            built = re.search(r"msim after 'apt install (.*)' or 'conda install (.*)'$", err)
            for name in built[1].split():
                self.assertRegex(packages, rf"(?m)^{name} +(plugins|tests) ")
            for name in built[2].split():
                self.assertRegex(recipe, rf'(?m)(^    - |, "){name}[ "\n]')
            made = re.search(r"its package, (\S+) \(apt\)(?:,| or) libmsim-(\S+) \(conda\)(.*?), or", err)
            self.assertIn(f'"{made[1]}"', debian)
            self.assertIn(f'("{made[2]}", ', recipe)
            self.assertEqual(made[3], " or msim-cholmod (pip)" if solver == "cholmod" else "")
            self.assertIn('name = "msim-cholmod"', pip)

    def as_nobody(self, program):
        """A copy of a program that runs as the user nobody (set-user-ID), whoever starts it."""
        copy = self.folder / f"nobodys_{Path(program).name}"
        shutil.copy(program, copy)
        os.chown(copy, pwd.getpwnam("nobody").pw_uid, -1)
        copy.chmod(0o4755)
        return copy

    def test_environment_is_not_trusted_under_setuid(self):
        if os.geteuid() != 0 or support.setting("SANITIZE"):
            self.skipTest("needs root, without sanitizers")
        self.folder.chmod(0o755)
        who = subprocess.run([self.as_nobody(shutil.which("id")), "-u"], capture_output=True)
        if int(who.stdout or 0) == 0:
            self.skipTest("setuid does not work here")
        program = self.as_nobody(CLI)
        code, err = self.attempt("good", FAKES, program=program)
        if "shared librar" in err:
            self.skipTest("nobody may not read the build folder")
        self.assertEqual(code, 1)
        self.assert_sentence(err, "unknown solver 'good': msim_backend_good.so was not found in "
                                  "")
        self.assertNotIn(str(FAKES), err)
        program.chmod(0o755)  # the same program without the set-user-ID bit
        self.assertEqual(self.attempt("good", FAKES, program=program), (0, ""))

    def test_static_builds_open_no_plugin(self):
        if support.setting("SHARED") == "1":
            self.skipTest("a shared build has plugin files")
        linked = [words[0] for words in map(str.split, self.good("list").split("Recorders")[0]
                                            .splitlines()) if words[1:2] == ["yes"]]
        for solver in set(linked) - {"auto", "pcg"}:
            with self.subTest(solver):
                (self.folder / f"msim_backend_{solver}.so").write_text("not looked at\n")
                code, err = self.attempt(solver, self.folder, LD_DEBUG="files",
                                         LD_DEBUG_OUTPUT=f"{self.folder}/linker")
                self.assertEqual((code, err), (0, ""))
        opened = "".join(log.read_text() for log in self.folder.glob("linker.*"))
        self.assertNotIn("msim_backend_", opened)


if __name__ == "__main__":
    support.main()
