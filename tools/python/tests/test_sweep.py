"""Sweeps: tables against single runs, failures as rows, interruptions, workers, wrong arguments."""
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time

import msim
import numpy as np
import pytest
from conftest import ROOT

pd = pytest.importorskip("pandas")
distributed = pytest.importorskip("distributed")
from msim import _sweep_run  # noqa: E402

ROPE = {"gravity": [0, 0, -9.81], "objects": [
    {"type": "rope", "n": 6, "from": [0, 0, 0], "to": [1, 0, 0], "mass": 0.6, "k": 500,
     "damping": 0.1, "pinned": [0]}]}
RUN = {"integrator": "velocity-verlet", "h": 1e-3, "t_end": 0.2, "every": 20}
WITHOUT_H = {name: value for name, value in RUN.items() if name != "h"}
GRID = {"objects[0].k": [200, 500], "h": [1e-3, 5e-4, 2e-3]}


def lowest(sim, result):
    return {"lowest": result.x[..., 2].min(), "frames": len(result)}


def rope_of(sample):
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_rope(6, (0, 0, 0), (1, 0, 0), mass=0.6, k=sample["k"], damping=0.1, pinned=[0])
    return scene


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as made:
        yield made


@pytest.fixture(scope="module")
def client(cluster):
    with distributed.Client(cluster, set_as_default=False) as made:
        yield made


def same(a, b):
    """Everything but the processor time."""
    pd.testing.assert_frame_equal(a.drop(columns="cpu_s"), b.drop(columns="cpu_s"),
                                  check_exact=True)


def test_rows_are_those_of_single_runs(client):
    table = msim.sweep(ROPE, GRID, client, measure=lowest, **WITHOUT_H)
    assert list(table.index.names) == ["objects[0].k", "h"]
    assert list(table.index) == [(k, h) for k in GRID["objects[0].k"] for h in GRID["h"]]
    assert list(table.columns) == ["status", "message", "t", "steps", "kinetic", "elastic",
                                   "gravitational", "total", "work", "cpu_s", "lowest", "frames"]
    for (k, h), row in table.iterrows():
        sim = msim.Sim(rope_of({"k": k}), **(RUN | {"h": h}))
        result = sim.run()
        assert row.status == "OK" and row.steps == sim.nsteps and row.t == sim.t
        assert row.total == sim.energy.total and row.kinetic == sim.energy.kinetic
        assert row.lowest == result.x[..., 2].min() and row.frames == len(result)
        assert row.cpu_s > 0


@pytest.mark.parametrize("form", ["dict", "file", "scene", "function", "samples", "frame"])
def test_forms_of_arguments(form, client, tmp_path):
    options = {"measure": lowest, **WITHOUT_H}
    if form in ("scene", "function"):
        source = rope_of if form == "function" else rope_of({"k": 500})
        grid = {"k": [500, 200]} if form == "function" else {"gravity[2]": [-5, -2]}
        table = msim.sweep(source, {**grid, "h": [1e-3]}, client, **options)
        first = msim.sweep(ROPE, {"h": [1e-3]}, client, **options)
        if form == "function":
            assert table.iloc[0].lowest == first.iloc[0].lowest
        assert table.iloc[0].lowest != table.iloc[1].lowest
        return
    expected = msim.sweep(ROPE, GRID, client, **options)
    source, parameters = ROPE, GRID
    if form == "file":
        source = tmp_path / "rope.json"
        source.write_text(json.dumps({"msim": 1, **ROPE}))
    elif form in ("samples", "frame"):
        parameters = [{"objects[0].k": k, "h": h} for k in GRID["objects[0].k"] for h in GRID["h"]]
        parameters = pd.DataFrame(parameters) if form == "frame" else parameters
    same(msim.sweep(source, parameters, client, **options), expected)


