"""Sweeps: a grid of runs, and the table of their results."""

from __future__ import annotations

import contextlib
import math
import os
import re
import tempfile
import time
import tomllib
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from functools import lru_cache
from itertools import takewhile
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from . import _native
from ._command import run_command
from ._live import own_names
from ._numbers import count, in_si
from ._progress import Progress
from ._run import Run, _value, rooted
from ._table import Kind, Table, column, read_csv
from .errors import CommandError, ConfigError

Rows = list[list[int | float | str | None]]

# where a sweep would be that has no file
_MADE = "sweep.toml"

# how long the work of one task of an executor is to take (s): long beside what it costs to send
_TASK_S = 1.0

# tasks of one point, the first of which tells how long a point takes, and the least number of those
# that follow
_FIRST_TASKS = 8
_TASKS = 64


def sweep(
    run: Run | str | os.PathLike[str],
    grid: Mapping[str, Any] | None = None,
    *,
    cases: Sequence[Mapping[str, Any]] = (),
    until: str = "end",
    check: bool = False,
    split: int | None = None,
    measure: Sequence[str] = (),
    jobs: int | None = None,
    executor: Executor | None = None,
    out: str | os.PathLike[str] | None = None,
    record: bool = False,
    force: bool = False,
    progress: bool | None = None,
) -> Table:
    """Simulates a grid of runs and makes a table of their results: a row for each, its parameters first.

    The rows are those of ``beadline sweep``, with the same bits wherever they are computed. A run that
    fails has a row, too; its column ``error`` has the reason.

    Args:
        run: The base of all runs; or the path of a sweep file, which has everything up to
            ``split``. Frames are analysed every tenth of the collision time, or as often as the run is
            published if that is not every step.
        grid: Values by the keys of a configuration, ``{"chain.alpha": [1.5, 2]}``; the last key varies
            fastest. Or ranges as of a sweep file: ``{"from": 1, "to": 2, "count": 5, "spacing": "log"}``.
        cases: Keys that are set together; every case is combined with the whole grid.
        until: ``"end"``; ``"stationary"`` ends a run when its reflected energy no longer changes.
        check: Adds columns with the time until which each run is determined; takes ten to twenty times as long.
        split: The bead that divides reflected from transmitted energy; by default the first impurity
            that is not the striker, else the middle bead.
        measure: Numbers of any analysis as further columns: ``["forces.peak_n@right", "modes.last_j@1"]``. ``beadline analyses``
            lists them; those of :func:`analysis` are known to this process, and to processes that import where it is made, not with ``out``.
        jobs: Runs that are computed at the same time; by default one for each core.
        executor: Computes the runs instead of threads of this process: one of
            :mod:`concurrent.futures`, or of Dask, MPI or Parsl. Tasks that have begun end by themselves
            after Ctrl-C.
        out: A directory for the results, as of ``beadline sweep``: rows that it has are not computed again. Columns over time, which a
            sweep file asks for with ``[series]``, are in its ``series.csv`` alone.
        record: Record each run there.
        force: Remove the files of another sweep there.
        progress: Show the number of finished runs; by default in terminals and notebooks.

    Raises:
        ConfigError: If a run is impossible; no run has begun then.
    """
    jobs = None if jobs is None else count("jobs", jobs)
    is_list = np.iterable(cases) and not isinstance(cases, str | Mapping)
    each = list(cases) if is_list else []
    if not is_list or not all(hasattr(case, "items") for case in each):
        raise TypeError(f"cases: found {cases!r}; expected a list of dictionaries, such as [{{'chain.alpha': 1.5}}]")
    if executor is not None and not hasattr(executor, "submit"):
        raise TypeError(f"executor: found {executor!r}; expected an executor as of concurrent.futures, which has a method submit")
    settings: dict[str, Any] = {"until": until, "check": check, "split_bead": split, "measure": list(measure) or None}
    settings |= {"case": each, "grid": dict(grid or {})}
    if isinstance(run, Run):
        text, path = _text(run, settings), _MADE
    elif not isinstance(run, str | os.PathLike):
        wanted = "a beadline.Run, or the path of a sweep file; Run.from_recording(rec) is the run of a recording"
        raise TypeError(f"run: found {run!r}; expected {wanted}")
    elif (until, check, split) == ("end", False, None) and not each and not grid and not measure:
        text, path = Path(run).read_text(encoding="utf-8"), os.path.abspath(run)
    else:
        raise ValueError("the sweep file says what to sweep; found values beside it")
    try:
        native = _native.Sweep.from_toml(text, path)
    except ConfigError as error:
        if path == _MADE:
            # nobody has seen its lines
            error.path = error.line = None
            error.key = {"split_bead": "split"}.get(error.key or "", error.key)
            error.args = (re.sub(rf"^{_MADE}(:\d+)?: ", "", str(error)).replace("split_bead:", "split:"),)
        raise
    if out is not None and executor is None:
        table = _in_directory(text, path, native, out, jobs, record, force)
    elif out is not None or record or native.record:
        raise ValueError("a sweep records into a directory `out`, which is without an executor")
    else:
        with Progress(native.point_count, "sweep", progress, "points") as bar:
            if executor is None:
                rows = native.rows(range(native.point_count), jobs=jobs, on_progress=bar.update)
            else:
                rows = _rows_of(executor, text, path, native.point_count, bar.update)
        # those of [series] are last, and in a table of their own
        cells = zip(native.columns, zip(*rows, strict=True), strict=True)
        kept = takewhile(lambda one: one[0][0] != "time_s[0]", cells)
        table = Table({name: column(values, kind) for (name, kind), values in kept})
        table.summary = {"points": len(table)}
    table.summary["failed"] = np.flatnonzero(table["error"]).tolist()
    if table.summary["failed"]:
        failed = f"{len(table.summary['failed'])} of {len(table)} runs failed"
        warnings.warn(f"{failed}; the column `error` says why", RuntimeWarning, stacklevel=2)
    return table


