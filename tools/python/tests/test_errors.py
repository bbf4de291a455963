"""Exceptions: one class for each status, and the built-in one that fits."""
import msim
import msim._core
import msim._errors
import numpy as np
import pytest


def test_statuses_are_those_of_libmsim():
    known = {f"MSIM_{status.name}": int(status) for status in msim.Status}
    assert known == {name: value for name, (value, _) in msim._core.statuses().items()}


@pytest.mark.parametrize("status, builtin", [
    ("ERR_ARG", ValueError), ("ERR_SIZE", ValueError), ("ERR_NAME", ValueError),
    ("ERR_MEMORY", MemoryError), ("ERR_IO", OSError), ("ERR_UNSUPPORTED", NotImplementedError),
    ("ERR_PLUGIN", RuntimeError), ("ERR_ABI", RuntimeError), ("ERR_BACKEND", RuntimeError),
    ("NOT_SPD", ArithmeticError), ("NOT_CONVERGED", ArithmeticError),
    ("NOT_FINITE", ArithmeticError), ("UNSTABLE", ArithmeticError), ("STOPPED", RuntimeError)])
def test_every_status_has_an_exception(status, builtin):
    error = msim._errors.from_status(msim.Status[status], "why")
    assert isinstance(error, msim.Error) and isinstance(error, builtin)
    assert error.status == msim.Status[status] and str(error) == "why"


def test_no_status_is_without_one():
    assert set(msim._errors.CLASSES) == set(msim.Status) - {msim.Status.OK}


@pytest.mark.parametrize("option, meant", [
    ("dt", "h"), ("time_step", "h"), ("method", "integrator"), ("metod", "integrator"),
    ("rtol", "tol"), ("solver_rtl", "solver_rtol"), ("tend", "t_end"), ("integratr", "integrator")])
def test_near_misses_are_suggested(pair, option, meant):
    with pytest.raises(TypeError, match=f"did you mean '{meant}'") as error:
        msim.Sim(pair, **{option: 1})
    assert isinstance(error.value, msim.ArgumentError)


def test_an_option_like_no_other(pair):
    with pytest.raises(msim.OptionError, match="msim.options"):
        msim.Sim(pair, zzzz=1)


@pytest.mark.parametrize("options, error", [
    ({}, ValueError), ({"integrator": "leapfroggy"}, msim.NameNotFoundError),
    ({"integrator": "rk4", "h": -1}, ValueError), ({"integrator": "rk4", "h": "fast"}, ValueError),
    ({"integrator": "rk4", "h": [1]}, ValueError), ({"integrator": "rk4", "steps": 1.5}, ValueError),
    ({"integrator": "implicit-euler", "solver": "none such"}, msim.Error)])
def test_options_that_are_refused(pair, options, error):
    with pytest.raises(error):
        msim.Sim(pair, **options)


def test_options_of_all_spellings(pair):
    sim = msim.Sim(pair, **{"integrator": "implicit-euler", "solver.rtol": 1e-9, "h": np.float64(1e-2),
                            "steps": np.int32(3), "newton_rtol": 1e-7, "skip_two_d": False,
                            "watch": True, "tol": None})
    assert sim.plan.h == 1e-2 and sim.plan.steps == 3


def test_what_is_no_scene():
    with pytest.raises(msim.ArgumentError, match="Scene"):
        msim.Sim("scene.json", integrator="rk4")


def test_unstable_runs_say_so(pair):
    with pytest.warns(RuntimeWarning, match="explicit-euler"):
        sim = msim.Sim(pair, integrator="explicit-euler", h=5)
    with pytest.raises(msim.NumericalError) as error:
        sim.step(100000)
    assert error.value.status > 0 and np.isfinite(sim.x).all()
    assert error.value.advice.startswith("Set integrator = velocity-verlet and h = ")
    with pytest.raises(msim.ArgumentError) as error:
        sim.step(-1)
    assert not hasattr(error.value, "advice")


def test_a_run_that_fails_returns_its_frames(pair):
    with pytest.warns(RuntimeWarning):
        sim = msim.Sim(pair, integrator="explicit-euler", h=5, steps=1000, every=1)
    result = sim.run()
    assert not result.success and result.status in (msim.Status.UNSTABLE, msim.Status.NOT_FINITE)
    assert result.message and len(result) >= 1 and np.isfinite(result.x).all()


def test_indefinite_matrices_say_so():
    scene = msim.Scene()
    scene.add_particles([[0, 0, 0], [0.1, 0, 0]], mass=1e-3)
    scene.add_springs([[0, 1]], k=1000, rest=1)
    sim = msim.Sim(scene, integrator="linearly-implicit-euler", h=0.1, indefinite="stop",
                   skip_two_d=False)
    with pytest.raises(msim.NotPositiveDefiniteError):
        sim.step()


def test_solvers_that_do_not_converge_say_so(cloth):
    sim = msim.Sim(cloth, integrator="implicit-midpoint", h=0.1, newton_max_iterations=1,
                   newton_retries=0)
    with pytest.raises(msim.NotConvergedError):
        sim.step(10)


def test_unknown_files_of_trajectories(tmp_path, pair):
    sim = msim.Sim(pair, integrator="rk4", steps=2)
    with pytest.raises(msim.NameNotFoundError):
        sim.run(out=tmp_path / "run.nothing")
    with pytest.raises(OSError):
        sim.run(out=tmp_path / "no folder" / "run.csv")


def test_warnings_may_be_errors(pair):
    import warnings
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RuntimeWarning):
            msim.Sim(pair, integrator="explicit-euler", h=5)
