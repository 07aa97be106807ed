"""Live runs: every frame as it comes, and results of one's own about them."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._chain import number
from ._native import Frame as Frame
from ._native import Live as Live
from ._numbers import name_and_unit
from .errors import BeadlineError

if TYPE_CHECKING:
    from ._recording import Recording, State
    from ._table import Table

# how long frames may come one after the other before other tasks have a turn (s)
_TURN_S = 0.005

# longest time to wait for a run: some 300 years (s)
_MOST_S = 1e10


def attach(
    name: str | None = None,
    *,
    latest: bool = False,
    timeout_s: float | None = None,
    label: str = "python",
) -> Live:
    """Attaches to the live run ``name``, or to the only one, and waits for it if it is not there.

    Args:
        name: The run; by default the only one.
        latest: Never hold the run back, and count missed frames. By default every frame comes.
        timeout_s: Longest wait for the run to be there (s); ``None``: for ever. Joining a run that another consumer holds back may take
            longer.
        label: Name of this consumer for others.

    Raises:
        LiveError: If no run comes in time, or there are several and none was named.
    """
    return _native.attach(name, latest, _patience(timeout_s), label, _native.Stop())


def _patience(timeout_s: float | None) -> float | None:
    """Longest wait (s)."""
    if timeout_s is None:
        return None
    found = number("timeout_s", timeout_s)
    if not 0.0 <= found <= _MOST_S:
        raise ValueError(f"timeout_s: found {timeout_s!r}; expected seconds from 0 to {_MOST_S:g}, or None to wait for ever")
    return found


def attach_async(
    name: str | None = None,
    *,
    latest: bool = False,
    timeout_s: float | None = None,
    label: str = "python",
) -> AsyncLive:
    """As :func:`attach`, for ``async for frame in …`` and ``async with … as live``."""
    return AsyncLive(name, latest, timeout_s, label)


class AsyncLive:
    """A live run in asyncio; attaches with the first frame that is asked for, or in ``async with``.

    Cancelling a task that waits for a frame detaches; so does a timeout around it.

    Attributes:
        live: The run itself, once attached.
    """

    live: Live | None = None

    def __init__(
        self, name: str | None, latest: bool, timeout_s: float | None, label: str
    ) -> None:
        self._wanted = name, latest, _patience(timeout_s), label
        self._turn_began_s = time.monotonic()

    async def attach(self) -> Live:
        """Waits for the run."""
        if self.live is None:
            stop = _native.Stop()
            try:
                self.live = await asyncio.to_thread(_native.attach, *self._wanted, stop)
            except asyncio.CancelledError:
                stop.set()
                raise
        return self.live

    async def __anext__(self) -> Frame:
        try:
            live = await self.attach()
            if time.monotonic() - self._turn_began_s > _TURN_S:
                await asyncio.sleep(0)
                self._turn_began_s = time.monotonic()
            frame = live.take()
            while frame is None and live.end is None:
                await asyncio.to_thread(live.wait)
                self._turn_began_s = time.monotonic()
                frame = live.take()
        except asyncio.CancelledError:
            self.close()
            raise
        if frame is None:
            raise StopAsyncIteration
        return frame

    def __aiter__(self) -> AsyncLive:
        return self

    def close(self) -> None:
        """Leaves the run."""
        if self.live is not None:
            self.live.close()

    async def __aenter__(self) -> AsyncLive:
        await self.attach()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


@dataclass(frozen=True)
class LiveConsumer:
    """A consumer of a live run.

    Attributes:
        label: Its name.
        delivery: ``"lossless"`` or ``"latest"``.
        pid: Its process.
        behind: Published frames that it does not have yet, if it says so.
        missed: Frames that it has missed, if it says so.
    """

    label: str
    delivery: str
    pid: int | None
    behind: int | None
    missed: int | None


@dataclass(frozen=True)
class LiveRun:
    """A run on the bus.

    Attributes:
        name: Its name.
        run_id: Its identity.
        state: ``"waiting"``, ``"running"``, ``"done"``, ``"interrupted"``, ``"failed"`` or
            ``"dead"``.
        frame: The last frame published.
        step: Its step.
        step_count: Steps of the whole run.
        time_s: Simulated time of the last frame (s).
        ends_in_s: Time for the rest (s).
        pid: Process of the producer.
        consumers: Its consumers.
    """

    name: str
    run_id: str
    state: str
    frame: int | None
    step: int
    step_count: int | None
    time_s: float
    ends_in_s: float | None
    pid: int
    consumers: tuple[LiveConsumer, ...]


def live_runs() -> list[LiveRun]:
    """The runs on the bus, as ``beadline ls`` shows them."""
    return [_live_run(**about) for about in _native.live_runs()]


def _live_run(*, consumers: list[dict[str, Any]], **about: Any) -> LiveRun:
    return LiveRun(**about, consumers=tuple(LiveConsumer(**one) for one in consumers))


# those of :func:`analysis`, which this process knows
own_names: set[str] = set()

Row = float | Sequence[float] | npt.NDArray[Any]
Rows = list[tuple[int, int, float, list[float]]]


class Consumer:
    """An analysis of one's own: a function of a frame that gives a number for each of its columns.

    It can be called as the function itself.

    Attributes:
        name: Name of its results on the bus: ``own/NAME``.
        columns: Names of the columns, which end in their units; one may stand for many values.
    """

    def __init__(
        self, function: Callable[..., Any], columns: Iterable[str], name: str | None
    ) -> None:
        self.function = function
        self.columns = [columns] if isinstance(columns, str) else list(columns)
        taken = {"frame", "step", "time_s"}
        for column in self.columns:
            if column in taken:
                raise ValueError(f"columns: found {column!r}; allowed: other names than frame, step and time_s, and each once")
            taken.add(column)
        self.name = name or function.__name__.strip("_").replace("_", "-").lower()
        self.__doc__ = function.__doc__
        # where pickle looks for it, which is not where the function would be
        self.__module__ = function.__module__
        self.__qualname__ = getattr(function, "__qualname__", self.name)

    def __reduce__(self) -> str:
        return self.__qualname__

    def __call__(self, frame: Frame | State) -> Row:
        row: Row = self.function(frame)
        return row

    def follow(
        self,
        source: str | os.PathLike[str] | Recording = "live",
        *,
        publish: bool = False,
        latest: bool = False,
        every_step: bool = False,
        timeout_s: float | None = None,
    ) -> Table:
        """Calls the function with each frame of a source to its end, and gives the rows.

        Args:
            source: ``"live"`` (the only live run), ``"live:NAME"``, a recording or its path.
            publish: Put the rows on the bus while they come, for ``beadline record`` and others.
            latest: Never hold a live run back; of a recording every frame comes.
            every_step: All steps of a recording, not only the recorded ones; of a live run all that it publishes come.
            timeout_s: Longest wait for a live run to be there (s); a recording is there, or is not found at once.

        Raises:
            LostError: If frames of a live run were lost.
            ValueError: If the function does not give the values of its columns.
        """
        run = _live_name(source)
        if run is None:
            if publish:
                raise ValueError("only results of a live run can be published")
            return self._table(self._rows(_states(source, every_step)))
        with attach(run or None, latest=latest, timeout_s=timeout_s, label=self.name) as live:
            return self._table(self._publish(live) if publish else self._rows(live))

    def _begin(self) -> Callable[[Any], Row]:
        """The function from frames of one run to rows."""
        return self.function

    def _row(self, of: Callable[[Any], Row], frame: Frame | State, width: int | None) -> list[float]:
        try:
            given = of(frame)
        except StopIteration as error:
            found = f"{self.name} ended before the frames did, at frame {frame.frame}"
            advice = "a generator yields a row for each frame, to the last one"
            raise BeadlineError(f"{found}; {advice}", frame=frame.frame, step=frame.step) from error
        row = np.asarray(given).reshape(-1)
        if row.dtype.kind not in "biuf":
            found = f"{self.name} gave {given!r} for frame {frame.frame}"
            raise ValueError(f"{found}; expected numbers ({', '.join(self.columns)}) by return or yield, float('nan') where there is none")
        wanted = len(self.columns) if len(self.columns) > 1 else width
        if row.size == 0 or (wanted is not None and row.size != wanted):
            found = f"{self.name} gave {row.size} values for frame {frame.frame}"
            raise ValueError(f"{found}, not {wanted or 1} ({', '.join(self.columns)})")
        values: list[float] = row.astype(np.float64).tolist()
        return values

    def _rows(self, frames: Iterable[Frame] | Iterable[State]) -> Rows:
        rows: Rows = []
        of = self._begin()
        for frame in frames:
            row = self._row(of, frame, len(rows[0][3]) if rows else None)
            rows.append((frame.frame, frame.step, frame.time_s, row))
        return rows

    def _publish(self, live: Live) -> Rows:
        rows: Rows = []
        results: _native.Results | None = None
        of = self._begin()
        for frame in live:
            row = self._row(of, frame, len(rows[0][3]) if rows else None)
            if results is None:
                results = live.results(self.name, self.columns, len(row))
            results.publish(frame, row)
            rows.append((frame.frame, frame.step, frame.time_s, row))
        if results is not None:
            results.finish()
        return rows

    def _table(self, rows: Rows) -> Table:
        from ._table import Table

        width = len(rows[0][3]) if rows else len(self.columns)
        names = self.columns
        if len(names) != width:
            # the unit stays at the end
            cut = len(name_and_unit(names[0])[0])
            names = [f"{names[0][:cut]}_{place}{names[0][cut:]}" for place in range(width)]
        values = np.array([row for *_, row in rows], dtype=np.float64).reshape(len(rows), width)
        return Table(
            {
                "frame": np.array([frame for frame, *_ in rows], dtype=np.int64),
                "step": np.array([step for _, step, *_ in rows], dtype=np.int64),
                "time_s": np.array([time_s for *_, time_s, _ in rows], dtype=np.float64),
                **{name: np.ascontiguousarray(values[:, at]) for at, name in enumerate(names)},
            }
        )


def consumer(
    *, columns: Iterable[str], name: str | None = None
) -> Callable[[Callable[[Any], Row]], Consumer]:
    """Makes a :class:`Consumer` of a function of a frame, which gives a number for each of its columns.

    Args:
        columns: Names of the columns, with their units; one may stand for many values.
        name: Name of its results on the bus, ``own/NAME``; by default the name of the function.

    >>> @consumer(columns=["momentum_n_s"])
    ... def momentum(frame):
    ...     return frame.mass_kg @ frame.velocity_m_s
    >>> momentum.name
    'momentum'
    """
    return lambda function: Consumer(function, columns, name)


class Analysis(Consumer):
    """An analysis of one's own that remembers frames: a class or a generator.

    It follows live runs and recordings as a :class:`Consumer` does, and sweeps take its numbers, those of the last frame, by
    ``measure=["NAME.COLUMN"]``.

    Attributes:
        meanings: Meanings of the columns, by their names.
    """

    def __init__(self, make: Callable[[], Any], columns: Mapping[str, str], name: str | None) -> None:
        super().__init__(make, columns, name)
        for column in self.columns:
            if column != column.lower():
                raise ValueError(f"columns: found {column!r}; allowed: names without capitals, which stand for numbers (BEAD), such as {column.lower()!r}")
        self.meanings = dict(columns)
        about = (make.__doc__ or self.name).strip().splitlines()[0]
        _native.add_analysis(self.name, about, list(self.meanings.items()), self._begin_native)
        own_names.add(self.name)

    def __call__(self, *arguments: Any) -> Any:
        """Makes the object, or the generator, of one run."""
        return self.function(*arguments)

    def _begin(self) -> Callable[[Any], Row]:
        made: Any = self.function()
        if hasattr(made, "send"):
            # one that ends here says so with the first frame
            next(made, None)
            made = made.send
        of: Callable[[Any], Row] = getattr(made, "frame", made)
        return of

    def _begin_native(self, manifest: _native.Manifest) -> Callable[..., list[float]]:
        from ._recording import State

        of = self._begin()
        return lambda *state: self._row(of, State(manifest, state), len(self.columns))


def analysis(*, columns: Mapping[str, str], name: str | None = None) -> Callable[[Callable[[], Any]], Analysis]:
    """Makes an :class:`Analysis` of a class or a generator.

    A class is made without arguments for each run; its method ``frame`` takes a frame and gives a number for each column. A
    generator is sent the frames, and yields the row of each:

    >>> @analysis(columns={"travelled_m": "way that bead 0 has gone"})
    ... def travelled():
    ...     way = last = 0.0
    ...     while True:
    ...         frame = yield way
    ...         way += abs(frame.displacement_m[0] - last)
    ...         last = frame.displacement_m[0]
    >>> travelled.columns
    ['travelled_m']

    Args:
        columns: Names of the columns, which end in their units, and their meanings.
        name: Its name in sweeps, and on the bus ``own/NAME``; by default that of the class or generator.
    """
    return lambda make: Analysis(make, columns, name)


def _live_name(source: str | os.PathLike[str] | Recording) -> str | None:
    """The run after ``live:``, ``""`` for the only one; ``None`` if it is no live run."""
    if source == "live":
        return ""
    is_live = isinstance(source, str) and source.startswith("live:")
    return str(source).removeprefix("live:") if is_live else None


def _states(source: str | os.PathLike[str] | Recording, every_step: bool) -> Iterator[State]:
    from ._recording import Recording, open

    recording = source if isinstance(source, Recording) else open(source)
    return recording.states(1 if every_step else None)
