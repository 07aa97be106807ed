"""Tables of results, and what the command's analyses, proofs and pages make of a recording."""

from __future__ import annotations

import csv
import html
import math
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from ._command import Json, run_command
from .errors import CommandError

if TYPE_CHECKING:
    from ._recording import Recording

Column = npt.NDArray[Any]
Kind = Literal["integer", "double", "word"]
Rows = slice | Sequence[int] | npt.NDArray[np.bool_] | npt.NDArray[np.integer[Any]]

# rows that a table shows of itself at most, and of a longer one at its begin and at its end
_ALL_SHOWN, _SHOWN = 30, 5


class Table:
    """Named columns of one length.

    ``table["total_j"]`` is a column, ``table[:100]`` and ``table[table["time_s"] > 0.01]`` are tables of
    some of the rows, and ``len(table)`` is their number. Whole numbers are int64; where one is missing
    the column is of doubles. A missing number is NaN, a missing word ``""``.

    Attributes:
        columns: The columns by name.
        summary: What the command prints about all of it with ``--json``, if anything.
    """

    columns: dict[str, Column]
    summary: Json

    def __init__(self, columns: Mapping[str, Column], summary: Json | None = None) -> None:
        self.columns = dict(columns)
        self.summary = summary or {}
        if len(set(map(len, self.columns.values()))) > 1:
            raise ValueError("the columns of a table have one length")

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def keys(self) -> Iterable[str]:
        """The names of the columns."""
        return self.columns.keys()

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    @overload
    def __getitem__(self, key: str) -> Column: ...
    @overload
    def __getitem__(self, key: Rows) -> Table: ...
    def __getitem__(self, key: str | Rows) -> Column | Table:
        if isinstance(key, str):
            try:
                return self.columns[key]
            except KeyError:
                raise KeyError(f"there is no column {key!r}; there are: {', '.join(self)}") from None
        if not isinstance(key, slice) and np.ndim(key) == 0:
            raise TypeError(f"found table[{key}]; expected the name of a column, a slice, a mask or a list")
        return Table({name: column[key] for name, column in self.columns.items()}, self.summary)

    def to_pandas(self) -> Any:
        """As a DataFrame of pandas."""
        from ._extras import need

        return need("pandas").DataFrame(self.columns)

    def to_polars(self) -> Any:
        """As a DataFrame of Polars."""
        from ._extras import need

        return need("polars").DataFrame(self.columns)

    def to_arrow(self) -> Any:
        """As a table of Apache Arrow."""
        from ._extras import need

        return need("pyarrow").table(self.columns)

    def to_numpy(self) -> npt.NDArray[np.void]:
        """As a structured array, a field for each column."""
        rows = np.empty(len(self), [(name, column.dtype) for name, column in self.columns.items()])
        for name, column in self.columns.items():
            rows[name] = column
        return rows

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self)} rows: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        def row(tag: str, cells: Iterable[object]) -> str:
            written = (f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in cells)
            return f"<tr>{''.join(written)}</tr>"

        def values(index: int) -> list[object]:
            found = (column[index] for column in self.columns.values())
            return [index, *(f"{cell:.6g}" if isinstance(cell, float) else cell for cell in found)]

        count = len(self)
        shown = [range(_SHOWN), range(count - _SHOWN, count)]
        if count <= _ALL_SHOWN:
            shown = [range(count)]
        between = row("td", ["…"] * (1 + len(self.columns)))
        body = between.join("".join(row("td", values(index)) for index in part) for part in shown)
        return f"<table style='white-space:nowrap'>{row('th', ['', *self])}{body}</table><p>{count:,} rows</p>"


class Motion(Table):
    """The motion of beads in each frame.

    Attributes:
        events: Contacts that close or open, and turning points: ``time_s``, ``bead``, ``event``, ``u_m``.
    """

    def __init__(self, motion: Table, events: Table) -> None:
        super().__init__(motion.columns, motion.summary)
        self.events = events


class Pulses(Table):
    """The pulses, in the order in which they end.

    Attributes:
        positions: Their tracks, a row for each bead that a pulse passes: ``pulse``, ``bead``,
            ``time_s``, ``v_peak_m_s``, ….
    """

    def __init__(self, pulses: Table, positions: Table) -> None:
        super().__init__(pulses.columns, pulses.summary)
        self.positions = positions


