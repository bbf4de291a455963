"""The program msim-view: pages, pictures, films, windows, and its sentences."""
import os
import struct
import subprocess
import sys

import msim
import numpy as np
import pytest
from conftest import ROOT
from msim import _pictures, _viewer
from test_view import without

HDF5 = {r.name: r.available for r in msim.recorders()}.get("hdf5")


@pytest.fixture
def run(tmp_path, cloth):
    """The path of a recorded run of 11 frames, 0.2 s."""
    pytest.importorskip("h5py")
    if not HDF5:
        pytest.skip("the recorder hdf5 is not there")
    path = tmp_path / "run.vtkhdf"
    msim.Sim(cloth, integrator="velocity-verlet", h=1e-3, t_end=0.2, fps=50).run(out=path)
    return path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def pixels(path):
    """Width and height of a PNG."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", data[16:24])


def sentence(capsys):
    """What was printed: one line, to stderr."""
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("msim-view: ") and err.count("\n") == 1
    return err


@pytest.mark.parametrize("kind", ["html", "pvd"])
def test_recordings(kind, run, tmp_path, cloth, capsys):
    """The bytes of the run itself, recorded so: test_record.py."""
    other = tmp_path / "other"
    other.mkdir()
    msim.Sim(cloth, integrator="velocity-verlet", h=1e-3, t_end=0.2, fps=50).run(
        out=other / f"run.{kind}")
    for _ in range(2):  # it replaces its own files
        assert _viewer.main([str(run), f"--{kind}"]) == 0
        assert capsys.readouterr().out == f"{tmp_path / 'run'}.{kind}\n"
    assert (tmp_path / f"run.{kind}").read_bytes() == (other / f"run.{kind}").read_bytes()


def test_other_files_are_replaced_by_force(run, tmp_path, capsys):
    (tmp_path / "run.html").write_text("a letter")
    assert _viewer.main([str(run), "--html"]) == 1
    assert "run.html" in sentence(capsys)
    assert (tmp_path / "run.html").read_text() == "a letter"
    assert _viewer.main([str(run), "--html", "--force"]) == 0


def test_pictures(run, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    assert _viewer.main([str(run), "--png"]) == 0
    assert _viewer.main([str(run), "--energy"]) == 0
    assert _viewer.main([str(run), "--energy", "-o", str(tmp_path / "e.svg")]) == 0
    assert names(tmp_path) == ["e.svg", "run.png", "run.vtkhdf", "run_energy.png"]
    assert pixels(tmp_path / "run.png") == pixels(tmp_path / "run_energy.png") == (960, 720)
    assert "<svg" in (tmp_path / "e.svg").read_text()


def test_the_picture_is_that_of_the_last_frame(run, tmp_path):
    pytest.importorskip("matplotlib")
    with msim.Trajectory(run) as trajectory:
        for name, keywords in (("default", {}), ("last", {"frame": 10}), ("first", {"frame": 0})):
            _pictures.write_picture(trajectory, str(tmp_path / f"{name}.png"), **keywords)
    default, last, first = ((tmp_path / f"{name}.png").read_bytes()
                            for name in ("default", "last", "first"))
    assert default == last != first


def test_pictures_show_springs_and_particles_without(run, cloth):
    pytest.importorskip("matplotlib")
    with msim.Trajectory(run) as trajectory:
        drawing = _pictures._Drawing(trajectory, range(len(trajectory)), "a test")
        for frame in 0, 10, 5:
            drawing.show(frame)
            segments = np.array(drawing._springs._segments3d)
            np.testing.assert_array_equal(segments, trajectory.x(frame)[cloth.ij])
            np.testing.assert_array_equal(drawing._springs.get_array(), trajectory.strain(frame))
            assert f"{trajectory.times[frame]:.3f} s" in drawing._axes.get_title()
        x = np.concatenate([frame.x for frame in trajectory])
        limits = [drawing._axes.get_xlim(), drawing._axes.get_ylim(), drawing._axes.get_zlim()]
        assert (np.array(limits)[:, 0] <= x.min(axis=0) + 1e-9).all()
        assert (np.array(limits)[:, 1] >= x.max(axis=0) - 1e-9).all()
        assert drawing._particles.get_data_3d()[0].size == 0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("extension", [".csv", ".vtkhdf"])
def test_particles_without_springs(extension, falling, tmp_path):
    pytest.importorskip("matplotlib")
    if extension == ".vtkhdf":
        pytest.importorskip("h5py")
    path = tmp_path / f"run{extension}"
    msim.Sim(falling, integrator="velocity-verlet", h=1e-2, steps=3).run(out=path)
    assert _viewer.main([str(path), "--png"]) == 0
    assert pixels(tmp_path / "run.png") == (960, 720)
    with msim.Trajectory(path) as trajectory:
        drawing = _pictures._Drawing(trajectory, [3], "a test")
        drawing.show(3)
        np.testing.assert_array_equal(np.array(drawing._particles.get_data_3d()).T,
                                      trajectory.x(3))


@pytest.mark.parametrize("times, expected", [
    (np.arange(11) / 50, [0, 2, 4, 6, 8, 10]), (np.arange(4) / 10, [0, 0, 0, 1, 1, 2, 2, 2, 3]),
    (np.array([3.0]), [0]), (np.array([0, 0.01]), [0, 1]), (np.arange(26) / 25, list(range(26)))])
def test_films_are_in_real_time(times, expected):
    frames = _pictures.film_frames(times)
    assert frames == expected
    for i, frame in enumerate(frames[:-1]):
        at = times[0] + i / 25
        assert times[frame] <= at + 1e-9
        assert frame + 1 == len(times) or times[frame + 1] > at + 1e-12


def test_a_film(run, tmp_path):
    pytest.importorskip("matplotlib")
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    assert _viewer.main([str(run), "--mp4", "-o", str(tmp_path / "film.mp4")]) == 0
    assert names(tmp_path) == ["film.mp4", "run.vtkhdf"]
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"
    frames, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert frames == 6 and abs(seconds - 6 / 25) < 0.03


def test_an_ffmpeg_that_fails(run, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/ffmpeg").write_text(
        "#!/bin/sh\nfor last; do :; done\necho >\"$last\"\ncat >/dev/null\nexit 3\n")
    (tmp_path / "bin/ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    assert _viewer.main([str(run), "--mp4"]) == 1
    assert "run.mp4" in (err := sentence(capsys)) and "3" in err
    assert names(tmp_path) == ["bin", "run.vtkhdf"]


@pytest.mark.parametrize("module, kind", [("matplotlib", "png"), ("matplotlib", "mp4"),
                                          ("matplotlib", "energy"), ("imageio_ffmpeg", "mp4")])
def test_missing_packages_are_named(module, kind, run, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    for name in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert _viewer.main([str(run), f"--{kind}"]) == 1
    err = sentence(capsys)
    assert f"--{kind}" in err and f"pip install {module.replace('_', '-')}" in err
    assert names(tmp_path) == ["run.vtkhdf"]


def test_windows(run, monkeypatch, capsys):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in "DISPLAY", "WAYLAND_DISPLAY":
        monkeypatch.delenv(name, raising=False)
    assert _viewer.main([str(run)]) == 1
    assert "--html" in sentence(capsys)
    monkeypatch.setenv("DISPLAY", ":0")
    shown = []
    monkeypatch.setattr(_viewer, "view", lambda trajectory: shown.append(len(trajectory)))
    assert _viewer.main([str(run)]) == 0
    assert shown == [11]
    monkeypatch.undo()
    monkeypatch.setenv("DISPLAY", ":0")
    without(monkeypatch, "pyvista")
    assert _viewer.main([str(run)]) == 1
    assert "pip install pyvista" in sentence(capsys)


def test_sentences(run, tmp_path, cloth, capsys):
    (tmp_path / "text.vtkhdf").write_text("text")
    (tmp_path / "text.csv").write_text("a,b\n")
    (tmp_path / "run.txt").write_text("")
    for extension in "csv", "vtkhdf":
        msim.Sim(cloth, integrator="rk4", steps=1).recorder(tmp_path / f"empty.{extension}").close()
    msim.Sim(cloth, integrator="rk4", steps=1).run(out=tmp_path / "table.csv")
    before = names(tmp_path)
    for words, wanted in ((["none.vtkhdf", "--html"], "none.vtkhdf: No such file"),
                          (["none.csv"], "none.csv: No such file"),
                          (["text.vtkhdf", "--png"], "text.vtkhdf: this is no trajectory"),
                          (["text.csv", "--png"], "text.csv: this is no trajectory"),
                          (["run.txt"], ".csv or .vtkhdf"),
                          (["empty.csv", "--png"], "empty.csv has no frames"),
                          (["empty.vtkhdf", "--html"], "empty.vtkhdf has no frames"),
                          (["table.csv", "--html"], "holds no scene"),
                          (["table.csv", "--energy"], "holds no scene"),
                          (["run.vtkhdf", "-o", "a.html"], "say what to write: --html"),
                          (["run.vtkhdf", "--html", "-o", "a.png"], "a.png: the file of --html"),
                          (["run.vtkhdf", "--energy", "-o", "a.xyz"], ".png, .svg"),
                          (["run.vtkhdf", "--png", "-o", "no/a.png"], "cannot write")):
        words = [str(tmp_path / word) if "." in word else word for word in words]
        assert _viewer.main(words) == 1, words
        assert wanted in sentence(capsys), words
    assert names(tmp_path) == before
    with pytest.raises(SystemExit) as usage:
        _viewer.main([str(run), "--html", "--png"])
    assert usage.value.code == 2


@pytest.mark.parametrize("program", [
    [os.path.join(os.path.dirname(sys.executable), "msim-view")],
    [sys.executable, str(ROOT / "tools/view")]])
def test_programs(program, run, tmp_path):
    if not os.path.exists(program[-1]):
        pytest.skip(f"{program[-1]} is not there")
    done = subprocess.run([*program, run, "--html"], text=True, capture_output=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{tmp_path / 'run.html'}\n"
    done = subprocess.run([*program, "none.csv"], text=True, capture_output=True)
    assert (done.returncode, done.stdout) == (1, "")
    assert "none.csv" in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.parametrize("program", ["view", "study"])
def test_without_the_package(program):
    """Programs of a checkout, before anything is installed."""
    path = ROOT / "tools" / program
    if not path.exists():
        pytest.skip("not in a checkout")
    code = ("import runpy, sys; sys.modules['msim'] = None; "
            f"runpy.run_path({str(path)!r}, run_name='__main__')")
    done = subprocess.run([sys.executable, "-c", code], text=True, capture_output=True)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"{program}: there is no module msim")
    assert "pip install" in done.stderr and "./tools/python" in done.stderr
