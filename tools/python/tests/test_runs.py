"""Runs: frames, results, observers, recordings; against msim_cli and SciPy."""
import json
import os
import subprocess

import msim
import numpy as np
import pytest
from conftest import ROOT, network
from test_sim import springs_force


def sim_of(scene, **options):
    return msim.Sim(scene, **{"integrator": "velocity-verlet", "h": 1e-3, **options})


def times(frames):
    return [frame.t for frame in frames]


def test_results_are_those_of_solve_ivp(tmp_path):
    """A damped network of springs in gravity, by an independent integrator and force."""
    scipy = pytest.importorskip("scipy.integrate")
    scene = network()
    free = ~scene.pinned

    def derivative(_, y):
        x, v = y.reshape(2, 12, 3)
        a = springs_force(scene, x, v) / scene.mass[:, None]
        return np.concatenate([np.where(free[:, None], v, 0).ravel(), a.ravel()])

    start = np.concatenate([scene.x.ravel(), scene.v.ravel()])
    reference = scipy.solve_ivp(derivative, (0, 1), start, method="DOP853", rtol=1e-12, atol=1e-12,
                                t_eval=[0, 0.25, 0.5, 0.75, 1]).y.T.reshape(5, 2, 12, 3)
    result = msim.run(scene, integrator="dop853", tol=1e-9, t_end=1, fps=4)
    assert result.success and result.nfev > 0
    np.testing.assert_allclose(result.t, [0, 0.25, 0.5, 0.75, 1])
    np.testing.assert_allclose(result.x, reference[:, 0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(result.v, reference[:, 1], rtol=0, atol=1e-7)


def cli():
    given = os.environ.get("MSIM_CLI", ROOT / "build/release/bin/msim_cli")
    if not os.access(given, os.X_OK):
        pytest.skip("msim_cli is not built")
    return given


@pytest.mark.parametrize("name", ["pendulum", "hanging_cloth", "rope", "bouncing_balls",
                                  "jelly_drop", "three_particles"])
def test_bits_are_those_of_msim_cli(name, tmp_path):
    path = ROOT / "tools/scenes" / f"{name}.json"
    final = tmp_path / "final.json"
    subprocess.run([cli(), "run", path, "--quiet", "--final", final], check=True)
    expected = json.loads(final.read_text())
    sim = msim.Sim(msim.Scene.load(path))
    result = sim.run()
    assert result.success and sim.nsteps == expected["step"] and sim.t == expected["t"]
    np.testing.assert_array_equal(sim.x, expected["x"])
    np.testing.assert_array_equal(sim.v, expected["v"])
    np.testing.assert_array_equal(result.x[-1], expected["x"])
    assert sim.energy.total == expected["energy"]["total"]


def test_the_result(cloth):
    sim = sim_of(cloth, t_end=0.1, every=10)
    result = sim.run()
    assert len(result) == 11 and result.success and result.status == msim.Status.OK
    assert result.x.shape == result.v.shape == (11, 64, 3)
    assert result.energy.total.shape == result.t.shape == (11,)
    np.testing.assert_array_equal(result.x[-1], sim.x)
    np.testing.assert_array_equal(result.steps, range(0, 101, 10))
    assert result.nsteps == 100 and result.nfev == result.stats["force_evaluations"]
    for word in ("message", "success", "11 from t = 0 to 0.1 s", "nfev"):
        assert word in repr(result)
    assert result._repr_html_().startswith("<pre>")
    again = sim.run()
    assert len(again) == 0 and again.success and again.x.shape == (0, 64, 3)
    assert "frames: 0" in repr(again)


def test_frames_keep_their_states(cloth):
    frames = list(sim_of(cloth, t_end=0.05, every=10).frames())
    assert [frame.step for frame in frames] == [0, 10, 20, 30, 40, 50]
    assert not np.array_equal(frames[1].x, frames[2].x)


def test_frames_go_on_after_a_break(cloth):
    sim = sim_of(cloth, t_end=0.05, every=10)
    for frame in sim.frames():
        if frame.step == 20:
            break
    assert [frame.step for frame in sim.frames()] == [30, 40, 50]
    whole = sim_of(cloth, t_end=0.05)
    whole.step(50)
    np.testing.assert_array_equal(sim.x, whole.x)


def test_frames_under_error_control_are_at_their_times(cloth):
    sim = sim_of(cloth, integrator="dop853", tol=1e-4, t_end=0.1, fps=40)
    np.testing.assert_allclose(times(sim.frames()), [0, 0.025, 0.05, 0.075, 0.1], rtol=1e-12)
    for wrong in ({"every": 2}, {"fps": 2}, {"t_end": 2}):
        with pytest.raises(msim.ArgumentError, match="error control"):
            next(sim.frames(**wrong))


def test_frames_as_the_loop_asks(pair):
    assert times(sim_of(pair, h=0.01).frames(every=3, t_end=0.1)) == pytest.approx(
        [0, 0.03, 0.06, 0.09, 0.1])
    assert times(sim_of(pair, h=0.01).frames(fps=30, t_end=0.1)) == pytest.approx(
        [0, 0.04, 0.07, 0.1])
    assert len(list(sim_of(pair, h=0.01).frames(t_end=10))) == 201
    assert len(list(sim_of(pair, h=0.01).frames(fps=1e6, t_end=0.1))) == 11
    endless = sim_of(pair, h=0.01).frames(every=2)
    assert [next(endless).step for _ in range(3)] == [0, 2, 4]


@pytest.mark.parametrize("fps", [7, 30, 100 / 3, 59.94])
def test_frames_of_the_loop_are_those_of_the_options(pair, fps):
    asked = times(sim_of(pair, h=0.01).frames(fps=fps, t_end=2))
    assert asked == times(sim_of(pair, h=0.01, fps=fps, t_end=2).frames())


@pytest.mark.parametrize("wrong", [{}, {"every": 0}, {"fps": 0}, {"fps": -1}, {"t_end": -1},
                                   {"every": 1, "fps": 1}, {"fps": float("nan")}])
def test_frames_that_are_refused(pair, wrong):
    with pytest.raises(msim.ArgumentError):
        next(sim_of(pair).frames(**wrong))


def test_steps_inside_the_loop_are_allowed(pair):
    steps = []
    sim = sim_of(pair, steps=10, every=2)
    for frame in sim.frames():
        steps.append(frame.step)
        if frame.step == 4:
            sim.step(3)
    assert steps == [0, 2, 4, 8, 10]


def test_observers(pair):
    seen = []

    def observer(sim):
        seen.append((sim.nsteps, sim.x.copy(), sim.energy.total))
        return sim.nsteps >= 4

    sim = sim_of(pair, steps=10, every=2)
    result = sim.run(observer=observer)
    assert [entry[0] for entry in seen] == [0, 2, 4] and len(result) == 3
    assert result.status == msim.Status.STOPPED and not result.success
    assert sim.run().success and sim.nsteps == 10


@pytest.mark.parametrize("entry", [lambda sim: sim.step(), lambda sim: sim.run(),
                                   lambda sim: list(sim.frames(every=1))])
def test_observers_must_not_step(pair, entry):
    sim = sim_of(pair, steps=10, every=2)

    def observer(observed):
        if observed.nsteps == 4:
            entry(observed)

    with pytest.raises(msim.ArgumentError, match="observer"):
        sim.run(observer=observer)
    assert sim.nsteps == 4
    sim.step()


def test_errors_of_observers_end_the_run(pair):
    sim = sim_of(pair, steps=10, every=2)
    with pytest.raises(ZeroDivisionError):
        sim.run(observer=lambda _: 1 / 0)
    assert sim.run().success


def test_an_observer_may_change_its_sim(pair):
    sim = sim_of(pair, steps=10, every=2)
    assert sim.run(observer=lambda s: s.set_springs(k=20)).success
    assert sim.force()[0, 0] == pytest.approx(20 * (np.linalg.norm(sim.x[1] - sim.x[0]) - 1))


def test_progress(pair, capsys):
    pytest.importorskip("tqdm")
    assert len(list(sim_of(pair, t_end=0.1).frames(progress=True))) == 101
    assert "simulated" in capsys.readouterr().err


@pytest.mark.parametrize("extension", [".csv", ".vtkhdf"])
def test_trajectories(extension, cloth, tmp_path):
    if extension == ".vtkhdf":
        pytest.importorskip("h5py")
        if not {r.name: r.available for r in msim.recorders()}.get("hdf5"):
            pytest.skip("the recorder hdf5 is not there")
    path = tmp_path / f"run{extension}"
    result = sim_of(cloth, t_end=0.05, every=10).run(out=path)
    with msim.Trajectory(path) as run:
        assert len(run) == 6 and run.n == 64 and "6 frames of 64" in repr(run)
        np.testing.assert_array_equal(run.times, result.t)
        np.testing.assert_array_equal(run.steps, result.steps)
        for i, frame in enumerate(run):
            np.testing.assert_array_equal(frame.x, result.x[i])
            np.testing.assert_array_equal(run.v(i), result.v[i])
        np.testing.assert_array_equal(run.x(-1), result.x[-1])
        with pytest.raises(IndexError):
            run.x(6)
        if extension == ".csv":
            with pytest.raises(msim.UnsupportedError):
                run.scene
        else:
            np.testing.assert_array_equal(run.ij, cloth.ij)
            np.testing.assert_array_equal(run.energies.total, result.energy.total)


def test_files_are_not_replaced_unasked(pair, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("a letter")
    with pytest.raises(msim.FileError):
        sim_of(pair, steps=2).run(out=path)
    assert path.read_text() == "a letter"
    sim_of(pair, steps=2).run(out=path, replace=True)
    assert len(msim.Trajectory(path)) == 3


def test_recorders(pair, tmp_path):
    sim = sim_of(pair, steps=4)
    with sim.recorder(tmp_path / "run.csv") as recorder:
        recorder.write()
        sim.step()
        recorder.write()
    with pytest.raises(msim.ArgumentError, match="closed"):
        recorder.write()
    recorder.close()
    kept = sim.recorder(tmp_path / "other.csv")
    del sim  # closed first
    kept.close()
    assert len(msim.Trajectory(tmp_path / "run.csv")) == 2
    with pytest.raises(msim.ArgumentError, match="planned"):
        sim_of(pair, steps=4).run(out=tmp_path / "x.csv", every=2)


def test_recordings_resume(cloth, tmp_path):
    if not {r.name: r.available for r in msim.recorders()}.get("hdf5"):
        pytest.skip("the recorder hdf5 is not there")
    path = tmp_path / "run.vtkhdf"
    first = sim_of(cloth, t_end=0.05, every=10)
    with first.recorder(path) as recorder:
        for frame in first.frames():
            recorder.write()
            if frame.step == 20:
                break
    second = sim_of(cloth, t_end=0.05, every=10)
    with second.recorder(path, resume=True) as recorder:
        assert second.nsteps == 20
        for frame in second.frames():
            recorder.write()
    assert list(msim.Trajectory(path).steps) == [0, 10, 20, 30, 40, 50]


def test_files_that_are_no_trajectories(tmp_path):
    pytest.importorskip("h5py")
    for name, content in (("a.csv", b"x,y\n1,2\n"), ("b.csv", b"\xff\xfe"), ("c.vtkhdf", b"text"),
                          ("d.txt", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(msim.Error, match=name):
            msim.Trajectory(tmp_path / name)
    with pytest.raises(OSError):
        msim.Trajectory(tmp_path / "none.csv")


def test_the_end_of_an_interrupted_csv(pair, tmp_path):
    path = tmp_path / "run.csv"
    sim_of(pair, steps=2).run(out=path)
    path.write_bytes(path.read_bytes()[:-20])
    assert len(msim.Trajectory(path)) == 2
