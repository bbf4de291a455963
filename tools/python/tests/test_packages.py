"""What is installed: source archive and wheel in clean environments, and the types."""
import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parents[1]
ROOT = HERE.parents[1]
CHECKOUT = (ROOT / "include/msim/api.h").is_file()
TYPED = """
from typing import assert_type
import numpy as np
from numpy.typing import NDArray
import msim
scene = msim.Scene(gravity=(0, 0, -1))
assert_type(scene.add_particles([[0, 0, 0], [1, 0, 0]], mass=1), range)
scene.pin(np.array([0]))
sim = msim.Sim(scene, integrator="rk4", h=1e-3, steps=10)
assert_type(sim.x, NDArray[np.float64])
assert_type(sim.run(observer=lambda s: s.t > 1).energy.total, NDArray[np.float64])
for frame in sim.frames(every=2):
    assert_type(frame.t, float)
assert_type(msim.Trajectory("a.csv").times, NDArray[np.float64])
"""

CHOLMOD = """
import msim
scene = msim.Scene(gravity=(0, 0, -1))
scene.add_cloth((9, 9), (0, 0, 0), (1, 0, 0), (0, 1, 0), mass=1, k=100, pinned="corners")
sim = msim.Sim(scene, integrator="implicit-euler", h=0.01, solver="cholmod")
sim.step(5)
assert sim.plan.solver == "cholmod" and sim.stats["factorizations"] > 0
"""


def run(*command, **options):
    done = subprocess.run([str(word) for word in command], text=True, capture_output=True, **options)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


def python_of(folder):
    """The interpreter of a new environment."""
    venv.create(folder, with_pip=True)
    return folder / "bin/python"


def smoke(python, folder):
    """The first program of README.md."""
    program = re.search(r"```python\n(.*?)```", (HERE / "README.md").read_text(), re.S)[1]
    return run(python, "-c", program + "print(msim.__file__, msim.solvers(), msim.recorders())",
               cwd=folder)


def test_types(tmp_path):
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text(TYPED)
    mypy = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache",
            "--config-file", HERE / "pyproject.toml"]
    assert "Success" in run(*mypy, "-p", "msim", cwd=tmp_path)
    assert "Success" in run(*mypy, "user.py", cwd=tmp_path)
    (tmp_path / "wrong.py").write_text('import msim\nmsim.Scene().pin(object())\nmsim.Sim("a")\n')
    found = subprocess.run([str(word) for word in [*mypy, "wrong.py"]], cwd=tmp_path, text=True,
                           capture_output=True)
    assert "Found 2 errors" in found.stdout


def test_stubs_name_what_there_is(tmp_path):
    """Compiled functions have no signatures: names only."""
    pytest.importorskip("mypy")
    import msim._core
    stub = (HERE / "src/msim/_core.pyi").read_text()
    named = {name for name in re.findall(r"^(?:    )?def (\w+)", stub, re.M)
             if not name.startswith("__")}
    there = {name for scope in (msim._core, msim._core.Scene, msim._core.Sim, msim._core.Recorder)
             for name in vars(scope) if not name.startswith("__")}
    assert named == there - {"Scene", "Sim", "Recorder"}


def test_versions_agree():
    import msim
    version = re.search(r'^version = "(.*)"', (HERE / "pyproject.toml").read_text(), re.M)[1]
    assert msim.__version__ == version


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    if not CHECKOUT:
        pytest.skip("not in a checkout")
    pytest.importorskip("build")
    folder = tmp_path_factory.mktemp("sdist")
    before = sorted(HERE.iterdir())
    run(sys.executable, "-m", "build", "--sdist", "--outdir", folder, HERE)
    assert sorted(HERE.iterdir()) == before  # copies of the sources are gone
    return next(folder.glob("msim-*.tar.gz"))


@pytest.mark.slow
def test_source_archive_holds_all_sources(archive):
    with tarfile.open(archive) as tar:
        names = {name.split("/", 1)[1] for name in tar.getnames() if "/" in name}
    expected = {f"libmsim/{path.relative_to(ROOT)}" for folder in ("include", "src", "backends")
                for path in (ROOT / folder).rglob("*") if path.is_file()}
    assert expected | {"LICENSE", "pyproject.toml", "core/sim.cpp", "src/msim/py.typed"} <= names
    assert not [name for name in names if "__pycache__" in name or name.endswith(".so")]


