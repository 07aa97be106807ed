"""Recordings: every step an index away."""

from __future__ import annotations

import json
import operator
import os
import re
import tempfile
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property, lru_cache
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from . import _files, _html, _native, _plot
from ._analyses import Analyses
from ._chain import exponents_of, number, numbers
from ._fields import FIELDS, PARTS, FieldArray, FieldName, Index, check_memory
from ._map import multiples, nearest, rows_of
from ._numbers import count
from ._table import Table, analyse
from .errors import RecordingError

if TYPE_CHECKING:
    from ._native import Doubles, Numbers, StateTuple

Array = TypeVar("Array", bound=npt.NDArray[Any])

# of states that are read one after the other, how much is read at once
_BLOCK_BYTES = 32_000_000


def open(path: str | os.PathLike[str]) -> Recording:
    """Opens a recording: whole, cut short, or still being written (then as ``PATH.partial``). A URL works, too: ``s3://``, ``gs://``,
    ``az://``, ``http://`` or ``https://``.

    Raises:
        FileNotFoundError: If there is none.
        RecordingError: If it is no recording, is damaged up to its first state, or holds no state.
    """
    path = os.fspath(path) if isinstance(path, os.PathLike) else path
    if not isinstance(path, str):
        raise TypeError(f"path: found {path!r}; expected a text, such as 'run.mcap', or a path of pathlib")
    if not _is_url(path):
        # absolute, so that it stays the same file in another directory
        path = os.path.abspath(path)
        partial = f"{path}.partial"
        path = partial if not os.path.exists(path) and os.path.exists(partial) else path
    recording = Recording(_native.States.open(path), path)
    if not recording.about["states"]:
        channels = ", ".join(topic for topic, _ in recording.about["channels"])
        what = f"{path} holds no states, only {channels}: open the recording that it was made of"
        raise RecordingError(what, path=path)
    return recording


def _is_url(path: str) -> bool:
    return re.match(r"(s3|gs|az|https?)://", path) is not None


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


class State:
    """The state of a chain at a step. Its arrays are read-only.

    Attributes:
        frame: Number of the frame; between two frames, of the one before.
        step: Number of the step.
        time_s: Its time (s).
        displacement_m: Displacement of each bead (m), N values.
        velocity_m_s: Velocity of each bead (m/s), N values.
        extra: Further values that the run needs to go on: for ``"gear5"`` some values for each bead, then the values behind
            ``resonator_displacement_m`` and the others below; FORMAT has the order.
    """

    def __init__(self, manifest: _native.Manifest, state: StateTuple) -> None:
        self._manifest = manifest
        self.frame, self.step, self.time_s, self.displacement_m, self.velocity_m_s, self.extra = state
        for array in (self.displacement_m, self.velocity_m_s, self.extra):
            _read_only(array)

    @cached_property
    def overlap_m(self) -> Doubles:
        """Overlap of each contact between two beads (m), N − 1 values, in a ring N; below 0 it is open."""
        return self._field("overlap")

    @cached_property
    def force_n(self) -> Doubles:
        """Force of each contact between two beads (N), N − 1 values, in a ring N, damping and load included."""
        return self._field("force")

    @cached_property
    def wall_force_n(self) -> Doubles:
        """Forces of the contacts with the left and the right wall (N), damping and load included, 0 at a free end. In a ring the first is that of the contact that closes it."""
        forces = self._manifest.wall_forces_n(self.time_s, self.displacement_m, self.velocity_m_s, self.extra)
        return _read_only(forces)

    @cached_property
    def _parts(self) -> list[Doubles]:
        return [_read_only(part) for part in self._manifest.parts_of(self.extra)]

    @property
    def resonator_displacement_m(self) -> Doubles:
        """Displacement of the resonator in each bead (m), N values; none of a run without resonators."""
        return self._parts[0]

    @property
    def resonator_velocity_m_s(self) -> Doubles:
        """Velocity of the resonator in each bead (m/s), N values; none of a run without resonators."""
        return self._parts[1]

    @property
    def dissipated_j(self) -> Doubles:
        """Energy that was dissipated so far (J), N values: of contact ``i`` and of the drag of bead ``i``; the last one is that of walls,
        or of the contact that closes a ring, and of the drag of the last bead. None of a run without damping and drag."""
        return self._parts[2]

    @property
    def drive_work_j(self) -> Doubles:
        """Work that each drive has done so far (J)."""
        return self._parts[3]

    @property
    def drive_displacement_m(self) -> Doubles:
        """Displacement (m) of the wall or bead that each drive moves; 0 of a force."""
        return self._parts[4]

    @property
    def heat_j(self) -> Doubles:
        """Heat that baths have given so far (J), N values: to bead ``i``, or by a bath of pairs in contact ``i``. None of a run without."""
        return self._parts[5]

    @property
    def mass_kg(self) -> Doubles:
        """Mass of each bead (kg), N values."""
        return _read_only(self._manifest.mass_kg)

    @cached_property
    def _energy_j(self) -> tuple[float, float]:
        return self._manifest.energy_j(self.displacement_m, self.velocity_m_s, self.extra)

    @property
    def kinetic_j(self) -> float:
        """Kinetic energy of all beads and resonators (J)."""
        return self._energy_j[0]

    @property
    def potential_j(self) -> float:
        """Potential energy of all contacts, springs and loads (J)."""
        return self._energy_j[1]

    @property
    def total_j(self) -> float:
        """Kinetic plus potential energy (J)."""
        return self.kinetic_j + self.potential_j

    def _field(self, name: FieldName) -> Doubles:
        return _read_only(self._manifest.field_of(name, self.displacement_m, self.velocity_m_s))

    def __reduce__(self) -> tuple[Any, ...]:
        arrays = self.displacement_m, self.velocity_m_s, self.extra
        return State, (self._manifest, (self.frame, self.step, self.time_s, *arrays))

    def _repr_html_(self) -> str:
        return _html.of_state(self)

    def __repr__(self) -> str:
        return f"<State at step {self.step}, {self.time_s:.6g} s, of {self.velocity_m_s.size} beads>"