def _text(run: Run, settings: Mapping[str, Any]) -> str:
    """A sweep file."""
    base = rooted(run._folder, "base", tomllib.loads(run.to_toml()))
    base.pop("name", None)
    published = base.pop("stream", {}).get("publish_every_steps", 1)
    if published != 1:
        base["stream"] = {"publish_every_steps": published}

    def entries(table: Mapping[str, Any]) -> list[str]:
        return [f"{_value(key)} = {_value(value, key)}" for key, value in table.items()]

    names = ("until", "check", "split_bead", "measure")
    plain = {key: settings[key] for key in names if settings[key] is not None}
    grid = {key: rooted(run._folder, key, _listed(key, values)) for key, values in settings["grid"].items()}
    lines = [*entries({**plain, "base": base}), "[grid]", *entries(grid)]
    for case in settings["case"]:
        lines += ["[[case]]", *entries(rooted(run._folder, "case", in_si("", case)))]
    return "\n".join(lines) + "\n"


def _listed(key: str, values: Any) -> Any:
    """Values of any sequence, such as a range or a Series, as a list; anything else as it is."""
    values = in_si(key, values)
    is_one = not np.iterable(values) or issubclass(type(values), str | Mapping)
    return values if is_one else list(values)


@lru_cache(maxsize=2)
def _read(text: str, path: str, sweep: str) -> _native.Sweep:
    # once in each process; the next sweep reads it again: the file that it names may be another then
    return _native.Sweep.from_toml(text, path)


def _rows(source: tuple[str, str, str], indices: Sequence[int]) -> tuple[float, Rows]:
    """The rows of points, and how long they took (s): a task of an executor."""
    native = _read(*source)
    begin_s = time.monotonic()
    rows = native.rows(indices, jobs=1)
    return time.monotonic() - begin_s, rows


def _rows_of(
    executor: Executor, text: str, path: str, count: int, tell: Callable[[int], object]
) -> Rows:
    """The rows of all points, computed by an executor."""
    source = text, path, uuid4().hex
    tasks: list[Future[tuple[float, Rows]]] = []

    def submit(begin: int, size: int) -> None:
        tasks.append(executor.submit(_rows, source, range(begin, min(begin + size, count))))

    rows: Rows = []
    try:
        first = min(_FIRST_TASKS, count)
        for index in range(first):
            submit(index, 1)
        point_s, _ = tasks[0].result()
        size = max(1, min(int(_TASK_S / max(point_s, 1e-6)), math.ceil((count - first) / _TASKS)))
        for begin in range(first, count, size):
            submit(begin, size)
        for task in tasks:
            rows += task.result()[1]
            tell(len(rows))
    except BaseException:
        for task in tasks:
            # Parsl cannot
            with contextlib.suppress(NotImplementedError):
                task.cancel()
        raise
    return rows


def _in_directory(
    text: str,
    path: str,
    native: _native.Sweep,
    out: str | os.PathLike[str],
    jobs: int | None,
    record: bool,
    force: bool,
) -> Table:
    """The command's results of a sweep in the directory ``out``."""
    names = [name for name, _ in native.columns]
    own = [name for name in names[names.index("error") :] if name.partition(".")[0] in own_names]
    if own:
        found = f"{own[0]}: found an analysis of this process beside out, which another process writes"
        raise ValueError(f"{found}; expected analyses that `beadline analyses` lists; without out, table.to_csv(path) keeps the rows")
    flags = [f"--out={os.fspath(out)}", "--yes"]
    flags += [flag for flag, is_set in (("--record", record), ("--force", force)) if is_set]
    flags += [] if jobs is None else [f"--jobs={jobs}"]
    with tempfile.TemporaryDirectory(prefix="beadline-") as directory:
        if path == _MADE:
            path = os.path.join(directory, "sweep.toml")
            Path(path).write_text(text, encoding="utf-8")
        summary = run_command(["sweep", path, *flags], warn=False)
    # it names the first ones only
    del summary["sweep"], summary["failed_count"]
    if summary["results"] is None:
        error = CommandError(f"{summary['missing']} runs have no row; call it again for them")
        error.exit_code = 3
        raise error
    kinds: dict[str, Kind] = {"index": "integer", **dict(native.columns)}
    table = read_csv(Path(out) / "results.csv", summary, kinds)
    del table["index"]
    return table
