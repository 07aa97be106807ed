"""Recordings as datasets of xarray, whose values are read when they are needed, and as Zarr."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from ._fields import FIELDS, FieldArray, check_memory
from ._map import Steps, rows_of
from ._new import check_directory, check_free

if TYPE_CHECKING:
    from ._native import Doubles, Numbers
    from ._recording import Recording

# fields of every run that a dataset has by default
_OF_EVERY_RUN = ("velocity", "displacement", "overlap")
# of a chunk of Zarr, and of what is computed at a time
_CHUNK_BYTES, _BLOCK_BYTES = 1 << 20, 32_000_000


def dataset(rec: Recording, steps: range | Numbers, fields: Sequence[str] | None) -> xr.Dataset:
    """Fields of a recording at these steps; by default those of every run, and those that this run has."""
    check_memory("a list of the steps", 32 * len(steps), "take fewer with every=…")
    kept: Steps = np.asarray(steps, np.int64)
    rows = rows_of(rec, kept)
    names = [*_OF_EVERY_RUN, *rec._parts] if fields is None else fields
    # rows of a chunk for dask: a power of ten, so that round numbers of rows are whole chunks
    at_once = 10 ** (len(str(_BLOCK_BYTES // (8 * rec.beads))) - 1)
    variables = {name: _variable(_array(rec, name), rows, at_once) for name in names}
    coordinates = {
        "time": ("time", kept * rec.dt_s, {"units": "s", "long_name": "time"}),
        "step": ("time", kept, {"long_name": "step"}),
        "bead": ("bead", np.arange(rec.beads), {"long_name": "bead"}),
        "contact": ("contact", np.arange(rec.stiffness.size), {"long_name": "contact"}),
        "mass_kg": ("bead", rec.mass_kg, {"units": "kg", "long_name": "mass"}),
        "stiffness": ("contact", rec.stiffness, {"units": "N m^-alpha", "long_name": "stiffness"}),
    }
    physics = rec.manifest["physics"]
    if "bonds" in physics:
        del coordinates["stiffness"]
    facts = {"alpha": rec.alpha, **{name: physics[name] for name in ("beads", "dt_s", "step_count", "method")}}
    known = {name: value for name, value in facts.items() if value == value}
    attributes = {"name": rec.name, **known, "manifest": rec._manifest.json}
    return xr.Dataset(variables, coordinates, attributes).set_xindex("step")


def _array(rec: Recording, name: str) -> FieldArray:
    if name not in FIELDS:
        raise ValueError(f"fields: found {name!r}; expected some of {', '.join(FIELDS)}")
    array: FieldArray = getattr(rec, name)
    return array


def _variable(array: FieldArray, rows: Steps, at_once: int) -> xr.Variable:
    attributes = {"units": array.unit, "long_name": array.name.replace("_", " ")}
    chunks = {"preferred_chunks": {"time": at_once, array.place: array.shape[1]}} if at_once < len(rows) else {}
    lazy = indexing.LazilyIndexedArray(_Lazy(array, rows))
    return xr.Variable(("time", array.place), lazy, attributes, chunks)


class _Lazy(BackendArray):
    """Some rows of an array, as xarray reads them."""

    def __init__(self, array: FieldArray, rows: Steps) -> None:
        self._array, self._rows = array, rows
        self.shape = len(rows), array.shape[1]
        self.dtype = array.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        kind = indexing.IndexingSupport.OUTER
        return indexing.explicit_indexing_adapter(key, self.shape, kind, self._read)

    def _read(self, key: tuple[Any, ...]) -> Doubles:
        # each index is for its own axis
        return np.asarray(self._array[self._rows[key[0]]][..., key[1]])


def write_zarr(data: xr.Dataset, path: str | os.PathLike[str], force: bool) -> None:
    """Writes a dataset of a recording. The directory has its name when it is whole."""
    path = Path(path)
    partial = path.with_name(f"{path.name}.partial")
    _check_room(path, force)
    check_directory(path)
    _make_room(partial, force)
    try:
        _write_rows(data.reset_index("step"), partial)
        _make_room(path, force)
        partial.rename(path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _is_zarr(path: Path) -> bool:
    return (path / "zarr.json").is_file()


def _check_room(path: Path, force: bool) -> None:
    if not force:
        check_free(path)
    # a directory of something else is never replaced
    elif os.path.lexists(path) and not _is_zarr(path):
        raise FileExistsError(f"{path} exists already, and force=True replaces Zarr groups only; choose another name")


def _make_room(path: Path, force: bool) -> None:
    _check_room(path, force)
    if path.exists():
        shutil.rmtree(path)


def _write_rows(data: xr.Dataset, path: Path) -> None:
    """Writes some rows at a time: as many as fill chunks of all arrays."""
    widths = {name: max(1, array.shape[1]) for name, array in data.data_vars.items()}
    most = max(1, _CHUNK_BYTES // (8 * max(widths.values(), default=1)))
    chunks: dict[Any, Any] = {name: {"chunks": (most, width)} for name, width in widths.items()}
    rows = most * max(1, _BLOCK_BYTES // (8 * most * max(1, sum(widths.values()))))
    # empty chunks are written, since a chunk of −0 looks empty
    kind: dict[str, Any] = {"consolidated": False, "zarr_format": 3, "write_empty_chunks": True}
    data.isel(time=slice(rows)).to_zarr(path, mode="w-", encoding=chunks, **kind)
    growing = data.drop_vars([name for name, array in data.variables.items() if "time" not in array.dims])
    for begin in range(rows, data.sizes["time"], rows):
        growing.isel(time=slice(begin, begin + rows)).to_zarr(path, append_dim="time", **kind)
