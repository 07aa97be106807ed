"""Sweeps: a grid of runs, and the table of their results."""

from __future__ import annotations

import json
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
from pathlib import Path
from typing import Any

import numpy as np

from . import _native
from ._command import run_command
from ._progress import Progress
from ._run import Run, _value
from ._table import Kind, Table, column, read_csv
from .errors import CommandError, ConfigError

Rows = list[list[int | float | str | None]]

# where a sweep would be that has no file
_MADE = "sweep.toml"

# how long the work of one task of an executor is to take (s): long beside what it costs to send
_TASK_S = 1.0

# tasks of one point, by which it is found out how long a point takes, and the least number of those that follow
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
    jobs: int | None = None,
    executor: Executor | None = None,
    out: str | os.PathLike[str] | None = None,
    record: bool = False,
    force: bool = False,
    progress: bool | None = None,
) -> Table:
    """Simulates a grid of runs and makes a table of their results: a row for each, its parameters first.

    The rows are the same bits wherever they are computed, and those of ``beadline sweep``. A run that fails has a row, too,
    of which the column ``error`` says why.

    Args:
        run: What the runs have in common; or the path of a sweep file, which has everything up to ``split``. Frames are analysed
            every tenth of the collision time, or as often as the run is published if that is not every step.
        grid: Values by the keys of a configuration, ``{"chain.alpha": [1.5, 2]}``; the last key varies fastest. A range
            ``{"from": 1, "to": 2, "count": 5, "spacing": "log"}`` is one of a sweep file.
        cases: Keys that are set together; every case is combined with the whole grid.
        until: ``"end"``; ``"stationary"`` ends a run when its reflected energy does not change any more.
        check: Adds columns of when each run stops being determined; takes four times as long.
        split: The bead between reflected and transmitted energy; by default the first impurity that is not the striker, else
            the middle bead.
        jobs: Runs that are computed at the same time; by default one for each core.
        executor: Computes the runs instead of threads of this process: any of :mod:`concurrent.futures`, or what is like it. If
            it is interrupted, tasks that run already finish.
        out: A directory for the results, as of ``beadline sweep``: rows that are there are not computed again.
        record: Record each run there.
        force: Remove what another sweep has left there.
        progress: Whether to show how many are done; by default in terminals and notebooks.

    Raises:
        ConfigError: If a run cannot be; none was begun then.
    """
    settings = {"until": until, "check": check, "split_bead": split, "case": list(cases), "grid": grid or {}}
    if isinstance(run, Run):
        text, path = _text(run, settings), _MADE
    elif settings == {"until": "end", "check": False, "split_bead": None, "case": [], "grid": {}}:
        text, path = Path(run).read_text(encoding="utf-8"), os.path.abspath(run)
    else:
        raise ValueError("the sweep file says what to sweep; found values beside it")
    try:
        native = _read(text, path)
    except ConfigError as error:
        if path == _MADE:
            # nobody has seen its lines
            error.path = error.line = None
            error.args = (re.sub(rf"^{_MADE}:\d+: ", "", str(error)),)
        raise
    if out is not None and executor is None:
        table = _in_directory(text, path, native, out, jobs, record, force)
    elif out is not None or record or native.record:
        raise ValueError("recordings, and a directory `out` for them, are of a sweep without an executor")
    else:
        with Progress(native.point_count, "sweep", progress, "points") as bar:
            if executor is None:
                rows = native.rows(range(native.point_count), jobs=jobs, on_progress=bar.update)
            else:
                rows = _rows_of(executor, text, path, native.point_count, bar.update)
        cells = zip(*rows, strict=True)
        table = Table({n: column(each, kind) for (n, kind), each in zip(native.columns, cells, strict=True)})
        table.summary = {"points": len(table), "failed": np.flatnonzero(table["error"]).tolist()}
    if table.summary["failed"]:
        what = f"{len(table.summary['failed'])} of {len(table)} runs failed; the column `error` says why"
        warnings.warn(what, RuntimeWarning, stacklevel=2)
    return table


def _text(run: Run, settings: Mapping[str, Any]) -> str:
    """A sweep file."""
    base = tomllib.loads(run.to_toml())
    base.pop("name", None)
    published = base.pop("stream", {}).get("publish_every_steps", 1)
    if published != 1:
        base["stream"] = {"publish_every_steps": published}

    def entries(table: Mapping[str, Any]) -> list[str]:
        return [f"{json.dumps(key)} = {_value(value)}" for key, value in table.items()]

    plain = {key: settings[key] for key in ("until", "check", "split_bead") if settings[key] is not None}
    lines = [*entries({**plain, "base": base}), "[grid]", *entries(settings["grid"])]
    for case in settings["case"]:
        lines += ["[[case]]", *entries(case)]
    return "\n".join(lines) + "\n"


@lru_cache(maxsize=2)
def _read(text: str, path: str) -> _native.Sweep:
    # every process of an executor reads it once
    return _native.Sweep.from_toml(text, path)


def _rows(text: str, path: str, indices: Sequence[int]) -> tuple[float, Rows]:
    """The rows of points, and how long they took (s): a task of an executor."""
    native = _read(text, path)
    begin_s = time.monotonic()
    rows = native.rows(indices, jobs=1)
    return time.monotonic() - begin_s, rows


def _rows_of(executor: Executor, text: str, path: str, count: int, tell: Callable[[int], object]) -> Rows:
    tasks: list[Future[tuple[float, Rows]]] = []

    def submit(begin: int, size: int) -> None:
        tasks.append(executor.submit(_rows, text, path, range(begin, min(begin + size, count))))

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
    """What the command makes of a sweep in the directory ``out``."""
    flags = [f"--out={os.fspath(out)}", "--yes", *(["--record"] if record else []), *(["--force"] if force else [])]
    flags += [] if jobs is None else [f"--jobs={jobs}"]
    with tempfile.TemporaryDirectory(prefix="beadline-") as directory:
        if path == _MADE:
            path = os.path.join(directory, "sweep.toml")
            Path(path).write_text(text, encoding="utf-8")
        summary = run_command(["sweep", path, *flags], warn=False)
    if summary["results"] is None:
        error = CommandError(f"{summary['missing']} runs have no row; the same call goes on with them")
        error.exit_code = 3
        raise error
    kinds: dict[str, Kind] = {"index": "integer", **dict(native.columns)}
    table = read_csv(Path(out) / "results.csv", summary, kinds)
    del table.columns["index"]
    return table
