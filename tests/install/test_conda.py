"""Tests of packaging/conda without conda: the recipe is rendered, its scripts run as conda-build runs
them, each output is installed with those that it needs in an environment of its own, and its tests run
there. Libraries are those of the system. tools/full.sh (recipes) runs it, with the packages that it
needs for Python: jinja2, pyyaml, and what tools/python is built with."""
import os
import re
import shutil
import site
import subprocess
import sys
import unittest
from pathlib import Path

import jinja2
import support
import yaml

RECIPE = support.SOURCE / "packaging/conda"
WORK = support.SOURCE / "build/recipes/conda"
OUTPUTS = ["libmsim", "libmsim-assimp", "libmsim-cholmod", "libmsim-hdf5", "libmsim-klu",
           "libmsim-mpi", "libmsim-petsc", "libmsim-sundials", "msim", "py-msim"]
ALONE = {"libmsim-mpi": "lib/msim/msim_comm_mpi.so",  # not from the build of the others
         "libmsim-petsc": "lib/msim/msim_backend_petsc.so"}


def project_version():
    text = (support.SOURCE / "CMakeLists.txt").read_text()
    return re.search(r"project\(msim VERSION (\S+)", text)[1]


def without_selectors(text):
    """The lines `... # [SELECTOR]` that are for Linux; None for a line that is for others."""
    for line in text.splitlines():
        selector = re.search(r"# \[(.+)\]$", line)
        if not selector or eval(selector[1], {"linux": True}):  # Python, as in conda-build
            yield line


def render():
    """The recipe for Linux. Requirements keep their names, pinned ones as pin_subpackage NAME."""
    functions = {"compiler": "compiler-{}".format, "stdlib": "stdlib-{}".format,
                 "pin_subpackage": lambda name, **_: f"pin_subpackage {name}"}
    template = "\n".join(without_selectors((RECIPE / "meta.yaml").read_text()))
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined)
    return yaml.safe_load(environment.from_string(template).render(functions))


def files(folder):
    return {path.relative_to(folder) for path in folder.rglob("*") if not path.is_dir()}


class Environment:
    """A folder with a Python, whose modules are those of this one, and what is added."""

    def __init__(self, prefix):
        self.prefix = prefix
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", prefix], check=True)
        modules = next(prefix.glob("lib/python*/site-packages"))
        (modules / "host.pth").write_text(site.getsitepackages()[0])
        self.before = files(prefix)

    def variables(self, **more):
        return {"PATH": f"{self.prefix}/bin:{os.environ['PATH']}", "PREFIX": str(self.prefix),
                "PYTHON": str(self.prefix / "bin/python"), "HOME": os.environ["HOME"],
                "PKG_CONFIG_PATH": str(self.prefix / "lib/pkgconfig"), "PYTHONDONTWRITEBYTECODE": "1",
                **{name: value for name, value in os.environ.items() if "CCACHE" in name
                   or name.endswith("_LAUNCHER")}, **more}

    def add(self, other):
        for file in other.added():
            (self.prefix / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(other.prefix / file, self.prefix / file, follow_symlinks=False)

    def added(self):
        return files(self.prefix) - self.before


class Recipe(unittest.TestCase):
    """conda-build in small: built, installed and tested once."""

    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        cls.recipe = render()
        cls.outputs = {output["name"]: output for output in cls.recipe["outputs"]}
        cls.source = WORK / "source"
        shutil.copytree(RECIPE / cls.recipe["source"]["path"], cls.source, symlinks=True,
                        ignore=shutil.ignore_patterns("build", ".git", ".venv", "__pycache__"))
        cls.variables = {"SRC_DIR": str(cls.source), "CPU_COUNT": "2",
                         "CMAKE_ARGS": f"-DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX={WORK}/host"}
        cls.run_script("build.sh", {**os.environ, **cls.variables, "PREFIX": f"{WORK}/host"})
        cls.built = {name: cls.install(output) for name, output in cls.outputs.items()}

    @classmethod
    def install(cls, output):
        environment = Environment(WORK / "outputs" / output["name"])
        cls.run_script(output["script"],
                       environment.variables(PKG_NAME=output["name"], **cls.variables))
        return environment

    @classmethod
    def run_script(cls, script, variables):
        printed = support.run("bash", "-e", RECIPE / script, cwd=cls.source, env=variables)
        if "Manually-specified variables were not used" in printed:
            raise AssertionError(f"{script} sets a variable that CMake does not know\n{printed}")

    def needed(self, *names):
        """The outputs of these names and all that they need at run time."""
        found = set()
        for name in names:
            run = self.outputs[name].get("requirements", {}).get("run", [])
            found |= {name} | self.needed(*self.pinned(run))
        return found

    @staticmethod
    def pinned(requirements):
        return [word.split()[1] for word in requirements if word.startswith("pin_subpackage ")]

    def test_names_versions_licences(self):
        self.assertEqual(sorted(self.outputs), OUTPUTS)
        self.assertEqual(str(self.recipe["package"]["version"]), project_version())
        python = (support.SOURCE / "tools/python/cholmod/pyproject.toml").read_text()
        gpl = re.search(r'license = "(.*)"', python)[1]
        for name, output in self.outputs.items():
            self.assertEqual(output["about"]["license"], gpl if "cholmod" in name else "MIT")
            self.assertTrue((self.source / output["about"]["license_file"]).is_file())
        self.assertNotIn("libmsim-cholmod", self.needed(*set(OUTPUTS) - {"libmsim-cholmod"}))

    def test_each_file_is_in_one_output(self):
        whole = WORK / "whole"
        support.run("cmake", "--install", self.source / "build", "--prefix", whole)
        expected = {file for file in files(whole) if file.parts[:2] != ("libexec", "msim")}
        packed = [file for name, built in self.built.items() if name not in ("py-msim", *ALONE)
                  for file in built.added()]
        self.assertEqual(len(packed), len(set(packed)))
        self.assertEqual(set(packed), expected)
        for name, file in ALONE.items():
            self.assertEqual(self.built[name].added(), {Path(file)})
        modules = {file for file in self.built["py-msim"].added() if "msim" in str(file)}
        self.assertEqual(modules, self.built["py-msim"].added())

    def test_outputs(self):
        """The tests of each output, in an environment with what it needs."""
        for name, output in self.outputs.items():
            with self.subTest(name):
                tests = output["test"]
                environment = Environment(WORK / "environments" / name)
                for other in self.needed(name, *self.pinned(tests.get("requires", []))):
                    environment.add(self.built[other])
                folder = WORK / "tests" / name
                folder.mkdir(parents=True)
                for source in tests.get("source_files", []):
                    shutil.copytree(self.source / source, folder / source)
                commands = [*tests["commands"],
                            *(f"python -c 'import {module}'" for module in tests.get("imports", []))]
                for command in commands:
                    support.run("bash", "-e", "-o", "pipefail", "-c", command, cwd=folder,
                                env=environment.variables())


if __name__ == "__main__":
    support.main()
