"""Two recordings beside each other: their difference, its size over time, and the keys that differ."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _html
from ._fields import FieldArray, FieldName, Index
from ._files import View
from ._map import multiples, rows_of
from ._numbers import count
from ._plot import plot_comparison
from ._recording import Recording, open
from ._run import Run
from ._table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._native import Doubles, Numbers
    from ._plot import Scale

# parts of a step up to which times are the same, as in the page
_SAME = 1e-6


class Difference:
    """A recording less another one, at the steps of the first that both reach.

    Where the time steps differ, a cubic through displacements and velocities gives the states of the other one between its
    steps, as in the page.

    Attributes:
        name: The names of both.
        beads: Number of beads N.
        dt_s: The time step of the first (s).
        steps: The steps of the rows of ``displacement`` and ``velocity``.
        recorded_steps: Those that the first one keeps.
    """

    recomputes = True

    def __init__(self, a: Recording, b: Recording) -> None:
        if a.beads != b.beads:
            raise ValueError(f"found {a.beads} and {b.beads} beads; expected as many: only then is there a difference bead by bead")
        for rec in (a, b):
            if not rec.recomputes:
                raise ValueError(f"{rec.name}: this Beadline cannot recompute its steps; a difference needs both at the same times")
        self._a, self._b = a, b
        self.name, self.beads, self.dt_s, self.record_every = f"{a.name} − {b.name}", a.beads, a.dt_s, a.record_every
        ratio = b.dt_s / a.dt_s
        self.first_step = max(a.first_step, math.ceil(b.first_step * ratio - _SAME))
        self.last_step = min(a.last_step, math.floor(b.last_step * ratio + _SAME))
        if self.first_step > self.last_step:
            ends_s = [f"{rec.first_step * rec.dt_s:g} s to {rec.last_step * rec.dt_s:g} s" for rec in (a, b)]
            raise ValueError(f"found {' and '.join(ends_s)}; expected recordings that have times in common")
        self.steps = range(self.first_step, self.last_step + 1)
        kept = a.recorded_steps
        self.recorded_steps = kept[(kept >= self.first_step) & (kept <= self.last_step)]

    @property
    def displacement(self) -> FieldArray:
        """Differences of the displacements (m), shape (steps, N), computed when they are needed."""
        return FieldArray(self, "displacement", range(len(self.steps)), range(self.beads))

    @property
    def velocity(self) -> FieldArray:
        """Differences of the velocities (m/s), shape (steps, N), computed when they are needed."""
        return FieldArray(self, "velocity", range(len(self.steps)), range(self.beads))

    def _step_at(self, rows: Index) -> Numbers:
        return np.asarray(rows + self.first_step, np.uint64)

    def _gather(self, name: FieldName, steps: Numbers, places: Numbers) -> Doubles:
        difference: Doubles = self._a._gather(name, steps, places) - self._other(name, steps, places)
        return difference

    def _other(self, name: FieldName, steps: Numbers, places: Numbers) -> Doubles:
        """The field of the other recording at the times of steps of the first."""
        dt_s = self._b.dt_s
        wanted = steps * self.dt_s / dt_s
        near = np.rint(wanted)
        is_same = np.abs(wanted - near) <= _SAME
        before = np.where(is_same, near, np.floor(wanted))
        needed, at = np.unique(np.concatenate([before, before + ~is_same]).astype(np.uint64), return_inverse=True)
        i, j = at[: len(steps)], at[len(steps) :]
        if is_same.all():
            return self._b._gather(name, needed, places)[i]
        u, v = (self._b._gather(field, needed, places) for field in ("displacement", "velocity"))
        x = np.where(is_same, 0.0, wanted - before)[:, None]
        y = 1.0 - x
        found: Doubles = 6 * x * y / dt_s * (u[j] - u[i]) + y * (1 - 3 * x) * v[i] + x * (3 * x - 2) * v[j]
        if name == "displacement":
            found = y * y * (1 + 2 * x) * u[i] + x * x * (3 - 2 * x) * u[j] + dt_s * x * y * (y * v[i] - x * v[j])
        return found

    def __repr__(self) -> str:
        return f"<Difference {self.name}: {self.beads} beads, steps {self.first_step} to {self.last_step}>"


class Comparison:
    """Two recordings, made by :func:`compare`.

    Attributes:
        a, b: The recordings.
    """

    def __init__(self, a: Recording, b: Recording) -> None:
        self.a, self.b = a, b

    @cached_property
    def difference(self) -> Difference:
        """The first one less the other, with lazy arrays ``displacement`` and ``velocity``.

        Raises:
            ValueError: If they have other numbers of beads or no times in common, or one of them cannot be recomputed.
        """
        return Difference(self.a, self.b)

    @cached_property
    def changes(self) -> dict[str, tuple[Any, Any]]:
        """The keys of ``physics`` in the manifests whose values differ, and both values; None where there is none."""
        return dict(_changes(self.a.manifest["physics"], self.b.manifest["physics"], ""))

    def norms(self, every: int | None = None) -> Table:
        """The size of the difference over time: the root of the mean square over the beads, and the largest magnitude.

        Args:
            every: Steps between two rows; by default the recorded ones of the first.
        """
        difference = self.difference
        steps = difference.recorded_steps if every is None else np.asarray(multiples(difference.steps, count("every", every)))
        columns: dict[str, Any] = {"step": steps.astype(np.int64), "time_s": steps * difference.dt_s}
        for array, unit in ((difference.displacement, "m"), (difference.velocity, "m_s")):
            rms, largest = np.empty((2, len(steps)))
            for rows, block in array[rows_of(difference, columns["step"])].blocks():
                rms[rows], largest[rows] = np.sqrt(np.mean(block**2, axis=1)), np.abs(block).max(axis=1)
            columns |= {f"{array.name}_rms_{unit}": rms, f"{array.name}_max_{unit}": largest}
        return Table(columns)

    def apart_from_s(self, tolerance: float = 1e-4, *, every: int | None = None) -> float | None:
        """The time (s) of the first row of :meth:`norms` in which a displacement or a velocity differs by more than ``tolerance``; None
        if there is none. The tolerance is in units of L and v0 of the first run, as that of :meth:`Recording.check`.

        Raises:
            ValueError: If the tolerance is not above 0.
        """
        if not tolerance > 0:
            raise ValueError(f"tolerance: found {tolerance!r}; expected a number above 0, such as 1e-4")
        length_m, time_s = self.a._manifest.scales
        norms = self.norms(every)
        is_apart = norms["displacement_max_m"] > tolerance * length_m
        is_apart |= norms["velocity_max_m_s"] > tolerance * length_m / time_s
        return float(norms["time_s"][is_apart.argmax()]) if is_apart.any() else None

    def plot(
        self, field: str = "velocity", *, during_s: tuple[float, float] | None = None, scale: Scale | None = None
    ) -> Sequence[Axes]:
        """Draws maps of both with the same colours, and of their difference, beside each other.

        Args:
            field: ``"velocity"`` or ``"displacement"``.
            during_s, scale: As for :meth:`Recording.plot`.
        """
        return plot_comparison(self, field, during_s, scale)

    def view(self, *, open: bool = True, port: int = 0) -> View:
        """Shows both and their difference on the page, in the browser, and goes on.

        Args:
            open: Open it in the browser; ``url`` of the result is its address.
            port: Port of the server, on this machine only; by default a free one.
        """
        return View(self.a, self.b, open=open, port=count("port", port, 0))

    def _repr_html_(self) -> str:
        return _html.of_comparison(self)

    def __repr__(self) -> str:
        return f"<Comparison of {self.a.name} and {self.b.name}: {len(self.changes)} keys differ>"


def compare(a: Recording | Run | str | os.PathLike[str], b: Recording | Run | str | os.PathLike[str]) -> Comparison:
    """Compares two recordings. A run is simulated, a path is opened.

    Args:
        a, b: The recordings; differences are those of ``a`` less ``b``, at the times of ``a``.
    """
    return Comparison(_recording_of("a", a), _recording_of("b", b))


def _recording_of(key: str, it: Recording | Run | str | os.PathLike[str]) -> Recording:
    if isinstance(it, Recording):
        return it
    if isinstance(it, Run):
        return it.simulate()
    if not isinstance(it, str | os.PathLike):
        raise TypeError(f"{key}: found {type(it).__name__}; expected a Recording, a Run or the path of a recording")
    return open(it)


def _changes(a: Any, b: Any, path: str) -> Iterator[tuple[str, tuple[Any, Any]]]:
    """The keys of two JSON values that differ, each with both values."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in a | b:
            yield from _changes(a.get(key), b.get(key), f"{path}.{key}" if path else key)
    elif isinstance(a, list) and isinstance(b, list) and any(isinstance(one, dict) for one in a + b):
        for i in range(max(len(a), len(b))):
            one, other = (values[i] if i < len(values) else None for values in (a, b))
            yield from _changes(one, other, f"{path}[{i}]")
    elif a != b:
        yield path, (a, b)