class Forces(Table):
    """Forces at places in each frame.

    Attributes:
        peaks: Their peaks: ``place``, ``time_s``, ``force_n`` above that at rest, ``width_s``, ``above_s``.
    """

    def __init__(self, forces: Table, peaks: Table) -> None:
        super().__init__(forces.columns, forces.summary)
        self.peaks = peaks


@dataclass(frozen=True)
class Verdict:
    """Whether a recording is proven; true if so.

    Attributes:
        verdict: What was found, in words.
        report: The JSON of ``beadline verify``: what was proven, compared, damaged or different.
    """

    verdict: str
    report: Json

    @property
    def is_proven(self) -> bool:
        """Whether every state is what the one before leads to, and nothing is missing or damaged."""
        return bool(self.report["proven"])

    def __bool__(self) -> bool:
        return self.is_proven

    def __repr__(self) -> str:
        return f"<Verdict: {self.verdict}>"


def energies(
    rec: Recording,
    *,
    split: int | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Table:
    """The energies (J) of each frame: kinetic, potential, total, and left of a bead, in it and right of it.

    Args:
        split: The bead; by default the first impurity that is not the striker, else the middle bead.
        from_s, until_s: The first and the last simulated time (s) that is looked at.
        every_step: Also steps between recorded states, which are recomputed.
        jobs: Threads that recompute them; by default one for each core.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return analyse(rec, "energies", split=split, **part)[0]


def impurity(
    rec: Recording,
    *,
    bead: int | Sequence[int] | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Motion:
    """The motion of beads in each frame: displacements (m), velocities (m/s), and overlaps of their contacts (m).

    Args:
        bead: A bead, or several; by default the impurities.
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return Motion(*analyse(rec, "impurity", "events", bead=bead, **part))


def contacts(
    rec: Recording,
    *,
    tolerance_m: float | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Table:
    """How many contacts are compressed, touching and open in each frame.

    Args:
        tolerance_m: The overlap or gap (m) up to which a contact is touching; by default 1e-6 of the
            collision length.
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return analyse(rec, "contacts", tolerance_m=tolerance_m, **part)[0]


def pulses(
    rec: Recording,
    *,
    threshold: float | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Pulses:
    """The pulses: where each came from and ended, how strong, fast and wide it is; and their tracks.

    Args:
        threshold: The smallest peak velocity of a pulse, over that of the striker; by default 0.001.
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return Pulses(*analyse(rec, "pulses", "positions", threshold=threshold, **part))


def deformation(
    rec: Recording,
    contact: int | Sequence[int],
    *,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Table:
    """The overlap (m) of contacts while the first pulse passes, beside those of the exact wave and of
    the continuum.

    Args:
        contact: A contact, or several.
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return analyse(rec, "deformation", contact=contact, **part)[0]


def spreading(
    rec: Recording,
    *,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Table:
    """How far the energy has spread in each frame: its centre, its second moment about it, and the participation number, which is
    how many beads share it.

    Args:
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return analyse(rec, "spreading", **part)[0]


def forces(
    rec: Recording,
    at: str | Sequence[str],
    *,
    threshold_n: float | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Forces:
    """Forces (N) in each frame as sensors at places see them, and their peaks.

    Args:
        at: A place, or several: ``"bead:20"``, ``"contact:7"``, ``"wall:left"``, ``"wall:right"``. A bead has the mean of the forces
            on its two sides.
        threshold_n: Least height of a peak (N) above the force at rest; by default 0.01 of the run's force scale.
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return Forces(*analyse(rec, "forces", "peaks", at=at, threshold_n=threshold_n, **part))


def spectrum(
    rec: Recording,
    at: str | Sequence[str] = (),
    *,
    of: Literal["velocity", "force", "displacement"] = "velocity",
    transmission: Sequence[tuple[str, str]] = (),
    spectrogram: bool = False,
    map: bool = False,
    beads: slice | None = None,
    segment: int | None = None,
    window: Literal["hann", "none"] | None = None,
    max_frequency_hz: float | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Table:
    """The frequencies of waves: densities at places (of m/s: m²/s²/Hz), one-sided, by Welch's method.

    Args:
        at: A place, or several, as for :meth:`forces`.
        of: The quantity.
        transmission: Pairs of places: gain, phase (rad) and coherence of how the second follows the first.
        spectrogram: The spectrum of one place over time.
        map: Or that of all beads over frequency and wavenumber (rad per bead).
        beads: Only these beads in the map: ``slice(10, 90)``.
        segment: Samples in a segment, even: more resolve more, fewer average more.
        window: How they are weighted: ``"hann"``, the default, for motion that lasts, ``"none"`` for a pulse that has come and gone.
        max_frequency_hz: Highest frequency (Hz) of a spectrogram or map.
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    of_map = {"map": map, "beads": None if beads is None else f"{beads.start}..{beads.stop}"}
    how = {"of": of, "segment": segment, "window": window, "max_frequency_hz": max_frequency_hz}
    pairs = [",".join(pair) for pair in transmission]
    return analyse(rec, "spectrum", at=at, transmission=pairs, spectrogram=spectrogram, **of_map, **how, **part)[0]


def modes(
    rec: Recording,
    *,
    shapes: bool = False,
    energy: bool = False,
    mode: int | Sequence[int] | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    every_step: bool = False,
    jobs: int | None = None,
) -> Table:
    """The linear modes of a chain that is pressed together, by ascending frequency: ``frequency_hz``, ``participation_beads``, ….

    Args:
        shapes: Their shapes instead, a column for each.
        energy: Or the energy (J) in each of them in each frame.
        mode: Of shapes and energies: a mode, or several, from 1; by default the lowest 4 and 8.
        from_s, until_s, every_step, jobs: As for :meth:`energies`.
    """
    part = {"from_s": from_s, "until_s": until_s, "every_step": every_step, "jobs": jobs}
    return analyse(rec, "modes", shapes=shapes, energy=energy, mode=mode, **part)[0]


def analyse(rec: Recording, name: str, *tables: str, **options: object) -> list[Table]:
    """What the command's analysis ``name`` makes of a recording: its table, and those of flags ``tables``.

    Names of ``options`` are those of flags, followed by units.
    """
    flags: list[str] = []
    for key, value in options.items():
        flag = "--" + re.sub("_(s|m|n|hz)$", "", key).replace("_", "-")
        if value is True:
            flags.append(flag)
        elif value is not None and value is not False:
            # numbers are written in the shortest form that reads back to their bits
            flags += [f"{flag}={one}" for one in np.atleast_1d(np.asarray(value)).tolist()]
    with rec._file() as file, tempfile.TemporaryDirectory(prefix="beadline-") as directory:
        paths = {table: os.path.join(directory, f"{table}.csv") for table in ("out", *tables)}
        outputs = [f"--{table}={path}" for table, path in paths.items()]
        summary = run_command([name, file, *flags, *outputs], path=file)
        return [read_csv(path, summary) for path in paths.values()]


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
    """Makes one HTML file of a recording that anyone can open, with every step in it. Says what is in it:
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
    flags = ["--force"] if force else []
    flags += [] if every is None else [f"--every-steps={every}"]
    with rec._file() as file:
        try:
            return run_command(["share", file, f"--out={page}", *flags], path=file)
        except CommandError as error:
            if error.exit_code == 2 and page.exists() and not force:
                raise FileExistsError(str(error)) from error
            raise


def read_csv(
    path: str | os.PathLike[str],
    summary: Json | None = None,
    kinds: Mapping[str, Kind] | None = None,
) -> Table:
    """A table that the command has written, of ``kinds`` of columns, or of those that it looks like."""
    with open(path, newline="", encoding="utf-8") as file:
        names, *rows = csv.reader(file)
    columns = zip(*rows, strict=True) if rows else [()] * len(names)
    found = dict(zip(names, columns, strict=True))
    kinds = kinds or {name: _kind(cells) for name, cells in found.items()}
    return Table({name: column(cells, kinds[name]) for name, cells in found.items()}, summary)


def column(cells: Sequence[Any], kind: Kind) -> Column:
    """A column of values, or of their texts; ``None`` and empty texts do not exist."""
    if kind == "word":
        return np.array(["" if cell is None else cell for cell in cells], dtype=np.str_)
    if None in cells or "" in cells:
        return np.array([math.nan if cell is None or cell == "" else float(cell) for cell in cells])
    if kind == "integer":
        return np.array(list(map(int, cells)), dtype=np.int64)
    return np.array(list(map(float, cells)), dtype=np.float64)


def _kind(cells: Sequence[str]) -> Kind:
    # doubles are written with an exponent
    first = next(filter(None, cells), "nan")
    if first.isdigit():
        return "integer"
    try:
        float(first)
    except ValueError:
        return "word"
    return "double"
