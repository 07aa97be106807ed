"""Lazy arrays: quantities at every step and place of a recording."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import EllipsisType
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt
from numpy.lib.mixins import NDArrayOperatorsMixin

from ._numbers import count

if TYPE_CHECKING:
    from ._comparison import Difference
    from ._native import Doubles
    from ._recording import Recording

FieldName = Literal[
    "displacement",
    "velocity",
    "overlap",
    "force",
    "resonator_displacement",
    "resonator_velocity",
    "dissipated",
    "drive_work",
    "drive_displacement",
    "bath_heat",
]
# what has a value of a field
Place = Literal["bead", "contact", "drive"]
Index = npt.NDArray[np.intp]
# positions on an axis
Axis = range | Index
# what selects along an axis
Along = (
    int | np.integer[Any] | slice | Sequence[int] | Sequence[bool] | npt.NDArray[np.integer[Any]] | npt.NDArray[np.bool_] | range
)
Key = Along | EllipsisType | None
Axes = int | tuple[int, ...] | None

# units, and places
FIELDS: dict[str, tuple[str, Place]] = {
    "displacement": ("m", "bead"),
    "velocity": ("m/s", "bead"),
    "overlap": ("m", "contact"),
    "force": ("N", "contact"),
    "resonator_displacement": ("m", "bead"),
    "resonator_velocity": ("m/s", "bead"),
    "dissipated": ("J", "bead"),
    "drive_work": ("J", "drive"),
    "drive_displacement": ("m", "drive"),
    "bath_heat": ("J", "bead"),
}
# parts of a state behind its displacements and velocities, in the order of Manifest.parts_of, and what has them
PARTS: dict[FieldName, str] = {
    "resonator_displacement": "resonators",
    "resonator_velocity": "resonators",
    "dissipated": "damping and no drag",
    "drive_work": "drives",
    "drive_displacement": "drives",
    "bath_heat": "baths",
}
# memory that is left to others
_FREE_PART = 0.9
# of rows of an array, of which a loop may not want all, how much is read at once
_ROWS_BYTES = 4_000_000


class FieldArray(NDArrayOperatorsMixin):
    """A quantity at every step and place of a recording, computed when it is needed.

    It has the shape (steps, places) and is indexed like an array of NumPy's. Slices, and a list or mask of either axis, give
    another such array; a number for both gives a float; what selects point by point is computed at once. ``np.asarray``
    computes it on all cores, and so does every function of NumPy's.

    Attributes:
        name: ``"velocity"``, ``"displacement"``, ``"overlap"``, ``"force"``, ``"resonator_displacement"``, ``"resonator_velocity"``,
            ``"dissipated"``, ``"drive_work"``, ``"drive_displacement"`` or ``"bath_heat"``.
        unit: Its unit.
        place: The kind of its places: ``"bead"``, ``"contact"`` or ``"drive"``.
    """

    def __init__(self, recording: Recording | Difference, name: FieldName, rows: Axis | int, columns: Axis | int) -> None:
        self._recording = recording
        self.name: FieldName = name
        self.unit, self.place = FIELDS[name]
        # positions on the axes of the whole array; a number takes the axis away
        self._axes: tuple[Axis | int, Axis | int] = (rows, columns)

    @property
    def shape(self) -> tuple[int, ...]:
        """(steps, places), of those axes that are left."""
        return tuple(len(axis) for axis in self._axes if not isinstance(axis, int))

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of values."""
        return int(np.prod(self.shape, dtype=object))

    @property
    def nbytes(self) -> int:
        """Size of the computed array (bytes)."""
        return 8 * self.size

    @property
    def dtype(self) -> np.dtype[np.float64]:
        """float64."""
        return np.dtype(np.float64)

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("len() of a single value")
        return self.shape[0]

    def __iter__(self) -> Iterator[Any]:
        for _, block in self.blocks(_ROWS_BYTES):
            yield from block

    def __contains__(self, value: object) -> bool:
        return any(bool(np.any(block == value)) for _, block in self.blocks())

    @overload
    def __getitem__(self, key: tuple[int, int]) -> float: ...
    @overload
    def __getitem__(self, key: slice | EllipsisType | tuple[slice, slice | int] | tuple[int, slice]) -> FieldArray: ...
    @overload
    def __getitem__(self, key: Key | tuple[Key, ...] | npt.NDArray[np.bool_]) -> Any: ...
    def __getitem__(self, key: Any) -> Any:
        keys = _spread(key, self.ndim)
        if keys is None:
            return self._points(key)
        axes = list(self._axes)
        left = iter(keys)
        axes = [axis if isinstance(axis, int) else _chosen(axis, next(left)) for axis in axes]
        rows, columns = axes
        part = FieldArray(self._recording, self.name, rows, columns)
        return part if part.shape else float(part.compute())

    def _points(self, key: Any) -> Any:
        """The values of ``key`` by NumPy's rules, from no more rows and columns than they need."""
        keys = list(key) if isinstance(key, tuple) else [key]
        axes = [axis for axis in self._axes if not isinstance(axis, int)]
        used = sum(np.ndim(k) if _is_mask(k) else 1 for k in keys if k is not None and k is not Ellipsis)
        if Ellipsis not in [k for k in keys if k is None or k is Ellipsis]:
            keys.append(Ellipsis)
        at = next(number for number, k in enumerate(keys) if k is Ellipsis)
        keys[at : at + 1] = [slice(None)] * (len(axes) - used)
        needed: list[Index] = []
        again: list[Any] = []
        for one in keys:
            if one is None or _is_truth(one):
                again.append(one)
                continue
            for k in _of_mask(one, axes[len(needed) :]) if _is_mask(one) else [one]:
                if len(needed) == len(axes):
                    raise IndexError(f"too many indices: the array has {len(axes)} axes")
                key_of_axis = k if isinstance(k, slice) else _as_index(k)
                positions = _positions(_chosen(range(len(axes[len(needed)])), key_of_axis))
                unique, inverse = np.unique(positions, return_inverse=True)
                needed.append(unique)
                again.append(_same_kind(k, inverse.reshape(np.shape(positions))))
        block = self[tuple(needed)] if len(needed) < 2 else self[needed[0]][:, needed[1]]
        return np.asarray(block)[tuple(again)]

    def compute(self) -> Doubles:
        """The values, in memory.

        Raises:
            MemoryError: If there is not enough of it.
            RecordingError: If the file is damaged there.
        """
        lengths = " × ".join(f"{length:,}" for length in self.shape)
        remedy = "take a part, such as [::100], or go through it in blocks()"
        check_memory(f"{self.name} of {lengths} values", self.nbytes, remedy)
        (rows, row_of), (columns, column_of) = map(_ascending, self._axes)
        steps = np.ascontiguousarray(self._recording._step_at(rows), dtype=np.uint64)
        places = np.ascontiguousarray(columns, dtype=np.uint64)
        values = self._recording._gather(self.name, steps, places)
        for axis, back in enumerate((row_of, column_of)):
            if back is not None:
                values = values.take(back, axis=axis)
        shaped: Doubles = values.reshape(self.shape)
        return shaped

    def blocks(self, most_bytes: int = 32_000_000) -> Iterator[tuple[slice, Doubles]]:
        """The values in blocks of rows, of at most ``most_bytes`` if a row is not more, each with the slice of its rows."""
        rows = max(1, int(count("most_bytes", most_bytes) // max(8, self.nbytes // max(1, len(self)))))
        for begin in range(0, len(self), rows):
            part = slice(begin, min(begin + rows, len(self)))
            yield part, np.asarray(self[part])

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if copy is False:
            raise ValueError(f"{self.name} is computed: it cannot be had without a copy")
        values = self.compute()
        return values if dtype is None else values.astype(dtype, copy=False)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if any(isinstance(it, FieldArray) for it in options.get("out", ())):
            raise TypeError(f"{self.name} of a recording cannot be changed: change a copy, np.array(...)")
        computed = (np.asarray(it) if isinstance(it, FieldArray) else it for it in inputs)
        return getattr(ufunc, method)(*computed, **options)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return function(*_computed(args), **{name: _computed(value) for name, value in options.items()})

    def max(self, axis: Axes = None, *, keepdims: bool = False) -> Any:
        """The largest value, or that along an axis."""
        return np.asarray(self).max(axis=axis, keepdims=keepdims)

    def min(self, axis: Axes = None, *, keepdims: bool = False) -> Any:
        """The smallest value, or that along an axis."""
        return np.asarray(self).min(axis=axis, keepdims=keepdims)

    def mean(self, axis: Axes = None, *, keepdims: bool = False) -> Any:
        """The mean, or that along an axis."""
        return np.asarray(self).mean(axis=axis, keepdims=keepdims)

    def sum(self, axis: Axes = None, *, keepdims: bool = False) -> Any:
        """The sum, or that along an axis."""
        return np.asarray(self).sum(axis=axis, keepdims=keepdims)

    def std(self, axis: Axes = None, *, ddof: float = 0, keepdims: bool = False) -> Any:
        """The standard deviation, or that along an axis; with ``ddof=1`` that of a sample."""
        return np.asarray(self).std(axis=axis, ddof=ddof, keepdims=keepdims)

    def argmax(self, axis: int | None = None, *, keepdims: bool = False) -> Any:
        """Position of the largest value, or of that along an axis."""
        values: Any = np.asarray(self)
        return values.argmax(axis=axis, keepdims=keepdims)

    def astype(self, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """The computed array with another type."""
        return np.asarray(self).astype(dtype, copy=False)

    @property
    def T(self) -> Doubles:
        """The computed array with its axes exchanged."""
        return np.asarray(self).T

    def __getattr__(self, name: str) -> Any:
        # only for what is not found
        hint = f": take np.asarray(…).{name}" if not name.startswith("_") and hasattr(np.ndarray, name) else ""
        raise AttributeError(f"a lazy array has no {name}{hint}", name=name, obj=self)

    def __repr__(self) -> str:
        return f"<{self.name} ({self.unit}) of {self._recording.name}, shape {self.shape}: computed when it is needed>"


def _computed(value: Any) -> Any:
    if isinstance(value, FieldArray):
        return np.asarray(value)
    if isinstance(value, list | tuple):
        return type(value)(_computed(item) for item in value)
    return value


def _is_mask(key: Any) -> bool:
    return not isinstance(key, slice) and key is not None and key is not Ellipsis and np.asarray(key).dtype == bool


def _of_mask(mask: Any, axes: list[Axis]) -> tuple[Index, ...]:
    lengths = tuple(map(len, axes[: np.ndim(mask)]))
    if np.shape(mask) != lengths:
        raise IndexError(f"the mask has the shape {np.shape(mask)}, the array {lengths} there")
    return np.nonzero(mask)


def _spread(key: Any, ndim: int) -> list[Any] | None:
    """One key an axis, if each chooses along its axis alone; else None."""
    keys = list(key) if isinstance(key, tuple) else [key]
    if any(k is None for k in keys) or len(keys) > ndim + (Ellipsis in [k for k in keys if k is Ellipsis]):
        return None
    if any(k is Ellipsis for k in keys):
        at = next(number for number, k in enumerate(keys) if k is Ellipsis)
        keys[at : at + 1] = [slice(None)] * (ndim + 1 - len(keys))
    keys += [slice(None)] * (ndim - len(keys))
    if any(k is Ellipsis for k in keys):
        return None
    dimensions = [0 if isinstance(k, slice) else np.ndim(k) for k in keys]
    arrays = sum(1 for k, n in zip(keys, dimensions, strict=True) if n > 0)
    numbers = sum(1 for k, n in zip(keys, dimensions, strict=True) if n == 0 and not isinstance(k, slice))
    if max(dimensions, default=0) > 1 or arrays > 1 or (arrays and numbers) or any(_is_truth(k) for k in keys):
        return None
    return [k if isinstance(k, slice) else _as_index(k) for k in keys]


def _is_truth(key: Any) -> bool:
    """A single truth value, which NumPy takes as another axis."""
    return _is_mask(key) and np.ndim(key) == 0


def _as_index(key: Any) -> Any:
    array = np.asarray(key)
    # an empty list has no type
    return array.astype(np.intp) if array.size == 0 and isinstance(key, list | tuple) else array


def _chosen(axis: Axis, key: Any) -> Any:
    """The positions that a slice or an array of indices takes of an axis; a number for a single one."""
    if isinstance(axis, range) and isinstance(key, slice):
        return axis[key]
    if isinstance(axis, range) and np.issubdtype(key.dtype, np.integer):
        # an axis may be much longer than memory
        length, key = len(axis), key.astype(np.intp)
        beyond = key[(key < -length) | (key >= length)]
        if beyond.size:
            raise IndexError(f"index {beyond[0]} is out of bounds for an axis of {length:,}")
        found = axis.start + axis.step * np.where(key < 0, key + length, key)
    else:
        found = _positions(axis)[key]
    return int(found) if found.ndim == 0 else found


def _positions(axis: Axis | int) -> Index:
    return np.arange(axis.start, axis.stop, axis.step) if isinstance(axis, range) else np.asarray(axis)


def _ascending(axis: Axis | int) -> tuple[Index, Index | None]:
    """The positions of an axis in their order, each once, and where each of the axis is there, if not at its own place."""
    positions = np.atleast_1d(_positions(axis))
    return (positions, None) if np.all(positions[1:] > positions[:-1]) else np.unique(positions, return_inverse=True)


def _same_kind(key: Any, inverse: Index) -> Any:
    """An index of the kind that ``key`` is, so that NumPy puts the axes where it would."""
    if isinstance(key, slice):
        backwards = len(inverse) > 1 and inverse[0] > inverse[-1]
        return slice(None, None, -1) if backwards else slice(None)
    return int(inverse) if inverse.ndim == 0 and isinstance(key, int | np.integer) else inverse


def check_memory(what: str, needed_bytes: int, remedy: str) -> None:
    """Refuses what would take more memory than there is."""
    free_bytes = _free_bytes()
    if needed_bytes > _FREE_PART * free_bytes:
        takes = f"{what} takes {needed_bytes / 1e9:,.1f} GB, {free_bytes / 1e9:,.1f} GB are free"
        raise MemoryError(f"{takes}: {remedy}")


def _free_bytes() -> float:
    """Memory that this process may still have."""
    import resource

    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = 1024.0 * int(next(line for line in lines if line.startswith("MemAvailable")).split()[1])
        used = os.sysconf("SC_PAGE_SIZE") * int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (OSError, StopIteration, ValueError):
        return float("inf")
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return free if limit == resource.RLIM_INFINITY else min(free, float(limit - used))