def test_vectors_and_one_parameter(client):
    table = msim.sweep(ROPE, {"gravity": [[0, 0, -1], np.array([0, 0, -2.0])]}, client, **RUN)
    assert table.index.name == "gravity" and list(table.index) == [(0, 0, -1), (0, 0, -2)]
    assert table.gravitational.iloc[0] != table.gravitational.iloc[1]


def test_the_table_does_not_depend_on_workers(client):
    options = {"measure": lowest, **WITHOUT_H}
    tables = [msim.sweep(ROPE, GRID, measure=lowest, workers=workers, **WITHOUT_H)
              for workers in (1, 2)]
    same(*tables)
    same(tables[0], msim.sweep(ROPE, GRID, client, **options))


def test_runs_have_one_thread():
    scene = msim.Scene()
    scene.add_cloth((200, 200), (0, 0, 0), (1, 0, 0), (0, 1, 0), mass=1, k=1)
    options = {"integrator": "velocity-verlet", "h": 1e-6, "steps": 0}
    assert msim.Sim(scene, **options).plan.threads > 1 or os.cpu_count() == 1
    job = _sweep_run.Job(scene.dumps(), options, lambda sim, result: {"n": sim.plan.threads}, "",
                         None, 1)
    assert _sweep_run.run(job, {"drag": 1})["n"] == 1
    assert _sweep_run.run(job, {"threads": 2})["n"] == min(2, os.cpu_count())


def test_by_the_address_of_a_scheduler(cluster):
    same(msim.sweep(ROPE, {"h": [1e-3]}, cluster.scheduler_address, **WITHOUT_H),
         msim.sweep(ROPE, {"h": [1e-3]}, workers=1, **WITHOUT_H))


# -- failures -------------------------------------------------------------------------------------

def fails_for_200(sample):
    if sample["k"] == 200:
        raise ValueError("a stiffness of 200 is not sold")
    return rope_of(sample)


def test_failures_are_rows(client):
    table = msim.sweep(fails_for_200, {"k": [200, 500, -1], "h": [1e-3, 1.0]}, client,
                       measure=lowest, **(WITHOUT_H | {"t_end": 40}))
    assert list(table.status) == ["ValueError"] * 2 + ["OK", "UNSTABLE"] + ["ERR_ARG"] * 2
    assert set(table.message[:2]) == {"a stiffness of 200 is not sold"}
    assert "k" in table.message.iloc[4]
    assert 0 <= table.t.iloc[3] < 40 and np.isnan(table.lowest.iloc[3])
    assert table.steps.dtype.kind == "i" and (table.steps[4:] == 0).all()


@pytest.mark.parametrize("measure, status, words", [
    (lambda sim, result: 1 / 0, "ZeroDivisionError", "division"),
    (lambda sim, result: 3, "ERR_ARG", "must return a dict"),
    (lambda sim, result: {"x": result.x}, "ERR_ARG", "'x': ndarray"),
    (lambda sim, result: {"steps": 3}, "ERR_ARG", "which the table has already"),
])
def test_measures_that_fail(measure, status, words, client, tmp_path):
    row = msim.sweep(ROPE, {"drag": [0]}, client, measure=measure, folder=tmp_path, **RUN).iloc[0]
    assert row.status == status and words in row.message
    assert not list(tmp_path.glob("*.json"))                     # it is tried again


def dies_for_200(sample):
    if sample["k"] == 200:
        os.kill(os.getpid(), signal.SIGKILL)
    return rope_of(sample)


def test_workers_that_die():
    table = msim.sweep(dies_for_200, {"k": [500, 200, 400]}, workers=1, **RUN)
    assert list(table.status) == ["OK", "KilledWorker", "OK"]


# -- interruptions --------------------------------------------------------------------------------

def job_of(folder, measure=lowest, **options):
    return _sweep_run.Job(json.dumps({"msim": 1, **ROPE}), RUN | options, measure, "lowest",
                          str(folder), 0.0)


