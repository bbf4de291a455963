"""Sweeps: runs of a scene with many values of its parameters, on processes of Dask, as a table."""
from __future__ import annotations

import difflib
import importlib
import inspect
import itertools
import json
import logging
import math
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _options, _sweep_run
from ._arrays import Path
from ._errors import ArgumentError, ArgumentTypeError, FileError
from ._scene import Scene, _jsonable
from ._sweep_run import EMPTY, Job, Measure, Row, Sample

if TYPE_CHECKING:
    from distributed import Client
    from pandas import DataFrame

SceneSource = Scene | Path | Mapping[str, object] | Callable[[Sample], Scene]
_ABSENT_KEYS = ("name", "gravity", "drag") # of scenes, which a sweep may add


def sweep(scene: SceneSource, parameters: Mapping[str, Sequence[object]] | Iterable[Sample] |
          DataFrame, client: Client | str | None = None, *, measure: Measure | None = None,
          folder: Path | None = None, workers: int | None = None, checkpoint_interval: float = 10,
          progress: bool = False, **options: object) -> DataFrame:
    """Run a scene for each sample of its parameters, and return a table with one row for each.

    scene: a file, its tree as a dict, a Scene, or a function of a sample that returns a Scene.
    parameters: {name: values}, for all combinations, of which the last name varies fastest; or
    samples, as dicts or the rows of a DataFrame. A name is that of an option, as h, or a path in the
    scene, as objects[0].k; the function gets all of them. They are the index of the table.

    client: a Client of Dask, or the address of its scheduler; None: processes of this machine, as
    many as `workers`, which is by default one for each processor.
    measure(sim, result): a dict of further columns, for the sim at its end and its frames as of
    Sim.run. progress: a bar (tqdm). options: those of Sim, for all runs; threads is 1.

    folder: a folder, which all workers see, for rows, and for checkpoints of runs that take longer
    than checkpoint_interval, s, 0: at each frame. The same call continues a sweep that was interrupted: runs that are
    done are not repeated, others go on bit by bit from their checkpoints. A row is found again by
    the content of scene and options, the text of `measure`, and the version of msim.

    Columns: status ("OK", or the name of what happened) and message; t, steps, and the energies of
    the last state; cpu_s, the processor time of the run; what `measure` returns. What goes wrong in
    one run is its row, and ends no other. All but cpu_s is independent of the number of workers.
    """
    pandas, distributed = _require("pandas"), _require("distributed")
    samples = _samples(parameters)
    job = _job(scene, samples, options, measure, folder, checkpoint_interval)
    _refuse_import_by_worker(client)
    with _connected(distributed, client, _workers(client, workers, len(samples))) as connection:
        rows = _rows(distributed, connection, job, samples, progress)
    table: DataFrame = _table(pandas, samples, rows)
    return table


# -- arguments ------------------------------------------------------------------------------------

def _require(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f"sweep() needs {module}: pip install distributed pandas, or apt install "
                          "python3-distributed python3-pandas") from error


def _samples(parameters: object) -> list[Sample]:
    """One dict for each run, all with the same names."""
    if hasattr(parameters, "to_dict") and hasattr(parameters, "columns"):
        parameters = parameters.to_dict("records")
    if isinstance(parameters, Mapping):
        return _grid(parameters)
    if isinstance(parameters, (str, bytes)) or not isinstance(parameters, Iterable):
        raise ArgumentTypeError("parameters must be a dict of lists, a list of dicts or a DataFrame; "
                                f"found {type(parameters).__name__}")
    samples: list[Sample] = []
    for number, sample in enumerate(parameters):
        if not isinstance(sample, Mapping):
            raise ArgumentTypeError(f"parameters[{number}] must be a dict, as {{'h': 0.01}}; found "
                                    f"{sample!r}")
        first = samples[0] if samples else sample
        different = sorted(set(first) ^ set(sample), key=str)
        if different:
            raise ArgumentError(f"parameters[0] and parameters[{number}] must have the same names; "
                                f"only one of them has {different[0]!r}")
        samples.append({name: sample[name] for name in first})
    _check_names(samples[0] if samples else {})
    return samples