@pytest.mark.slow
def test_source_archive_installs(archive, tmp_path):
    python = python_of(tmp_path / "venv")
    run(python, "-m", "pip", "install", "--quiet", archive, cwd=tmp_path)
    assert str(tmp_path / "venv") in smoke(python, tmp_path)
    assert "Successfully uninstalled" in run(python, "-m", "pip", "uninstall", "-y", "msim")
    assert not list((tmp_path / "venv").rglob("msim*"))


def wheel_of(project, libraries, folder):
    """A wheel, built as cibuildwheel does with the static libraries of wheel_libraries.sh, and the
    folder of its content."""
    run(sys.executable, "-m", "build", "--wheel", "--outdir", folder, project,
        "-Ccmake.define.MSIM_WHEEL=ON", env={**os.environ, "CMAKE_PREFIX_PATH": libraries})
    wheel = next(folder.glob("*.whl"))
    with zipfile.ZipFile(wheel) as content:
        content.extractall(folder / "content")
    return wheel, folder / "content"


def needed_and_defined(library):
    """The shared libraries that a library is linked to, and the C symbols that it exports."""
    needed = re.findall(r"NEEDED.*\[(.*?)\.so", run("readelf", "-d", library))
    defined = re.findall(r" GLOBAL +DEFAULT +\d+ (\w+)", run("readelf", "--dyn-syms", "-W", library))
    return set(needed), [name for name in defined if not name.startswith("_Z")]


def static_libraries():
    prefix = os.environ.get("MSIM_WHEEL_LIBRARIES")
    if not prefix:
        pytest.skip("MSIM_WHEEL_LIBRARIES names no folder made by wheel_libraries.sh")
    return prefix


@pytest.mark.slow
def test_wheel_needs_nothing_of_its_machine(tmp_path):
    wheel, content = wheel_of(HERE, static_libraries(), tmp_path)
    for file in "msim/__init__.py", "msim/_core.pyi", "msim/py.typed":
        assert (content / file).is_file()
    assert list(content.glob("*/licenses/LICENSE"))
    assert wheel.stat().st_size < 5e6
    needed, defined = needed_and_defined(next(content.glob("msim/_core*.so")))
    assert needed <= {"libc", "libm", "libdl", "libpthread", "libstdc++", "libgcc_s",
                      "ld-linux-x86-64"}, needed
    assert defined == ["PyInit__core"]
    python = python_of(tmp_path / "venv")
    run(python, "-m", "pip", "install", "--quiet", wheel, cwd=tmp_path)
    shown = smoke(python, tmp_path)
    assert "name='klu', available=True" in shown and "name='hdf5', available=True" in shown
    assert "name='cholmod', available=True" not in shown
    if Path("/usr/include/suitesparse/cholmod.h").is_file():
        run(python, "-m", "pip", "install", "--quiet", HERE / "cholmod", cwd=tmp_path)
        assert "name='cholmod', available=True" in smoke(python, tmp_path)
        run(python, "-c", CHOLMOD, cwd=tmp_path)


@pytest.mark.slow
def test_cholmod_wheel_needs_only_lapack(tmp_path):
    """CHOLMOD is linked in, with its licences; auditwheel would add LAPACK and BLAS."""
    wheel, content = wheel_of(HERE / "cholmod", static_libraries() + "_cholmod", tmp_path)
    assert "-py3-none-" in wheel.name
    for file in "CHOLMOD-License.txt", "gpl.txt":
        assert list(content.glob(f"*/licenses/{file}"))
    plugin = content / "msim/plugins/msim/msim_backend_cholmod.so"
    needed, defined = needed_and_defined(plugin)
    assert needed <= {"libc", "libm", "libdl", "liblapack", "libblas", "libopenblas"}, needed
    assert defined == ["msim_backend_entry"]
    run(sys.executable, "-c", CHOLMOD, cwd=tmp_path,
        env={**os.environ, "MSIM_PLUGIN_PATH": str(plugin.parent)})


@pytest.mark.slow
@pytest.mark.parametrize("project, built", [(HERE, ["cp310", "cp311", "cp312"]),
                                            (HERE / "cholmod", ["cp310"])])
def test_cibuildwheel_reads_its_configuration(project, built):
    pytest.importorskip("cibuildwheel")
    listed = run(sys.executable, "-m", "cibuildwheel", "--platform", "linux", "--archs", "x86_64",
                 "--print-build-identifiers", project)
    assert listed.split() == [f"{python}-manylinux_x86_64" for python in built]
