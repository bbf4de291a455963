"""Recorded runs, written in other formats: the bytes are those of the run itself, recorded so."""
import msim
import numpy as np
import pytest
from conftest import network

h5py = pytest.importorskip("h5py")
pytestmark = pytest.mark.skipif(not {r.name: r.available for r in msim.recorders()}.get("hdf5"),
                                reason="the recorder hdf5 is not there")
EXTENSIONS = "csv", "html", "pvd"


def random_scene(seed):
    """Networks in space and in a plane, with faces and planes, loose particles and springs of rest
    length 0."""
    random = np.random.default_rng(seed)
    scene = msim.Scene(gravity=random.normal(size=3), drag=random.choice([0, 0.1]),
                       name=f"no. {seed} <&\" \u00e9")
    n = int(random.integers(1, 30))
    x = random.normal(size=(n, 3))
    if seed % 3 == 0:
        x[:, 2] = 0
        scene.gravity = (0.3, -9.81, 0)
    v = x[::-1] * [1, -1, 0]
    v[0] = 0
    scene.add_particles(x, mass=random.uniform(0.1, 2, n), v=v)
    ij = np.array([(i, j) for i in range(n) for j in range(i) if random.random() < 0.3])
    if len(ij):
        scene.add_springs(ij, k=random.uniform(0, 100, len(ij)), damping=random.uniform(0, 1),
                          rest=random.uniform(0, 1, len(ij)) * (random.random(len(ij)) < 0.7))
    if n > 3:
        scene.add_faces(random.permutation(n)[:3].reshape(1, 3))
        scene.pin(0)
    if seed % 2:
        scene.add_plane((0, 1, 0), offset=-2, restitution=0.5, friction=0.2)
    return scene


def options_of(seed):
    return [{"integrator": "velocity-verlet", "h": 1e-3, "t_end": 0.1, "every": 7},
            {"integrator": "symplectic-euler", "h": 1e-3, "t_end": 0.1, "fps": 90},
            {"integrator": "dop853", "tol": 1e-6, "t_end": 0.3, "fps": 31},
            {"integrator": "implicit-midpoint", "h": 3e-3, "steps": 5},
            {"integrator": "verlet", "h": 1e-3, "steps": 10, "every": 3},
            {"integrator": "rk4", "h": 1e-3, "steps": 0}][seed % 6]


def files_below(folder):
    return {str(path.relative_to(folder)): path.read_bytes()
            for path in sorted(folder.rglob("*")) if path.is_file()}


def record(scene, options, path, frames=None):
    """All frames, or the first ones only, as of a run that was interrupted."""
    sim = msim.Sim(scene, **options)
    with sim.recorder(path) as recorder:
        for i, _ in enumerate(sim.frames()):
            if i == frames:
                break
            recorder.write()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("frames", [None, 0, 1, 3])
@pytest.mark.parametrize("seed", range(12))
def test_bytes_are_those_of_the_run(seed, frames, tmp_path):
    scene, options = random_scene(seed), options_of(seed)
    if options["integrator"] == "verlet" and scene.planes:
        options = options_of(0)
    run, copy = tmp_path / "run", tmp_path / "copy"
    run.mkdir()
    copy.mkdir()
    record(scene, options, tmp_path / "a.vtkhdf", frames)
    with msim.Trajectory(tmp_path / "a.vtkhdf") as trajectory:
        for extension in EXTENSIONS:
            record(scene, options, run / f"a.{extension}", frames)
            trajectory.record(copy / f"a.{extension}")
    assert files_below(copy) == files_below(run)


def test_options_in_the_scene_do_not_matter(tmp_path):
    """Those of its run are not for the sim that takes its states."""
    scene = msim.Scene.from_dict({
        "particles": {"x": [[0, 0, 0], [1.1, 0, 0]], "mass": 1},
        "springs": {"ij": [[0, 1]], "k": 10},
        "run": {"integrator": "dop853", "tol": 1e-6, "t_end": 0.5, "fps": 10}})
    for extension in "vtkhdf", "html":
        record(scene, {}, tmp_path / f"run.{extension}")
    with msim.Trajectory(tmp_path / "run.vtkhdf") as run:
        run.record(tmp_path / "copy.html")
        assert len(run.energies.total) == 6
    assert (tmp_path / "copy.html").read_bytes() == (tmp_path / "run.html").read_bytes()


def test_the_data_for_viewers_are_the_same(tmp_path, cloth):
    """From .vtkhdf to .vtkhdf: all but what resumes the run."""
    msim.Sim(cloth, integrator="velocity-verlet", h=1e-3, t_end=0.05, fps=100).run(
        out=tmp_path / "run.vtkhdf")
    with msim.Trajectory(tmp_path / "run.vtkhdf") as run:
        run.record(tmp_path / "copy.vtkhdf")
    with (h5py.File(tmp_path / "run.vtkhdf", locking=False) as run,
          h5py.File(tmp_path / "copy.vtkhdf", locking=False) as copy):
        names = []
        run["VTKHDF"].visititems(lambda name, item: names.append(name) if
                                 isinstance(item, h5py.Dataset) else None)
        assert len(names) > 20
        for name in names:
            np.testing.assert_array_equal(run["VTKHDF"][name][()], copy["VTKHDF"][name][()], name)


@pytest.mark.parametrize("seed", range(4))
def test_strain_is_that_of_the_file(seed, tmp_path):
    """The file has it in single precision."""
    scene = random_scene(seed)
    record(scene, options_of(0), tmp_path / "run.vtkhdf")
    with (msim.Trajectory(tmp_path / "run.vtkhdf") as run,
          h5py.File(tmp_path / "run.vtkhdf", locking=False) as file):
        cells = scene.nsprings + len(scene.faces)
        rows = file["VTKHDF/CellData/Strain"][:len(run) * cells].reshape(len(run), cells)
        for i in range(len(run)):
            assert run.strain(i).shape == (scene.nsprings,)
            np.testing.assert_allclose(run.strain(i), rows[i, :scene.nsprings], rtol=1e-6,
                                       atol=1e-12)
        np.testing.assert_array_equal(run.strain(-1), run.strain(len(run) - 1))
        with pytest.raises(IndexError):
            run.strain(len(run))


def test_what_is_refused(tmp_path):
    scene = network()
    for extension in "vtkhdf", "csv":
        record(scene, options_of(0), tmp_path / f"run.{extension}")
    (tmp_path / "letter.html").write_text("a letter")
    before = files_below(tmp_path)
    with msim.Trajectory(tmp_path / "run.vtkhdf") as run:
        with pytest.raises(msim.ArgumentError, match="into itself"):
            run.record(tmp_path / "run.vtkhdf")
        with pytest.raises(msim.FileError, match="letter.html"):
            run.record(tmp_path / "letter.html")
        with pytest.raises(msim.NameNotFoundError, match="run.nothing"):
            run.record(tmp_path / "run.nothing")
        with pytest.raises(msim.UnsupportedError, match="no scene"):
            msim.Trajectory(tmp_path / "run.csv").record(tmp_path / "page.html")
        assert files_below(tmp_path) == before
        run.record(tmp_path / "letter.html", replace=True)
        run.record(tmp_path / "run.csv")  # a trajectory of msim
    assert (tmp_path / "run.csv").read_bytes() == before["run.csv"]
    assert (tmp_path / "letter.html").read_text().startswith("<!doctype html>")
