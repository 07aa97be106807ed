"""Tables of results, and the command's analyses of a recording."""

from __future__ import annotations

import csv
import math
import operator
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from ._command import Json, run_command
from ._new import check_free
from ._numbers import count, in_si, shown, unit_of
from .errors import CommandValueError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._recording import Recording

Column = npt.NDArray[Any]
Kind = Literal["integer", "double", "word"]
Rows = slice | Sequence[int] | npt.NDArray[np.bool_] | npt.NDArray[np.integer[Any]]


class Table(dict[str, Column]):
    """Named columns of one length: a dictionary of arrays, which pandas, Polars and pyarrow take as it is.

    ``table["total_j"]`` is a column, ``table[["time_s", "total_j"]]`` a table of some columns, ``table[:100]`` and
    ``table[table["time_s"] > 0.01]`` are tables of some rows. ``len(table)`` is the number of rows, unlike that of other
    dictionaries. Whole numbers are int64; where one is missing the column is of doubles, and so is any column that an
    analysis leaves empty, also one of words. A missing number is NaN, a missing word ``""``.

    ``pd.DataFrame(table)``, ``pl.DataFrame(table)``, ``pa.table(table)`` and ``np.asarray(table)``, which has a field for each column,
    have all columns.

    Attributes:
        summary: The summary that the command prints with ``--json``, if any.
    """

    summary: Json

    def __init__(self, columns: Mapping[str, npt.ArrayLike], summary: Json | None = None) -> None:
        super().__init__({name: np.asarray(column) for name, column in columns.items()})
        self.summary = summary or {}
        if len(set(map(len, self.values()))) > 1:
            raise ValueError("the columns of a table have one length")

    @property
    def columns(self) -> dict[str, Column]:
        """The columns by name."""
        return dict(self)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column, which its name ends with; ``""`` of numbers and words without one."""
        return {name: shown(unit_of(name) or "") for name in self}

    def __len__(self) -> int:
        return len(next(iter(self.values()), ()))

    # two tables are the same one, or not: columns are compared one by one
    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:  # type: ignore[override]
        return id(self)

    def __setitem__(self, name: str, values: npt.ArrayLike) -> None:
        column = np.asarray(values)
        if self.keys() and column.shape != (len(self),):
            raise ValueError(f"{name}: found the shape {column.shape}; expected a value for each of {len(self)} rows")
        super().__setitem__(name, column)

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    @overload
    def __getitem__(self, key: str) -> Column: ...
    @overload
    def __getitem__(self, key: list[str] | tuple[str, ...]) -> Table: ...
    @overload
    def __getitem__(self, key: Rows) -> Table: ...
    def __getitem__(self, key: str | list[str] | tuple[str, ...] | Rows) -> Column | Table:
        if isinstance(key, str):
            try:
                return super().__getitem__(key)
            except KeyError:
                raise KeyError(f"there is no column {key!r}; there are: {', '.join(self)}") from None
        if isinstance(key, list | tuple) and key and all(isinstance(name, str) for name in key):
            return Table({str(name): self[str(name)] for name in key}, self.summary)
        if not isinstance(key, slice) and np.ndim(key) == 0:
            raise TypeError(f"found table[{key}]; expected the name of a column, a slice, a mask or a list")
        rows: Any = key if isinstance(key, slice) else np.asarray(key)
        if not isinstance(key, slice) and not len(rows):
            rows = slice(0)
        return Table({name: column[rows] for name, column in self.items()}, self.summary)

    def head(self, rows: int = 5) -> Table:
        """The first rows."""
        return self[: count("rows", rows, 0)]

    def plot(self, y: str | Sequence[str] | None = None, x: str | None = None, *, ax: Axes | None = None) -> Axes:
        """Draws columns of one unit over another column, with a point for every row.

        Args:
            y: A column, or several; by default all numbers that have the unit of the last one.
            x: The column below; by default ``time_s`` if there is one, else the first.
            ax: Axes to draw in; by default those of a new figure.
        """
        from ._plot import plot_table

        return plot_table(self, y, x, ax)

    def to_csv(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes the table as text, with numbers that read back to their bits. ``force`` replaces a file that exists.

        Raises:
            FileExistsError: If there is such a file.
        """
        path = Path(path)
        if not force:
            check_free(path)
        partial = path.with_name(f"{path.name}.partial")
        try:
            with partial.open("w", newline="", encoding="utf-8") as file:
                write = csv.writer(file, lineterminator="\n").writerow
                write(self)
                columns = (["" if value != value else value for value in column.tolist()] for column in self.values())
                for row in zip(*columns, strict=True):
                    write(row)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)

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
        rows = np.empty(len(self), [(name, column.dtype) for name, column in self.items()])
        for name, column in self.items():
            rows[name] = column
        return rows

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if copy is False:
            raise ValueError("the rows of a table are made when they are asked for: they cannot be had without a copy")
        rows = self.to_numpy()
        return rows if dtype is None else rows.astype(dtype)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        # Polars asks in its own way; of the others pyarrow makes the stream, or Polars if only that is there
        from .errors import MissingExtraError

        try:
            made = self.to_arrow()
        except MissingExtraError:
            try:
                made = self.to_polars()
            except MissingExtraError:
                made = self.to_arrow()
        stream: object = made.__arrow_c_stream__(requested_schema)
        return stream

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self)} rows: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        from ._html import of_table

        return of_table(self)


def analyse(rec: Recording, name: str, *tables: str, **options: object) -> list[Table]:
    """The result of the command's analysis ``name`` for a recording: its table, and those of flags ``tables``.

    Names of ``options`` are those of flags, followed by units.
    """
    flags: list[str] = []
    keys: dict[str, str] = {}
    for key, value in options.items():
        if key == "beads":
            value = range_of(key, value)  # type: ignore[arg-type]
        if key == "transmission":
            value = pairs_of(key, value)
        flag = re.sub(f"_({rec._UNITS})$", "", key).replace("_", "-")
        keys[flag] = key
        if value is True:
            flags.append(f"--{flag}")
        elif value is not None and value is not False:
            # numbers are written in the shortest form that reads back to their bits
            listed = np.atleast_1d(np.asarray(in_si(key, value))).tolist()
            if not listed and key not in ("at", "transmission"):
                # the command would take its default
                raise CommandValueError(f"{key}: found none; expected one or more", key=key)
            flags += [f"--{flag}={one}" for one in listed]
    with rec._file() as file, tempfile.TemporaryDirectory(prefix="beadline-") as directory:
        paths = {table: os.path.join(directory, f"{table}.csv") for table in ("out", *tables)}
        outputs = [f"--{table}={path}" for table, path in paths.items()]
        summary = run_command([name, file, *flags, *outputs], path=file, keys=keys)
        return [read_csv(path, summary) for path in paths.values()]


def pairs_of(name: str, pairs: Any) -> list[str]:
    """Pairs of places, as a command takes them."""
    if isinstance(pairs, str) or any(isinstance(pair, str) or len(pair) != 2 for pair in pairs):
        raise ValueError(f'{name}: found {pairs!r}; expected pairs of places, such as [("bead:3", "bead:90")]')
    return [",".join(pair) for pair in pairs]


def range_of(name: str, beads: slice | None) -> str | None:
    """Neighbouring beads, as a command takes them."""
    if beads is None:
        return None
    if not isinstance(beads, slice) or beads.step not in (None, 1):
        raise ValueError(f"{name}: found {beads!r}; expected neighbours, such as slice(10, 90)")
    ends = (beads.start or 0, beads.stop)
    return "..".join("" if end is None else str(operator.index(end)) for end in ends)


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