class Recording(Analyses):
    """A recording, or a run in memory, of :func:`open`, ``Run.record`` or ``Run.simulate``.

    It has every step: a step that was not kept is recomputed, and the next kept state proves it. ``rec[12345]`` is
    the :class:`State` of a step, ``rec[-1]`` the last one, ``len(rec)`` the number of steps; a loop over ``rec`` goes
    through all of them, :meth:`states` through those that are kept. ``with bl.open(…) as rec`` closes it at the end.

    Attributes:
        path: The file; None of a run in memory.
        summary: The summary of the run, if this process has made it: ``end``, ``last_step``,
            ``recorded_states``, ``relative_drift`` of the energy, and of a file ``path`` and ``bytes``. Else None.
    """

    summary: dict[str, Any] | None = None

    def __init__(self, states: _native.States, path: str | None = None) -> None:
        self._open: _native.States | None = states
        self._manifest = states.manifest
        self.path = path

    @property
    def _states(self) -> _native.States:
        if self._open is None:
            again = "make the run again" if self.path is None else f"bl.open({self.path!r}) opens it again"
            raise ValueError(f"the recording of {self.name} is closed: {again}")
        return self._open

    def close(self) -> None:
        """Lets go of the file, or of the states in memory. Computed arrays stay; anything else is a ``ValueError`` from now on."""
        self._open = None

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def name(self) -> str:
        """Name of the run."""
        return self._manifest.name

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """The validated run: ``physics`` decides every bit, ``provenance`` is its origin."""
        found: dict[str, Any] = json.loads(self._manifest.json)
        return found

    @property
    def toml(self) -> str | None:
        """The configuration as the user gave it, if it is there."""
        return self._manifest.toml

    @property
    def beads(self) -> int:
        """Number of beads N."""
        return self._manifest.beads

    @property
    def dt_s(self) -> float:
        """Time step (s)."""
        return self._manifest.dt_s

    @property
    def duration_s(self) -> float:
        """Simulated time (s) up to the last step that is kept."""
        return self.last_step * self.dt_s

    @property
    def alpha(self) -> float:
        """Exponent α of the contacts; NaN if they have several, or bonds are in their place."""
        found = exponents_of(self.manifest["physics"])
        return found[0] if len(found) == 1 else np.nan

    @cached_property
    def mass_kg(self) -> Doubles:
        """Mass of each bead (kg), N values."""
        return _read_only(self._manifest.mass_kg)

    @cached_property
    def stiffness(self) -> Doubles:
        """Stiffness of each contact (N·m^−α), N − 1 values, in a ring N; 0 of bonds."""
        return _read_only(self._manifest.stiffness)

    @cached_property
    def rest_overlap_m(self) -> Doubles:
        """Overlap of each contact at rest (m), N − 1 values, in a ring N; without a load 0, or minus the gap."""
        return _read_only(self._manifest.rest_overlap_m)

    @cached_property
    def rest_force_n(self) -> Doubles:
        """Force of each contact at rest (N), N − 1 values, in a ring N; 0 without a load."""
        return _read_only(self._manifest.rest_force_n)

    @cached_property
    def about(self) -> dict[str, Any]:
        """Contents: the numbers of ``states`` and ``bytes``; the ``end`` of the run; ``is_finished``, true if the file was
        closed; ``is_complete``, true if no state is missing; ``damage`` in words; ``channels`` and their messages."""
        return self._states.about()

    @property
    def first_step(self) -> int:
        """The first step that is kept."""
        return self._states.first_step

    @property
    def last_step(self) -> int:
        """The last step that is kept."""
        return self._states.last_step

    @property
    def record_every(self) -> int:
        """Steps between two states that are kept."""
        return self._manifest.record_every_steps

    @property
    def recomputes(self) -> bool:
        """True if the steps between can be recomputed: this Beadline has the dynamics of the run."""
        return self._states.recomputes

    @cached_property
    def recorded_steps(self) -> Numbers:
        """The steps that are kept."""
        first, last, every = self.first_step, self.last_step, self.record_every
        # the last one is said by the file, which may be a stranger's
        check_memory("a list of the recorded steps", 32 * ((last - first) // every), "take single steps, such as rec[1000]")
        begin = -(-first // every) * every
        between = np.arange(begin, last + 1, every, dtype=np.uint64)
        ends = [first] * (first < begin), [last] * (last % every > 0 and last > first)
        kept = np.concatenate([np.array(ends[0], np.uint64), between, np.array(ends[1], np.uint64)])
        return _read_only(kept)

    @property
    def steps(self) -> range | Numbers:
        """The steps of the rows of :attr:`velocity` and the others."""
        return range(self.first_step, self.last_step + 1) if self.recomputes else self.recorded_steps

    @property
    def time_s(self) -> Doubles:
        """Their times (s)."""
        check_memory("a list of all times", 32 * len(self.steps), "multiply steps that you take with rec.dt_s")
        times_s: Doubles = self._step_at(np.arange(len(self.steps))).astype(np.float64) * self.dt_s
        return times_s

    def _step_at(self, rows: Index) -> Numbers:
        steps = self.steps
        found: Numbers = np.asarray(rows + steps.start if isinstance(steps, range) else steps[rows], np.uint64)
        return found

    @cached_property
    def _parts(self) -> dict[FieldName, Index]:
        """Columns of the parts that this run has, in a row of all doubles of a state."""
        # parts are taken from the numbers of the columns as they are from the doubles
        columns = self._manifest.parts_of(np.arange(2.0 * self.beads, self._manifest.frame_doubles))
        return {name: part.astype(np.intp) for name, part in zip(PARTS, columns, strict=True) if part.size}

    @cached_property
    def _contacts(self) -> int:
        """The number of contacts, in a ring with the one that closes it."""
        ends = self.manifest["physics"].get("ends", {})
        return self.beads if ends.get("left") == "periodic" else self.beads - 1

    def _field(self, name: FieldName) -> FieldArray:
        if name in PARTS and name not in self._parts:
            raise AttributeError(f"the run has no {PARTS[name]}, so no {name}", name=name, obj=self)
        places = {"bead": self.beads, "contact": self._contacts, "drive": self._manifest.rows[2]}[FIELDS[name][1]]
        return FieldArray(self, name, range(len(self.steps)), range(places))

    def _gather(self, name: FieldName, steps: Numbers, places: Numbers) -> Doubles:
        """The values of a field at steps, which ascend, and at places: a row for each step."""
        if name not in PARTS or name.startswith("resonator"):
            return self._states.gather(name, steps, places)
        columns, found = self._parts[name][places], np.empty((len(steps), len(places)))
        begin = 0
        for block, doubles in self._blocks(steps):
            found[begin : begin + len(block)] = doubles[:, columns]
            begin += len(block)
        return found

    @property
    def displacement(self) -> FieldArray:
        """Displacements (m), shape (steps, N), computed when they are needed."""
        return self._field("displacement")

    @property
    def velocity(self) -> FieldArray:
        """Velocities (m/s), shape (steps, N), computed when they are needed."""
        return self._field("velocity")

    @property
    def overlap(self) -> FieldArray:
        """Overlaps of the contacts between beads (m), shape (steps, N − 1), in a ring N, computed when they are needed."""
        return self._field("overlap")

    @property
    def force(self) -> FieldArray:
        """Forces of the contacts between beads (N), shape (steps, N − 1), in a ring N, computed when they are needed."""
        return self._field("force")

    @property
    def resonator_displacement(self) -> FieldArray:
        """Displacements of the resonators (m), shape (steps, N), computed when they are needed.

        Raises:
            AttributeError: If there are none.
        """
        return self._field("resonator_displacement")

    @property
    def resonator_velocity(self) -> FieldArray:
        """Velocities of the resonators (m/s), shape (steps, N), computed when they are needed.

        Raises:
            AttributeError: If there are none.
        """
        return self._field("resonator_velocity")

    @property
    def dissipated(self) -> FieldArray:
        """Energy that was dissipated so far (J), shape (steps, N): in a step as ``dissipated_j`` of its :class:`State`.

        Raises:
            AttributeError: If the run has no damping and no drag.
        """
        return self._field("dissipated")

    @property
    def drive_work(self) -> FieldArray:
        """Work that each drive has done so far (J), shape (steps, drives).

        Raises:
            AttributeError: If there are none.
        """
        return self._field("drive_work")

    @property
    def drive_displacement(self) -> FieldArray:
        """Displacement (m) of the wall or bead that each drive moves, shape (steps, drives); 0 of a force.

        Raises:
            AttributeError: If there are none.
        """
        return self._field("drive_displacement")

    @property
    def bath_heat(self) -> FieldArray:
        """Heat that baths have given so far (J), shape (steps, N): in a step as ``heat_j`` of its :class:`State`.

        Raises:
            AttributeError: If there are none.
        """
        return self._field("bath_heat")

    def __len__(self) -> int:
        return len(self.steps)

    def __getitem__(self, step: int) -> State:
        """The state of a step; −1 is the last one.

        Raises:
            IndexError: If the recording does not have it.
            RecordingError: If it cannot be recomputed, or the file is damaged there.
        """
        if isinstance(step, slice):
            raise TypeError("a recording has single states: take rec.velocity[10:20], or rec.states(...)")
        found = operator.index(step)
        found += self.last_step + 1 if found < 0 else 0
        if not self.first_step <= found <= self.last_step:
            raise IndexError(f"step {step}: the recording has steps {self.first_step} to {self.last_step}")
        return State(self._manifest, self._states.state(found))

    def __iter__(self) -> Iterator[State]:
        return self.states(every=1)

    def __contains__(self, state: object) -> bool:
        """True if it has this state, to the bit."""
        if not isinstance(state, State):
            raise TypeError(f"found {state!r} in rec; expected a State, or a value in an array, such as rec.velocity")
        if not self.first_step <= state.step <= self.last_step or state.velocity_m_s.size != self.beads:
            return False
        own = self[state.step]
        both = ((one.displacement_m, one.velocity_m_s, one.extra) for one in (own, state))
        return all(a.tobytes() == b.tobytes() for a, b in zip(*both, strict=True))

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        raise TypeError("a recording is many arrays: take one, such as np.asarray(rec.velocity[::100])")

    def at(self, *, time_s: float) -> State:
        """The state nearest to the time ``time_s`` (s).

        Raises:
            ValueError: If the recording does not reach there.
        """
        return self[int(self._steps_near(number("time_s", time_s), self.steps))]

    def sel(
        self,
        *,
        time_s: float | slice | Sequence[float] | Doubles | None = None,
        bead: int | slice | Sequence[int] | npt.NDArray[Any] | None = None,
        every: int | None = None,
    ) -> Table:
        """Displacements and velocities at times and beads: a table with a row for each time and bead.

        Args:
            time_s: A time (s), or several: the nearest steps. Or ``slice(0.04, 0.05)``: steps from the one to the other, both included.
                By default the whole run.
            bead: A bead, several, or ``slice(490, 510)``; by default all.
            every: Only each of so many steps; by default the recorded ones, of single times any step.

        Raises:
            ValueError: If the recording has no such time, or the chain no such bead.
            MemoryError: If there is not enough of it.
        """
        if time_s is None or isinstance(time_s, slice):
            part = time_s or slice(None)
            if part.step is not None:
                raise ValueError(f"time_s: found {part}; expected the first and the last time (s); every=… takes fewer steps")
            steps = np.asarray(self._steps_during("time_s", part.start, part.stop, every), np.int64)
        else:
            among = self.steps if every is None else self._steps_every(every)
            times_s = np.atleast_1d(numbers("time_s", time_s))
            if not times_s.size or times_s.ndim > 1:
                raise ValueError(f"time_s: found {time_s!r}; expected a time (s), a list or a slice")
            steps = self._steps_near(times_s, among)
        beads = self._beads(bead)
        what = f"a table of {len(steps):,} × {len(beads):,} rows"
        check_memory(what, 5 * 8 * len(steps) * len(beads), "take fewer times or beads, or every=…")
        rows = rows_of(self, steps)
        return Table(
            {
                "step": steps.repeat(len(beads)),
                "time_s": (steps * self.dt_s).repeat(len(beads)),
                "bead": np.tile(beads, len(steps)),
                "displacement_m": np.ravel(self.displacement[rows][:, beads]),
                "velocity_m_s": np.ravel(self.velocity[rows][:, beads]),
            }
        )

    def _steps_near(self, times_s: float | Doubles, steps: range | Numbers) -> npt.NDArray[np.int64]:
        """The nearest of ``steps`` to each time."""
        wanted = np.asarray(times_s) / self.dt_s
        inside = (np.rint(wanted) >= self.first_step) & (np.rint(wanted) <= self.last_step)
        if not inside.all():
            begin_s, end_s = self.first_step * self.dt_s, self.last_step * self.dt_s
            found = np.atleast_1d(times_s)[~np.atleast_1d(inside)][0]
            raise ValueError(f"time_s: found {found:g}; the recording has {begin_s:g} s to {end_s:g} s")
        return nearest(steps if isinstance(steps, range) else steps.astype(np.int64), wanted)

    def _steps_during(self, key: str, from_s: float | None, until_s: float | None, every: int | None) -> range | Numbers:
        """The recorded steps, or every so many, between two times, both included."""
        steps = self._steps_every(every)

        def time_s(step: int) -> float:
            return step * self.dt_s

        first_s = -np.inf if from_s is None else number(key, from_s)
        last_s = np.inf if until_s is None else number(key, until_s)
        # times that people write are those of steps
        begin, end = bisect_left(steps, first_s * (1 - 1e-12), key=time_s), bisect_right(steps, last_s * (1 + 1e-12), key=time_s)
        if begin >= end or np.isnan([first_s, last_s]).any():
            begin_s, end_s = time_s(self.first_step), time_s(self.last_step)
            is_between = every is None and max(first_s, begin_s) <= min(last_s, end_s)
            advice = "every=1 recomputes the steps between" if is_between else f"it has {begin_s:g} s to {end_s:g} s"
            raise ValueError(f"{key}: found {from_s!r}, {until_s!r}; the recording has no state there; {advice}")
        return steps[begin:end]

    def _beads(self, bead: Any) -> Index:
        """The numbers of beads that a number, a list, a mask or a slice takes."""
        found: Index = np.arange(self.beads)
        try:
            found = np.atleast_1d(found[slice(None) if bead is None else bead])
        except (IndexError, TypeError):
            found = found[:0]
        if not len(found) or found.ndim > 1:
            raise ValueError(f"bead: found {bead!r}; expected beads from 0 to {self.beads - 1}: a number, a list or a slice")
        return found

    def states(self, every: int | None = None) -> Iterator[State]:
        """States one after the other: those that are kept, or every so many steps."""
        beads = self.beads
        for steps, rows in self._blocks(self._steps_every(every)):
            for step, row in zip(steps.tolist(), rows, strict=True):
                arrays = row[:beads], row[beads : 2 * beads], row[2 * beads :]
                yield State(self._manifest, (self._manifest.frame_at(step), step, step * self.dt_s, *arrays))

    def _steps_every(self, every: int | None) -> range | Numbers:
        """The steps that are kept, or every so many: the multiples, as the command has them."""
        return self.recorded_steps if every is None else multiples(self.steps, count("every", every))

    def _blocks(self, steps: range | Numbers) -> Iterator[tuple[Numbers, Doubles]]:
        """The states of these steps, some at a time: their steps, and a row of doubles for each."""
        # enough for all cores, and little beside what is there
        most = max(1, _BLOCK_BYTES // (16 * self.beads))
        for begin in range(0, len(steps), most):
            block = np.ascontiguousarray(steps[begin : begin + most], np.uint64)
            yield block, self._states.gather_states(block)

    def refresh(self) -> Recording:
        """The recording as it is now, if it is still being written."""
        if self.path is None:
            return self
        whole = self.path.removesuffix(".partial")
        with suppress(FileNotFoundError):
            now = open(self.path)
            if self.path == whole or now._run_id == self._run_id:
                return now
        # it has its name now, unless the file of that name is older than the run
        now = open(whole)
        if self.path != whole and now._run_id != self._run_id:
            raise _of_another_run(whole)
        return now

    @property
    def _run_id(self) -> str:
        found: str = self.manifest["provenance"]["run_id"]
        return found

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Recording:
        """Writes a run in memory to the file ``path``, and returns that recording. ``force`` replaces a file that exists.

        Raises:
            FileExistsError: If there is such a file.
        """
        self._states.save(_files.mcap(path), force)
        return open(path)

    # recordings that are made of this one
    _opened = staticmethod(open)

    # the first argument of these is the recording
    verify = _files.verify
    check = _files.check
    share = _files.share
    export = _files.export
    to_hdf5 = _files.to_hdf5
    to_parquet = _files.to_parquet
    to_zarr = _files.to_zarr
    thin = _files.thin
    recover = _files.recover
    view = _files.view
    widget = _files.widget
    plot = _plot.plot
    to_xarray = _files.to_xarray
    _repr_html_ = _html.of_recording

    def _tables(self, analysis: str, *tables: str, **options: object) -> list[Table]:
        return analyse(self, analysis, *tables, **options)

    @contextmanager
    def _file(self) -> Iterator[str]:
        """A file with this recording, for the command, which knows nothing of a run that was there before."""
        states = self._states
        if self.path is not None:
            _check_run(_native.States.open(self.path), self._manifest, self.path)
            yield self.path
            return
        with tempfile.TemporaryDirectory(prefix="beadline-") as directory:
            path = os.path.join(directory, f"{self.name}.mcap")
            states.save(path)
            yield path

    def __reduce__(self) -> tuple[Any, ...]:
        if self.path is not None:
            return _of_file, (self._manifest, self.path)
        return _of_kept, (self._manifest, *self._states.kept())

    def __repr__(self) -> str:
        # as short as it can be said here
        place = self.path or "in memory"
        if self.path is not None and not _is_url(self.path):
            place = min(self.path, os.path.relpath(self.path), key=len)
        return f"<Recording of {self.name}: {self.beads} beads, steps {self.first_step} to {self.last_step}, {place}>"


def _check_run(states: _native.States, manifest: _native.Manifest, path: str) -> None:
    """Refuses states of a file that are of another run than ``manifest``, as the reader of single states does."""
    texts = states.manifest.json, manifest.json
    if texts[0] != texts[1] and json.loads(texts[0])["physics"] != json.loads(texts[1])["physics"]:
        raise _of_another_run(path)


def _of_another_run(path: str) -> RecordingError:
    return RecordingError(f"{path} is of another run now: open it again", path=path)


def _of_file(manifest: _native.Manifest, path: str) -> Recording:
    recording = open(path)
    _check_run(recording._states, manifest, path)
    return recording


def _of_kept(manifest: _native.Manifest, steps: Numbers, doubles: Doubles, end: str) -> Recording:
    return Recording(_native.States.of_kept(manifest, steps, doubles, end))


@lru_cache(maxsize=2)
def _manifest_of(json: bytes) -> _native.Manifest:
    return _native.Manifest.from_json(json, None)


def of_frame(json: bytes, state: StateTuple) -> State:
    """The state that a frame of a live run becomes in another process."""
    return State(_manifest_of(json), state)
