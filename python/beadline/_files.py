"""Products of the command from a recording: proofs, other files, pages."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import weakref
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from ._command import PROGRAM, Json, failure, run_command
from ._extras import need
from ._numbers import count, in_si
from ._table import Table, range_of, read_csv

if TYPE_CHECKING:
    from xarray import Dataset

    from ._recording import Recording
    from ._widget import Widget

# how long a page may take to end (s)
_PATIENCE_S = 5.0


@dataclass(frozen=True)
class Verdict:
    """A verdict on a recording; true if it is proven.

    Attributes:
        verdict: The verdict in words.
        report: The JSON of ``beadline verify``: proven, compared, damaged and different contents.
    """

    verdict: str
    report: Json

    @property
    def is_proven(self) -> bool:
        """True if every state follows from the one before, and nothing is missing or damaged."""
        return bool(self.report["proven"])

    def __bool__(self) -> bool:
        return self.is_proven

    def __repr__(self) -> str:
        return f"<Verdict: {self.verdict}>"


def verify(rec: Recording, *, jobs: int | None = None) -> Verdict:
    """Proves a recording: makes every state again from the one before, and compares the bits.

    Args:
        jobs: Threads; by default one for each core.
    """
    with rec._file() as file:
        flags = [] if jobs is None else [f"--jobs={jobs}"]
        report = run_command(["verify", file, *flags], path=file, warn=False)
    return Verdict(report["verdict"], report)


def share(
    rec: Recording,
    path: str | os.PathLike[str] | None = None,
    *,
    every: int | None = None,
    force: bool = False,
) -> Json:
    """Makes one HTML file of a recording that anyone can open, with every step in it. Returns its contents:
    ``path``, ``bytes``, ``steps``, ….

    Args:
        path: The page; by default it is named after the recording.
        every: Steps between two that it carries; it recomputes the others. By default as many as 2 MB hold.
        force: Replace a file that exists, and make pages of more than 200 MB.

    Raises:
        FileExistsError: If there is such a file.
    """
    own = rec.path or rec.name
    own = os.path.basename(own) if "://" in own else own
    page = Path(path if path is not None else Path(own).with_suffix(".html"))
    return _make(rec, "share", page, force, {"every-steps": None if every is None else count("every", every)})


def export(
    rec: Recording,
    path: str | os.PathLike[str],
    *,
    to: str | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    beads: slice | None = None,
    every: int | None = None,
    every_step: bool = False,
    clouds: int | None = None,
    jobs: int | None = None,
    force: bool = False,
) -> Json:
    """Writes the states in another format. Returns a summary: ``paths``, ``states``, ….

    Args:
        path: The file.
        to: ``"npz"``, ``"csv"``, ``"parquet"`` or ``"foxglove"``; by default the one that the name of the file ends with.
        from_s, until_s: The first and the last simulated time (s).
        beads: Only these beads: ``slice(100, 200)``.
        every: Only each of so many steps; those that were not kept are recomputed.
        every_step: Or every step.
        clouds: Point clouds of the chain, only with ``to="foxglove"``; by default 300.
        jobs: Threads that recompute; by default one for each core.
        force: Replace a file that exists.

    Raises:
        FileExistsError: If there is such a file.
        CommandValueError: If the format is not known.
    """
    if clouds is not None and to != "foxglove":
        raise ValueError(f"clouds: found {clouds!r} for a format without point clouds; allowed: with to='foxglove'")
    part = {"from": in_si("from_s", from_s), "until": in_si("until_s", until_s), "beads": range_of("beads", beads)}
    steps = {"every-steps": None if every is None else count("every", every), "every-step": every_step}
    return _make(rec, "export", path, force, {"to": to, **part, **steps, "clouds": clouds, "jobs": jobs})


def to_hdf5(
    rec: Recording,
    path: str | os.PathLike[str],
    *,
    from_s: float | None = None,
    until_s: float | None = None,
    beads: slice | None = None,
    every: int | None = None,
    force: bool = False,
) -> None:
    """Writes the states as HDF5 in the layout of H5MD, some megabytes at a time.

    Args:
        path: The file.
        from_s, until_s: The first and the last simulated time (s).
        beads: Only these neighbours: ``slice(100, 200)``.
        every: Only each of so many steps; by default the recorded ones.
        force: Replace a file that exists.

    Raises:
        FileExistsError: If there is such a file.
        ValueError: If no state or no bead is there.
    """
    from ._hdf5 import write

    steps = rec._steps_during("from_s, until_s", from_s, until_s, every)
    write(rec, path, steps, _neighbours(rec, beads), force)


def _neighbours(rec: Recording, beads: slice | None) -> range:
    places = range(rec.beads)[slice(None) if beads is None else beads]
    if not places or places.step != 1:
        raise ValueError(f"beads: found {beads!r}; expected neighbours of the {rec.beads} beads, such as slice(10, 90)")
    return places


def to_parquet(
    rec: Recording,
    path: str | os.PathLike[str],
    *,
    from_s: float | None = None,
    until_s: float | None = None,
    beads: slice | None = None,
    every: int | None = None,
    force: bool = False,
) -> None:
    """Writes the states as Parquet, as ``export`` does: a row for each state, and the chain in a table beside it. No package is needed.

    Args:
        path: The file.
        from_s, until_s: The first and the last simulated time (s).
        beads: Only these neighbours: ``slice(100, 200)``.
        every: Only each of so many steps; by default the recorded ones.
        force: Replace a file that exists.

    Raises:
        FileExistsError: If there is such a file.
    """
    export(rec, path, to="parquet", from_s=from_s, until_s=until_s, beads=beads, every=every, force=force)


def to_zarr(
    rec: Recording,
    path: str | os.PathLike[str],
    *,
    from_s: float | None = None,
    until_s: float | None = None,
    beads: slice | None = None,
    every: int | None = None,
    fields: Sequence[str] | None = None,
    force: bool = False,
) -> None:
    """Writes :meth:`to_xarray` as Zarr, some megabytes at a time: ``xarray.open_zarr`` reads it back.

    Args:
        path: The directory.
        from_s, until_s: The first and the last simulated time (s).
        beads: Only these neighbours, and the contacts between them: ``slice(100, 200)``.
        every, fields: As for :meth:`to_xarray`.
        force: Replace a directory of Zarr that exists.

    Raises:
        FileExistsError: If the path exists.
        ValueError: If no state or no bead is there.
    """
    steps, places = rec._steps_during("from_s, until_s", from_s, until_s, every), _neighbours(rec, beads)
    for package in ("zarr", "xarray"):
        need(package, "zarr")
    from ._xarray import dataset, write_zarr

    # all beads of a ring have a contact more: the one that closes it
    last = None if len(places) == rec.beads else places.stop - 1
    part = {"bead": slice(places.start, places.stop), "contact": slice(places.start, last)}
    write_zarr(dataset(rec, steps, fields).isel(part), path, force)


def to_xarray(rec: Recording, every: int | None = None, fields: Sequence[str] | None = None) -> Dataset:
    """A recording as a dataset of xarray, whose values are read, or computed, when they are needed.

    Args:
        every: One of so many steps; by default the recorded ones.
        fields: Names of lazy arrays of the recording, such as ``["velocity", "force"]``; by default ``velocity``, ``displacement``,
            ``overlap``, and those that only some runs have, such as ``dissipated``.

    Its dimensions are ``time`` (s), ``bead``, ``contact`` and ``drive``; ``step``, which selects as ``time`` does, ``mass_kg`` and
    ``stiffness`` are coordinates. The attribute ``manifest`` is the run as JSON; its main values are attributes, too.
    ``xarray.open_dataset("run.mcap")`` gives the same dataset.
    """
    steps = rec._steps_every(every)
    need("xarray")
    from ._xarray import dataset

    return dataset(rec, steps, fields)


def thin(
    rec: Recording, path: str | os.PathLike[str], every: int, *, jobs: int | None = None, force: bool = False
) -> Recording:
    """Writes a smaller recording of the same run, and returns it: it still has every step. The states that it leaves out are proven first.

    Args:
        path: The file, ``.mcap``.
        every: Steps between two states that it keeps.
        jobs: Threads; by default one for each core.
        force: Replace a file that exists.

    Raises:
        FileExistsError: If there is such a file.
    """
    _make(rec, "thin", mcap(path), force, {"every-steps": count("every", every), "jobs": jobs})
    return rec._opened(path)


def recover(
    rec: Recording, path: str | os.PathLike[str], *, fill: bool = True, jobs: int | None = None, force: bool = False
) -> Recording:
    """Writes a whole recording from a damaged or unfinished one, and returns it. Lost states between others are recomputed.

    A loss that cannot be recomputed is a ``RuntimeWarning``. ``summary`` of the new recording describes the work.

    Args:
        path: The file, ``.mcap``.
        fill: Recompute lost states; else they are left out.
        jobs: Threads; by default one for each core.
        force: Replace a file that exists.

    Raises:
        FileExistsError: If there is such a file.
    """
    summary = _make(rec, "recover", mcap(path), force, {"no-fill": not fill, "jobs": jobs})
    recovered = rec._opened(path)
    recovered.summary = summary
    return recovered


def check(rec: Recording, *, tolerance: float | None = None) -> Table:
    """Finds the time until which the run is determined, and the digits: a table of its errors over time, from the time step
    and from rounding, in units of L, v0 and ½·m·v0². ``summary`` has ``determined_until_s``, the digits of each quantity, ….

    Args:
        tolerance: Largest error of a determined quantity, in these units; by default 1e-4.
    """
    with rec._file() as file, tempfile.TemporaryDirectory(prefix="beadline-") as directory:
        out = os.path.join(directory, "out.csv")
        flags = [] if tolerance is None else [f"--tolerance={tolerance}"]
        summary = run_command(["check", file, *flags, f"--out={out}"], path=file)
        return read_csv(out, summary)


def mcap(path: str | os.PathLike[str]) -> Path:
    """The path of a recording that is to be made."""
    path = Path(path)
    if path.suffix != ".mcap":
        raise ValueError(f"{path}: a recording is written as .mcap")
    return path


def _make(
    rec: Recording, command: str, path: str | os.PathLike[str], force: bool, options: dict[str, str | float | bool | None]
) -> Json:
    """The output of a command that makes ``path`` from a recording."""
    flags = [f"--{flag}" for flag, value in {**options, "force": force}.items() if value is True]
    flags += [f"--{flag}={value}" for flag, value in options.items() if value is not None and not isinstance(value, bool)]
    with rec._file() as file:
        return run_command([command, file, f"--out={os.fspath(path)}", *flags], path=file)


class View:
    """A page that this machine serves, until it is closed or Python ends; also for ``with``.

    Attributes:
        url: Its address, with a random part that nobody else knows.
    """

    def __init__(self, *recs: Recording, open: bool, port: int) -> None:
        with ExitStack() as stack, tempfile.TemporaryFile() as notices:
            files = [stack.enter_context(rec._file()) for rec in recs]
            flags = [f"--port={port}", *(["--open"] if open else [])]
            process = subprocess.Popen(
                [*PROGRAM, "view", *files, *flags],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=notices,
                start_new_session=True,
            )
            stack.callback(_end, process)
            assert process.stdout is not None
            self.url = process.stdout.readline().decode().strip()
            if not self.url:
                code = process.wait()
                notices.seek(0)
                raise failure(notices.read().decode(errors="replace").strip().splitlines(), code, files[0])
            self._close = weakref.finalize(self, stack.pop_all().close)

    def close(self) -> None:
        """Ends it."""
        self._close()

    def __enter__(self) -> View:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<View at {self.url}>"

    def _repr_html_(self) -> str:
        return f'<a href="{self.url}" target="_blank">{self.url}</a>'


def _end(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGINT)
    with suppress(subprocess.TimeoutExpired):
        process.wait(_PATIENCE_S)
    process.kill()
    process.wait()
    assert process.stdout is not None
    process.stdout.close()


def view(rec: Recording, *, open: bool = True, port: int = 0) -> View:
    """Shows the recording on the page, in the browser, and goes on.

    Args:
        open: Open it in the browser; ``url`` of the result is its address.
        port: Port of the server, on this machine only; by default a free one.
    """
    return View(rec, open=open, port=count("port", port, 0))


def widget(rec: Recording, *, every: int | None = None, height_px: int = 640) -> Widget:
    """Shows the recording in a cell of a notebook, on the page that ``share`` writes, with every step in it and without a network.

    Its traits are ``step``, ``bead``, ``field`` and ``window_s``, the times in view: setting one moves the page, and a click sets
    them; ``observe`` tells. It needs anywidget, and works wherever that does: in JupyterLab, VS Code, marimo.

    Args:
        every: As for :meth:`share`.
        height_px: Its height (pixels).
    """
    need("anywidget")
    from ._widget import Widget

    with tempfile.TemporaryDirectory(prefix="beadline-") as directory:
        path = Path(directory, f"{rec.name}.html")
        share(rec, path, every=every)
        return Widget(rec, path.read_text(encoding="utf-8"), height_px)