@pytest.mark.parametrize("killed", [20, 100, 200])
def test_a_run_continues_where_it_was_killed(killed, tmp_path, monkeypatch):
    """The same row, by the frames from the last checkpoint on only."""
    (tmp_path / "whole").mkdir()
    expected = _sweep_run.run(job_of(tmp_path / "whole"), {"drag": 0.1})
    add, seen = _sweep_run._Progress.add, []

    def until_it_is_killed(self, sim):
        if sim.nsteps == killed:
            raise KeyboardInterrupt
        seen.append(sim.nsteps)
        add(self, sim)

    def counted(self, sim):
        seen.append(sim.nsteps)
        add(self, sim)

    monkeypatch.setattr(_sweep_run._Progress, "add", until_it_is_killed)
    with pytest.raises(KeyboardInterrupt):
        _sweep_run.run(job_of(tmp_path), {"drag": 0.1})
    assert seen == list(range(0, killed, 20)) and len(list(tmp_path.glob("*.npz"))) == 1
    seen.clear()
    file, = tmp_path.glob("*.npz")
    with np.load(file) as saved:
        np.savez(file, **{**saved, "cpu_s": 1000.0})
    monkeypatch.setattr(_sweep_run._Progress, "add", counted)
    row = _sweep_run.run(job_of(tmp_path), {"drag": 0.1})
    assert seen in (list(range(first, 201, 20)) for first in (killed - 20, killed))
    assert row.pop("cpu_s") > 1000 and 0 < expected.pop("cpu_s") < 100 and row == expected
    assert row["frames"] == 11 and not list(tmp_path.glob("*.npz"))
    seen.clear()
    assert _sweep_run.run(job_of(tmp_path), {"drag": 0.1})["lowest"] == row["lowest"]
    assert seen == []


def test_checkpoints_that_do_not_fit_start_the_run_anew(tmp_path):
    (tmp_path / "whole").mkdir()
    expected = _sweep_run.run(job_of(tmp_path / "whole"), {"drag": 0.1})
    name = next((tmp_path / "whole").glob("*.json")).stem
    other = msim.Sim(msim.Scene.from_dict(ROPE), **(RUN | {"h": 2e-3}))
    contents = [b"", b"text", b"PK\x03\x04"]
    for content in contents + [None]:
        file = tmp_path / f"{name}.npz"
        if content is None:
            np.savez(file, checkpoint=np.frombuffer(other.dumps(), np.uint8), cpu_s=1.0)
        else:
            file.write_bytes(content)
        row = _sweep_run.run(job_of(tmp_path), {"drag": 0.1})
        assert {**row, "cpu_s": 0} == {**expected, "cpu_s": 0}
        (tmp_path / f"{name}.json").unlink()


def test_rows_are_found_by_what_they_depend_on(client, tmp_path):
    """More values, other orders and other folders of scenes: only what is new is run."""
    def times():
        return {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("*.json")}

    options = {"measure": lowest, "folder": tmp_path, **WITHOUT_H}
    first = msim.sweep(ROPE, {"h": [1e-3, 2e-3]}, client, **options)
    before = times()
    assert len(before) == 2
    second = msim.sweep(ROPE, {"h": [2e-3, 5e-4, 1e-3]}, client, **options)
    assert len(times()) == 3 and before.items() <= times().items()
    pd.testing.assert_frame_equal(second.loc[[1e-3, 2e-3]], first)
    msim.sweep(ROPE, {"h": [2e-3]}, client, **(options | {"measure": lambda sim, result: {"a": 1}}))
    msim.sweep(ROPE, {"h": [2e-3]}, client, **(options | {"t_end": 0.1}))
    msim.sweep({**ROPE, "drag": 0.5}, {"h": [2e-3]}, client, **options)
    assert len(times()) == 6


SCRIPT = """
import sys
import msim
sys.path.insert(0, {tests!r})
from test_sweep import ROPE, lowest

if __name__ == "__main__":
    msim.sweep(ROPE, {{"objects[0].k": [100 + 10 * i for i in range(24)]}}, measure=lowest,
               folder={folder!r}, workers=2, checkpoint_interval=0, integrator="velocity-verlet",
               h=1e-5, t_end=2, every=2000)
"""