def _grid(parameters: Mapping[Any, Any]) -> list[Sample]:
    _check_names(parameters)
    for name, values in parameters.items():
        listed = isinstance(values, Iterable) and getattr(values, "ndim", 1) > 0
        if not listed or isinstance(values, (str, bytes, Mapping)):
            raise ArgumentTypeError(f"parameters['{name}'] must be a list of values; found {values!r}")
    lists = [list(values) for values in parameters.values()]
    empty = [name for name, values in zip(parameters, lists) if not values]
    if empty:
        raise ArgumentError(f"parameters['{empty[0]}'] is empty; give at least one value")
    return [dict(zip(parameters, values)) for values in itertools.product(*lists)]


def _check_names(names: Mapping[Any, Any]) -> None:
    if not names:
        raise ArgumentError("parameters is empty; give at least one name and one value")
    for name in names:
        if not isinstance(name, str):
            raise ArgumentTypeError(f"names of parameters must be texts, as 'h'; found {name!r}")


def _text_of(scene: object) -> str | Callable[[Sample], Scene]:
    """The scene as JSON text, so that workers need no files; a function stays."""
    if isinstance(scene, Scene):
        return scene.dumps()
    if isinstance(scene, Mapping):
        return json.dumps({"msim": 1, **scene}, default=_jsonable)
    if isinstance(scene, (str, os.PathLike)):
        read = Scene.load(scene) # in any format, with messages that name the file
        if os.fspath(scene).endswith(".json"):
            with open(scene, encoding="utf-8") as file:
                return file.read()
        return read.dumps()
    if callable(scene):
        return scene
    raise ArgumentTypeError("scene must be a file, a dict, an msim.Scene or a function that returns "
                            f"one; found {type(scene).__name__}")


def _check_path(tree: dict[str, Any], name: str, value: object) -> None:
    """Refuse what is neither an option nor in the scene, before anything is run."""
    top = name.split(".")[0].split("[")[0]
    if top not in tree and top not in _ABSENT_KEYS:
        known = [*tree, *_ABSENT_KEYS, *(option.keyword for option in _options.options())]
        near = difflib.get_close_matches(name, known, 1)
        hint = f"did you mean '{near[0]}'?" if near else f"the scene has {', '.join(tree)}"
        raise ArgumentError(f"'{name}' is neither an option nor a path in the scene; {hint}")
    _sweep_run.substitute(tree, name, value)


def _job(scene: object, samples: list[Sample], options: dict[str, object], measure: Measure | None,
         folder: Path | None, checkpoint_interval: float) -> Job:
    _options.as_text(options)
    twice = [name for name in samples[0] for option in options
             if _sweep_run.is_option(name) and
             _options._BY_KEYWORD[name] == _options._BY_KEYWORD[option]]
    if twice:
        raise ArgumentError(f"'{twice[0]}' is both a parameter and an option; give it once")
    if measure is not None and not callable(measure):
        raise ArgumentTypeError("measure must be a function of the sim and its result; found "
                                f"{measure!r}")
    interval = _arrays.number("checkpoint_interval", checkpoint_interval)
    if not 0 <= interval < math.inf:
        raise ArgumentError(f"checkpoint_interval must be a finite number >= 0; found {interval}")
    text = _text_of(scene)
    if isinstance(text, str):
        tree = json.loads(text)
        for name, value in samples[0].items():
            if not _sweep_run.is_option(name):
                _check_path(tree, name, value)
    source = "" if measure is None else _source(measure)
    return Job(text, options, measure, source, _made_folder(folder), interval)


def _source(function: Callable[..., object]) -> str:
    """The text of a function, or, without one, its name."""
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return getattr(function, "__qualname__", type(function).__qualname__)


def _made_folder(folder: Path | None) -> str | None:
    if folder is None:
        return None
    path = os.path.abspath(_arrays.path(folder))
    try:
        os.makedirs(path, exist_ok=True)
    except OSError as error:
        raise FileError(f"folder {path} cannot be made: {error.strerror}") from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise FileError(f"folder {path} is not writable")
    return path


def _workers(client: object, workers: int | None, runs: int) -> int:
    if workers is None:
        return min(runs, len(os.sched_getaffinity(0)))
    if client is not None:
        raise ArgumentError("workers is for processes of this machine; those of a client are its own")
    return min(runs, _arrays.count("workers", workers, 1))


