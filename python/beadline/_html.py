"""Views of recordings, runs, states and tables in notebooks."""

from __future__ import annotations

import base64
import html as markup
import time
import zlib
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ._chain import exponents_in_words
from ._map import map_of, see_through, shades_of

if TYPE_CHECKING:
    from ._comparison import Comparison, Difference
    from ._recording import Recording, State
    from ._run import Run
    from ._table import Table

# of a summary: most pixels of its map, and most doubles that are read for it
_SMALL_ROWS, _SMALL_COLUMNS, _SMALL_DOUBLES = 180, 360, 20_000_000
# most of its PNG; of noise it has fewer rows
_SMALL_BYTES = 20_000
# of a run that is computed for its map: most time (s), and steps of single beads from one look at the clock to the next
_SMALL_S, _SMALL_WORK = 0.1, 100_000

# rows that a table shows of itself at most, and of a longer one at its begin and at its end
_ALL_SHOWN, _SHOWN = 30, 5
# characters of a value of a manifest
_SHORT = 60


def of_recording(rec: Recording) -> str:
    """A summary of a recording for a notebook, with a small map.

    It never fails: it describes a file that cannot be read.
    """
    try:
        rows = _rows(_summary(rec))
    except Exception as error:
        rows = f"<tr><td>{markup.escape(f'{type(error).__name__}: {error}')}</td></tr>"
    return _beside(rows, lambda: _small_map(rec))


def _beside(rows: str, draw: Callable[[], str]) -> str:
    """A table, and a picture if it can be drawn."""
    try:
        picture = draw()
    except Exception as error:
        picture = f"<em>no map: {markup.escape(f'{type(error).__name__}: {error}')}</em>"
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f"<table>{rows}</table><div>{picture}</div></div>"
    )


def _summary(rec: Recording) -> list[tuple[str, object]]:
    about, physics = rec.about, rec.manifest["physics"]
    times_ms = 1e3 * rec.first_step * rec.dt_s, 1e3 * rec.last_step * rec.dt_s
    ended = about["end"] or ("not finished: it goes on, or was cut short" if rec.path else "")
    every = f"{rec.record_every:,} steps" if rec.record_every > 1 else "step"
    rows: list[tuple[str, object]] = [
        ("run", rec.name),
        ("chain", f"{rec.beads:,} beads{exponents_in_words(physics)}"),
        ("steps", f"{rec.first_step:,} to {rec.last_step:,} of {rec.dt_s:.4g} s"),
        ("time", f"{times_ms[0]:.4g} to {times_ms[1]:.4g} ms"),
        ("states kept", f"{about['states']:,}, one every {every}"),
        ("other steps", "recomputed when asked for" if rec.recomputes else "need another Beadline"),
        ("ended", ended),
        ("size", f"{_size(about['bytes'])}{'' if rec.path else ' in memory'}"),
    ]
    rows += [("file", rec.path)] if rec.path else []
    return rows + ([("damage", about["damage"])] if about["damage"] else [])


def _size(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:,.2f} MB" if size_bytes >= 1e6 else f"{size_bytes / 1e3:,.1f} kB"