def test_a_sweep_that_is_killed_continues(tmp_path):
    folder, script = tmp_path / "runs", tmp_path / "sweep.py"
    script.write_text(SCRIPT.format(tests=str(ROOT / "tools/python/tests"), folder=str(folder)))
    with subprocess.Popen([sys.executable, script], start_new_session=True) as killed:
        deadline = time.monotonic() + 120
        while not (list(folder.glob("*.json")) and list(folder.glob("*.npz"))):
            assert killed.poll() is None and time.monotonic() < deadline
            time.sleep(0.002)
        os.killpg(killed.pid, signal.SIGKILL)
    done = {file: file.stat().st_mtime_ns for file in folder.glob("*.json")}
    started = list(folder.glob("*.npz"))
    assert 0 < len(done) < 24 and started
    with np.load(started[0]) as file:
        assert len(file["step"]) > 0
    options = {"measure": lowest, "workers": 2, "integrator": "velocity-verlet", "h": 1e-5,
               "t_end": 2, "every": 2000}
    grid = {"objects[0].k": [100 + 10 * i for i in range(24)]}
    table = msim.sweep(ROPE, grid, folder=folder, **options)
    assert len(list(folder.glob("*.json"))) == 24 and not list(folder.glob("*.npz"))
    assert {file: file.stat().st_mtime_ns for file in done} == done
    same(table, msim.sweep(ROPE, grid, **options))


# -- refusals -------------------------------------------------------------------------------------

@pytest.mark.parametrize("arguments, words", [
    ({"parameters": 3}, "parameters must be a dict of lists, a list of dicts or a DataFrame"),
    ({"parameters": "h"}, "found str"),
    ({"parameters": {}}, "parameters is empty"),
    ({"parameters": []}, "parameters is empty"),
    ({"parameters": {"h": []}}, r"parameters\['h'\] is empty"),
    ({"parameters": {"h": 0.1}}, r"parameters\['h'\] must be a list of values; found 0.1"),
    ({"parameters": {"h": "auto"}}, r"parameters\['h'\] must be a list of values; found 'auto'"),
    ({"parameters": {3: [1]}}, "names of parameters must be texts, as 'h'; found 3"),
    ({"parameters": [{"h": 1}, 3]}, r"parameters\[1\] must be a dict"),
    ({"parameters": [{"h": 1}, {"tol": 1}]}, "only one of them has 'h'"),
    ({"parameters": {"dragg": [1]}}, "neither an option nor a path in the scene; did you mean 'drag"),
    ({"parameters": {"objects[1].k": [1]}}, r"'objects' of the scene has 1 entries"),
    ({"parameters": {"objects.k": [1]}}, "'objects' of the scene has no 'k'"),
    ({"parameters": {"objects[0].kk.shear": [1]}}, r"'objects\[0\]' of the scene has no 'kk'; it has"),
    ({"parameters": {"objects[0]..k": [1]}}, "is no option and no path in a scene"),
    ({"parameters": {"h": [1]}, "h": 2}, "'h' is both a parameter and an option"),
    ({"parameters": {"solver.rtol": [1]}, "solver_rtol": 2}, "both a parameter and an option"),
    ({"dt": 1}, "there is no option 'dt'; did you mean 'h'"),
    ({"scene": 3}, "scene must be a file, a dict, an msim.Scene or a function"),
    ({"scene": "no_such_file.json"}, "no_such_file.json"),
    ({"measure": 3}, "measure must be a function of the sim and its result; found 3"),
    ({"client": 3}, "client must be a Client of dask.distributed or the address"),
    ({"client": "nonsense://1"}, "no scheduler of Dask answers at nonsense://1"),
    ({"client": "tcp://127.0.0.1:9", "workers": 2}, "those of a client are its own"),
    ({"workers": 0}, "workers must be a whole number from 1"),
    ({"checkpoint_interval": -1}, "checkpoint_interval must be a finite number >= 0"),
    ({"folder": 3}, "path must be a text or a path"),
    ({"folder": "/dev/null/runs"}, "folder /dev/null/runs cannot be made"),
    ({"measure": lambda sim, result, lock=threading.Lock(): {}}, "can be pickled"),
])
def test_what_is_refused(arguments, words, client):
    given = {"scene": ROPE, "parameters": {"drag": [1]}, "client": None, **arguments}
    if "pickled" in words:
        given["client"] = client
    with pytest.raises(msim.Error, match=words):
        msim.sweep(**given)