# -- runs -----------------------------------------------------------------------------------------

def _refuse_import_by_worker(client: object) -> None:
    """Processes of this machine import the script that starts them."""
    if client is None and getattr(multiprocessing.current_process(), "_inheriting", False):
        raise RuntimeError("sweep() starts processes that import this script: put the call below "
                           "`if __name__ == \"__main__\":`")


@contextmanager
def _connected(distributed: Any, client: object, workers: int) -> Iterator[Any]:
    """The client; one that is made here is closed in the end."""
    if isinstance(client, distributed.Client):
        yield client
    elif client is None:
        with _local_cluster(distributed, workers) as cluster, \
                distributed.Client(cluster, set_as_default=False) as own:
            yield own
    elif isinstance(client, str):
        try:
            own = distributed.Client(client, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ArgumentError(f"no scheduler of Dask answers at {client}: {error}") from error
        with own:
            yield own
    else:
        raise ArgumentTypeError("client must be a Client of dask.distributed or the address of its "
                                f"scheduler; found {type(client).__name__}")


def _local_cluster(distributed: Any, workers: int) -> Any:
    """Processes of one thread each; a run whose worker dies is not tried on three others."""
    from dask import config
    with config.set({"distributed.scheduler.allowed-failures": 0}):
        return distributed.LocalCluster(n_workers=workers, threads_per_worker=1, processes=True,
                                        dashboard_address=":0", silence_logs=logging.CRITICAL)


def _rows(distributed: Any, connection: Any, job: Job, samples: list[Sample],
          progress: bool) -> list[Row]:
    from cloudpickle import dumps, loads
    try:
        pickled = dumps(job)
    except Exception as error: # of any kind, by the object that cannot be pickled
        raise ArgumentTypeError("scene and measure must be functions that can be pickled: "
                                f"{error}") from error
    shared = connection.submit(loads, pickled, pure=False)

    def submitted(sample: Sample) -> Any:
        return connection.submit(_sweep_run.run, shared, sample, pure=False)

    futures = [submitted(sample) for sample in samples]
    place = {future.key: i for i, future in enumerate(futures)}
    rows = [EMPTY] * len(samples)
    try:
        done = distributed.as_completed(futures, loop=connection.loop)
        for future in _counted(done, len(futures), progress):
            rows[place[future.key]] = _row(future) # at once: it is lost if its worker dies later
            futures[place[future.key]] = None
        # a worker that dies takes along the runs that wait there: alone, they do not fail
        for i in [i for i, row in enumerate(rows) if row["status"] == "KilledWorker"]:
            futures[i] = submitted(samples[i])
            rows[i] = _row(futures[i])
    finally:
        connection.cancel([future for future in futures if future and not future.done()])
    return rows


def _row(future: Any) -> Row:
    try:
        row: Row = future.result()
    except Exception as error: # run() raises none: of Dask, or of a worker without msim
        row = _sweep_run.row_of_error(error)
    return row


def _counted(done: Iterator[Any], total: int, progress: bool) -> Iterable[Any]:
    if not progress:
        return done
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise ImportError("a progress bar needs tqdm: pip install tqdm") from error
    bar: Iterable[Any] = tqdm(done, total=total, unit="run")
    return bar


# -- the table ------------------------------------------------------------------------------------

def _label(value: object) -> Any:
    """A value as an entry of an index, which must be hashable."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return tuple(map(_label, value))
    return json.dumps(value, default=_jsonable) if isinstance(value, Mapping) else value


def _table(pandas: Any, samples: list[Sample], rows: list[Row]) -> Any:
    names = list(samples[0])
    labels = [[_label(sample[name]) for sample in samples] for name in names]
    if len(names) == 1:
        index = pandas.Index(labels[0], name=names[0], tupleize_cols=False)
    else:
        index = pandas.MultiIndex.from_arrays(labels, names=names)
    columns = list(EMPTY) + list(dict.fromkeys(name for row in rows for name in row
                                               if name not in EMPTY))
    return pandas.DataFrame(rows, index=index, columns=columns)