def _small_map(rec: Recording | Difference) -> str:
    rows = min(_SMALL_ROWS, max(2, _SMALL_DOUBLES // rec.beads))
    drawn = map_of(rec, rec.velocity, range(rec.beads), rows, _SMALL_COLUMNS)
    low, high = drawn.extremes
    shades = np.nan_to_num(shades_of(low, high, is_log=True).of(drawn.values))
    pixels = (127 + (127 * shades).round()).astype(np.uint8)
    colours = (255 * see_through(np.linspace(-1, 1, 255))).round().astype(np.uint8)
    data = png(pixels, colours)
    while len(data) > _SMALL_BYTES:
        pixels = pixels[::2]
        data = png(pixels, colours)
    said = f"velocity over beads (across) and time (down), from {low:.3g} to {high:.3g} m/s"
    style = f"width:{_SMALL_COLUMNS}px;height:{_SMALL_ROWS}px;border:1px solid #8888"
    # a bead that has several pixels has edges
    style += ";image-rendering:pixelated" if rec.beads < _SMALL_COLUMNS / 2 else ""
    image = f'<img alt="{said}" style="{style}" src="data:image/png;base64,{base64.b64encode(data).decode()}">'
    return f"{image}<br><small>{said}</small>"


def png(pixels: npt.NDArray[np.uint8], colours: npt.NDArray[np.uint8]) -> bytes:
    """A PNG of pixels (rows × columns) that are numbers of colours (n × sRGB and opacity)."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = zlib.crc32(kind + data).to_bytes(4, "big")
        return len(data).to_bytes(4, "big") + kind + data + check

    height, width = pixels.shape
    # 8 bits a pixel, of a palette
    head = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([8, 3, 0, 0, 0])
    # each row begins with its filter: none
    rows = np.pad(pixels, ((0, 0), (1, 0))).tobytes()
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        [
            chunk(b"IHDR", head),
            chunk(b"PLTE", colours[:, :3].tobytes()),
            chunk(b"tRNS", colours[:, 3].tobytes()),
            chunk(b"IDAT", zlib.compress(rows)),
            chunk(b"IEND", b""),
        ]
    )


def _rows(rows: Iterable[tuple[str, object]]) -> str:
    # the file may be of a stranger: nothing in it is markup
    return "".join(
        f'<tr><th style="text-align:left">{markup.escape(name)}</th><td style="text-align:left">{markup.escape(str(value))}</td></tr>'
        for name, value in rows
    )


def of_run(run: Run) -> str:
    """A run in a few lines, with a small map if it is computed at once."""
    physics = run.manifest["physics"]
    strikers = [physics["striker"], *physics.get("strikers", [])]
    struck = ", ".join(f"bead {one['bead']} at {one['velocity_m_s']:g} m/s" for one in strikers if one["velocity_m_s"])
    rows: list[tuple[str, object]] = [
        ("run", run.name),
        ("chain", f"{physics['beads']:,} beads{exponents_in_words(physics)}"),
        ("strikers", struck or "none"),
        ("steps", f"{run.steps:,} of {run.dt_s:.4g} s, {physics['method']}"),
        ("time", f"{1e3 * run.steps * run.dt_s:.4g} ms, {run.steps * run.dt_s / run.collision_time_s:,.0f} T"),
    ]
    return _beside(_rows(rows), lambda: _map_of_run(run))


def _map_of_run(run: Run) -> str:
    frames = _SMALL_WORK // (run._manifest.beads * run._manifest.publish_every_steps)
    until = time.monotonic() + _SMALL_S
    if frames:
        rec = run.simulate(
            every=max(1, run.steps // _SMALL_ROWS),
            on_frame=lambda _: time.monotonic() > until,
            on_frame_every=frames,
            progress=False,
            yes=True,
        )
        if rec.last_step == run.steps:
            return _small_map(rec)
    return "<em>no map yet: run.simulate() and run.record() make one</em>"


def of_comparison(comparison: Comparison) -> str:
    """Two recordings in a few lines, with a small map of their difference."""
    changes = list(comparison.changes.items())
    rows: list[tuple[str, object]] = [("a", repr(comparison.a)), ("b", repr(comparison.b))]
    rows += [(key, f"{_short(a)} in a, {_short(b)} in b") for key, (a, b) in changes[:_SHOWN]]
    rows += [("further keys", f"{len(changes) - _SHOWN:,} differ")] if len(changes) > _SHOWN else []
    return _beside(_rows(rows), lambda: f"a − b<br>{_small_map(comparison.difference)}")


def _short(value: object) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= _SHORT else f"{text[:_SHORT]}…"


def of_state(state: State) -> str:
    """A state in a few lines."""
    speed, overlap = np.abs(state.velocity_m_s), state.overlap_m
    rows: list[tuple[str, object]] = [
        ("step", f"{state.step:,}, {1e3 * state.time_s:.6g} ms"),
        ("beads", f"{speed.size:,}"),
        ("fastest", f"bead {speed.argmax()}, {state.velocity_m_s[speed.argmax()]:.6g} m/s"),
        ("most compressed", f"contact {overlap.argmax()}, {overlap.max():.6g} m"),
        ("energy", f"{state.kinetic_j:.6g} J kinetic, {state.potential_j:.6g} J potential"),
    ]
    return f"<table>{_rows(rows)}</table>"


def of_table(table: Table) -> str:
    """The first and the last rows of a table."""

    def row(tag: str, cells: Iterable[object]) -> str:
        written = (f"<{tag}>{markup.escape(str(cell))}</{tag}>" for cell in cells)
        return f"<tr>{''.join(written)}</tr>"

    def values(index: int) -> list[object]:
        found = (column[index] for column in table.values())
        return [index, *(f"{cell:.6g}" if isinstance(cell, float) else cell for cell in found)]

    count = len(table)
    shown = [range(_SHOWN), range(count - _SHOWN, count)]
    if count <= _ALL_SHOWN:
        shown = [range(count)]
    between = row("td", ["…"] * (1 + len(table.keys())))
    body = between.join("".join(row("td", values(index)) for index in part) for part in shown)
    return f"<table style='white-space:nowrap'>{row('th', ['', *table])}{body}</table><p>{count:,} rows</p>"