@pytest.mark.parametrize("module", ["pandas", "distributed"])
def test_without_dask(module, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf"sweep\(\) needs {module}: pip install"):
        msim.sweep(ROPE, {"h": [1]})


def test_scripts_that_are_imported_by_their_workers(tmp_path):
    script = tmp_path / "sweep.py"
    script.write_text("import msim\nmsim.sweep({'particles': {'x': [[0, 0, 0]], 'mass': 1}}, "
                      "{'h': [1]}, workers=1, integrator='rk4', t_end=1)\n")
    with contextlib.suppress(subprocess.TimeoutExpired):
        done = subprocess.run([sys.executable, script], text=True, capture_output=True, timeout=60)
        assert done.returncode != 0 and "__name__" in done.stderr
        return
    pytest.fail("the script does not end")


def test_progress(client, capsys):
    pytest.importorskip("tqdm")
    msim.sweep(ROPE, {"drag": [0, 1, 2]}, client, progress=True, **RUN)
    assert "3/3" in capsys.readouterr().err


@pytest.mark.parametrize("given, word", [(["--workers", "0"], "workers must be"),
                                         (["--out", "/dev/null"], "/dev/null/runs")])
def test_the_study_refuses(tmp_path, given, word):
    """One sentence, without a traceback"""
    pytest.importorskip("matplotlib")
    done = subprocess.run([sys.executable, "-B", ROOT / "tools/study", "--out", tmp_path, *given],
                          text=True, capture_output=True)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("study: ") and word in done.stderr


def test_the_study(tmp_path):
    """tools/study: sags depend on mass g/(k L) alone, and swings die out as exp(-t drag/2m)."""
    matplotlib = pytest.importorskip("matplotlib")
    del matplotlib
    subprocess.run([sys.executable, "-B", ROOT / "tools/study", "--out", tmp_path], check=True)
    table = pd.read_csv(tmp_path / "study.csv")
    assert len(table) == 200 and (table.status == "OK").all()
    ratio = table.settled * table.drag / (table.mass / 81) / (2 * np.log(50))
    assert 0.75 < ratio.min() and ratio.max() < 1.05
    load = table.mass / table.k
    curve = table.assign(load=load).sort_values("load")
    slope = np.polyfit(np.log(curve.load), np.log(curve.sag), 3)
    assert np.abs(np.polyval(slope, np.log(curve.load)) / np.log(curve.sag) - 1).max() < 5e-3
    assert (tmp_path / "study.png").stat().st_size > 10000


def test_the_snippet_of_the_page(tmp_path, monkeypatch):
    """docs/sweeps.md"""
    monkeypatch.chdir(tmp_path)
    cloth = {"type": "cloth", "n": [4, 4], "origin": [0, 0, 0], "row": [1, 0, 0],
             "column": [0, 1, 0], "mass": 0.1, "k": 100, "pinned": "corners"}
    (tmp_path / "cloth.json").write_text(json.dumps(
        {"msim": 1, "gravity": [0, 0, -9.81], "objects": [cloth]}))
    snippet, = re.findall(r"```python\n(.*?)```", (ROOT / "docs/sweeps.md").read_text(), re.S)
    exec(snippet, {"__name__": "__main__"})
    table = pd.read_csv("cloth.csv")
    assert len(table) == 6 and table.sag[0] > table.sag[4] > 0
    assert len(list((tmp_path / "runs").glob("*.json"))) == 6
