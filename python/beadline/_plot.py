"""Figures of recordings and of tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from ._chain import number_if_any
from ._extras import need
from ._fields import FIELDS
from ._map import Map, Shades, diverging, map_of, shades_of
from ._numbers import count, in_si, name_and_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._comparison import Comparison
    from ._fields import FieldArray
    from ._native import Doubles
    from ._recording import Recording, State
    from ._table import Table

Scale = Literal["log", "linear"]

# Okabe and Ito, Color Universal Design (2008): colours that colour-blind readers can tell apart
_CURVES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
_GREY = "#808080"

# of a figure: most pixels of a map, and fewest recorded states that make a fine one
_MOST_ROWS, _MOST_COLUMNS, _FINE_ROWS = 600, 1000, 300

# columns of a map that need no pixels of their own to be sharp
_SHARP_COLUMNS = 1000

# most impurities, and most beads, that are marked one by one
_MOST_LINES, _MOST_DISCS = 8, 60

# of a table, most curves whose legend is among them
_FEW_CURVES = 4

# of fewer beads, ticks between those with numbers would be between beads
_FEW_PLACES = 50

# how much farther than the others those displacements are that are not shown
_FAR = 3.0

_STATE_NAMES = {
    "velocity": "velocity_m_s",
    "displacement": "displacement_m",
    "overlap": "overlap_m",
    "force": "force_n",
    "resonator_displacement": "resonator_displacement_m",
    "resonator_velocity": "resonator_velocity_m_s",
}


def _array(rec: Recording, field: str) -> FieldArray:
    if field not in _STATE_NAMES:
        raise ValueError(f"field: found {field!r}; expected one of {', '.join(_STATE_NAMES)}")
    array: FieldArray = getattr(rec, field)
    return array


def plot(
    rec: Recording,
    field: str = "velocity",
    *,
    ax: Axes | None = None,
    step: int | Sequence[int] | None = None,
    time_s: float | Sequence[float] | None = None,
    during_s: tuple[float, float] | None = None,
    beads: slice | None = None,
    every: int | None = None,
    scale: Scale | None = None,
    limit: float | None = None,
) -> Axes:
    """Draws a field over space and time or, with ``step`` or ``time_s``, along the chain.

    A map has at most 600 rows, each of them a state: the recorded ones or, where there are fewer
    than 300, computed ones. A pixel that stands for several beads has the value farthest from 0,
    so that no pulse is lost between them.

    Args:
        field: ``"velocity"``, ``"displacement"``, ``"overlap"``, ``"force"``,
            ``"resonator_displacement"`` or ``"resonator_velocity"``. A map of a chain under load
            shows overlaps and forces beyond those at rest.
        ax: Axes to draw in; by default those of a new figure.
        step: A step, or several.
        time_s: A time (s), or several.
        during_s: First and last time of a map (s).
        beads: The beads, or contacts, that are shown: ``slice(400, 600)``.
        every: For a map: take one of so many steps, recorded or not.
        scale: For a map: ``"linear"`` for colours in proportion to numbers, ``"log"`` to show weak
            pulses beside strong ones; by default linear for displacements only.
        limit: End of the colours, or of the axis of values, on both sides of 0 (in the SI unit); by
            default that of the values, of which displacements that are far from the others, and gaps far
            wider than overlaps, lie beyond it; a profile says how many.
    """
    array = _array(rec, field)
    if step is not None and time_s is not None:
        raise ValueError("found step and time_s; expected one of them")
    # bonds push and pull
    has_gaps = field == "overlap" and not rec.manifest["physics"].get("bonds")
    of_map = {"during_s": during_s, "every": every, "scale": scale}
    beside = [name for name, value in of_map.items() if value is not None]
    if beside and (step is not None or time_s is not None):
        profile = "step" if step is not None else "time_s"
        raise ValueError(f"{beside[0]}: found beside {profile}, which draws along the chain; expected it of a map only")
    every = None if every is None else count("every", every)
    time_s, during_s = in_si("time_s", time_s), _period("during_s", during_s)
    limit = number_if_any("limit", limit, array.unit)
    if limit is not None and not 0.0 < limit < math.inf:
        raise ValueError(f"limit: found {limit}; expected a number above 0, the end on both sides")
    if scale not in (None, "log", "linear"):
        raise ValueError(f"scale: found {scale!r}; expected 'log' or 'linear'")
    every_place = range(array.shape[1])
    is_part = isinstance(beads, slice) and beads.step in (None, 1)
    places = every_place[beads] if isinstance(beads, slice) and is_part else every_place
    if beads is not None and not is_part or not places:
        raise ValueError(
            f"beads: found {beads}; expected neighbours from 0 to {array.shape[1] - 1}, such as "
            f"slice(0, {array.shape[1]})"
        )
    states: list[State] | None = None
    if step is not None:
        states = [rec[one] for one in np.atleast_1d(step)]
    elif time_s is not None:
        states = [rec.at(time_s=float(one)) for one in np.atleast_1d(time_s)]
    if states is not None and not states:
        raise ValueError(f"{'time_s' if step is None else 'step'}: found none; expected one or more")
    axes: Any = ax
    if ax is None:
        size = (6.4, 5.0) if states is None else (6.4, 3.6)
        axes = need("matplotlib.pyplot").subplots(figsize=size, layout="constrained")[1]
    if states is None:
        drawn = map_of(
            rec,
            array,
            places,
            _MOST_ROWS,
            _MOST_COLUMNS,
            during_s=during_s,
            every=every,
            fewest=_FINE_ROWS,
        )
        _draw_map(axes, drawn, field, array.unit, scale, limit, has_gaps and not rec.rest_force_n.any())
    else:
        _draw_profiles(axes, rec, states, field, array.unit, places, limit, has_gaps)
    about = rec.name
    if states is not None and len(states) == 1:
        about = f"{rec.name}, {_at(states[0])} (step {states[0].step:,})"
    axes.set_title(about, loc="left", fontsize="small", color=_GREY, parse_math=False)
    axes.set_xlabel(FIELDS[field][1])
    ticker: Any = need("matplotlib.ticker")
    # as many as there is room for
    most = 10 if places.stop < 10_000 else 5
    axes.xaxis.set_major_locator(ticker.MaxNLocator(most, integer=True, steps=[1, 2, 5, 10]))
    axes.minorticks_on()
    if len(places) < _FEW_PLACES:
        axes.xaxis.set_minor_locator(ticker.NullLocator())
    found: Axes = axes
    return found


def _period(key: str, times_s: Any) -> tuple[float, float] | None:
    """The first and the last time (s), if any."""
    if times_s is None:
        return None
    found = np.asarray(in_si(key, times_s))
    if found.shape != (2,) or found.dtype.kind not in "iuf":
        raise ValueError(f"{key}: found {times_s!r}; expected the first and the last time (s), such as (0.01, 0.02)")
    first_s, last_s = found.tolist()
    return first_s, last_s


def _prefix(largest: float, unit: str) -> tuple[str, float]:
    """The unit in which a number is shown as 1 to 1000, and the factor to it."""
    # most velocities are some m/s
    if not largest or (unit == "m/s" and largest >= 0.1):
        return unit, 1.0
    prefixes = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))
    factor, letter = next((one for one in prefixes if largest * one[0] >= 1), prefixes[-1])
    return letter + unit, factor


def _draw_map(
    ax: Any, drawn: Map, field: str, unit: str, scale: Scale | None, limit: float | None, has_gaps: bool = False
) -> None:
    colors: Any = need("matplotlib.colors")
    ticker: Any = need("matplotlib.ticker")
    least, largest = drawn.extremes
    is_log = field != "displacement" if scale is None else scale == "log"
    if limit is None:
        low, high = _bulk(field, drawn.values, is_log, has_gaps)
        # as far on the other side, if something is there
        end = max(high, -low)
        low, high = max(-end, least), min(end, largest) if largest > least else 1.0
    else:
        low, high = -limit, limit
    unit, factor = _prefix(max(high, -low), unit)
    low, high = low * factor, high * factor
    shades = shades_of(low, high, is_log)
    norm = colors.FuncNorm((shades.of, shades.numbers), vmin=low, vmax=high)
    spread: Doubles = np.linspace(float(shades.of(low)), float(shades.of(high)), 1021)
    colours = colors.ListedColormap(diverging(spread)).with_extremes(bad="#e4e4e4")
    # several pixels for a bead, so that its edges are sharp while those of many beads are smooth
    values = factor * drawn.values.repeat(-(-_SHARP_COLUMNS // drawn.values.shape[1]), axis=1)
    from_ms, until_ms = 1e3 * drawn.from_s, 1e3 * drawn.until_s
    half_ms = (until_ms - from_ms) / max(len(values) - 1, 1) / 2 or 0.5e3 * drawn.dt_s
    sides = (
        drawn.places.start - 0.5,
        drawn.places.stop - 0.5,
        until_ms + half_ms,
        from_ms - half_ms,
    )
    # colours are mixed rather than numbers, of which those of opposite signs would make a 0
    kind = {"aspect": "auto", "interpolation_stage": "rgba"}
    image = ax.imshow(values, cmap=colours, norm=norm, extent=sides, **kind)
    if len(values) > 1:
        ax.set_ylim(until_ms, from_ms)
    ax.set_ylabel("time (ms)")
    beyond = {
        (False, False): "neither",
        (True, False): "min",
        (False, True): "max",
        (True, True): "both",
    }
    extend = beyond[least * factor < low, largest * factor > high]
    label = f"{field}{' beyond rest' if drawn.is_loaded else ''} ({unit})"
    bar = ax.figure.colorbar(
        image, ax=ax, label=label, pad=0.02, aspect=30, extend=extend, extendfrac=0.02
    )
    bar.minorticks_off()
    if shades.log_beyond is not None:
        bar.set_ticks(_decades(shades, low, high))
        bar.formatter = ticker.FuncFormatter(_plain)
        bar.update_ticks()


def plot_comparison(
    comparison: Comparison, field: str, during_s: tuple[float, float] | None, scale: Scale | None
) -> Sequence[Axes]:
    """Draws maps of two recordings with the same colours, and of their difference, beside each other."""
    if field not in ("velocity", "displacement"):
        raise ValueError(f"field: found {field!r}; expected 'velocity' or 'displacement'")
    difference, unit = comparison.difference, FIELDS[field][0]
    during_s = _period("during_s", during_s) or (difference.first_step * difference.dt_s, difference.last_step * difference.dt_s)
    titles = (f"a: {comparison.a.name}", f"b: {comparison.b.name}", "a − b")
    maps = [
        map_of(one, getattr(one, field), range(one.beads), _MOST_ROWS, _MOST_COLUMNS, during_s=during_s, fewest=_FINE_ROWS)
        for one in (comparison.a, comparison.b, difference)
    ]
    is_log = field != "displacement" if scale is None else scale == "log"
    limit = max(abs(end) for drawn in maps[:2] for end in _bulk(field, drawn.values, is_log)) or None
    subplots = need("matplotlib.pyplot").subplots
    figure, axes = subplots(1, 3, figsize=(13.0, 4.2), sharex=True, sharey=True, layout="constrained")
    figure.get_layout_engine().set(wspace=0.06)
    for ax, drawn, title in zip(axes, maps, titles, strict=True):
        _draw_map(ax, drawn, field, unit, scale, None if title == "a − b" else limit)
        ax.set_title(title, loc="left", fontsize="small", color=_GREY, parse_math=False)
        ax.set_xlabel("bead")
        ax.label_outer()
    drawn_on: Sequence[Axes] = axes
    return drawn_on


def _plain(value: float, position: int | None = None) -> str:
    """A power of ten without zeros that say nothing."""
    return f"{value:g}".replace("-", "−")


def _decades(shades: Shades, low: float, high: float) -> list[float]:
    """0 and powers of ten between ``low`` and ``high``, as many as have room."""
    first, last = math.log10(shades.log_beyond or 1.0), math.log10(shades.limit)
    powers = [10.0**power for power in range(math.ceil(first), math.floor(last + 1e-9) + 1)]
    apart = 0.05 * (shades.of(high) - shades.of(low))
    kept = [0.0]
    for number in [*powers[::-1], *(-power for power in powers[::-1])]:
        if low <= number <= high and np.abs(shades.of(number) - shades.of(kept)).min() > apart:
            kept.append(number)
    return kept


def _bulk(field: str, values: Doubles, is_log: bool = False, has_gaps: bool = False) -> tuple[float, float]:
    """The values that are shown.

    All displacements but a fiftieth at either end, if they are linear and those are far away: the
    struck end flies off, and the rest would be flat beside it. No gap much wider than the largest
    overlap, where a negative number is a gap.
    """
    known = values[np.isfinite(values)]
    low, high = float(known.min()), float(known.max())
    if field == "displacement" and not is_log and low < high:
        # what has not moved yet says nothing about how far the others have
        ends = np.quantile(known[known != 0.0], [0.02, 0.98])
        near = min(0.0, float(ends[0])), max(0.0, float(ends[1]))
        # a range that is next to nothing is the tail of a front
        if 1e9 * (near[1] - near[0]) > high - low > _FAR * (near[1] - near[0]):
            low, high = near
    return (-high, high) if has_gaps and 0 < 1.2 * high < -low else (low, high)


def _at(state: State) -> str:
    return f"t = {1e3 * state.time_s:.4g} ms"


def _draw_profiles(
    ax: Any,
    rec: Recording,
    states: Sequence[State],
    field: str,
    unit: str,
    places: range,
    limit: float | None,
    has_gaps: bool,
) -> None:
    curves = [
        np.asarray(getattr(state, _STATE_NAMES[field]))[places.start : places.stop]
        for state in states
    ]
    low, high = _bulk(field, np.asarray(curves), has_gaps=has_gaps)
    unit, factor = _prefix(max(abs(low), abs(high)), unit)
    mark = "o" if len(places) <= _MOST_DISCS else ""
    for state, values, colour in zip(states, curves, _CURVES * len(states), strict=False):
        label = _at(state) if len(states) > 1 else field
        ax.plot(places, values * factor, color=colour, lw=1.2, marker=mark, ms=3, label=label)
    rest = {"overlap": rec.rest_overlap_m, "force": rec.rest_force_n}.get(field)
    is_loaded = rest is not None and bool(rest.any())
    if rest is not None and is_loaded:
        ax.plot(
            places,
            rest[places.start : places.stop] * factor,
            "--",
            color=_GREY,
            lw=0.8,
            label="at rest",
        )
    # between its two contacts, where these are shown
    half = 0.5 if FIELDS[field][1] == "contact" else 0.0
    impurities = [
        impurity["bead"] - half for impurity in rec.manifest["physics"].get("impurities", [])
    ]
    impurities = [x for x in impurities if places.start <= x < places.stop]
    if len(impurities) <= _MOST_LINES:
        for number, x in enumerate(impurities):
            name = "impurity" if len(impurities) == 1 else "impurities"
            ax.axvline(
                x, color=_GREY, lw=0.8, ls=":", zorder=0, label=name if number == 0 else None
            )
    if len(states) > 1 or is_loaded or impurities:
        ax.legend(frameon=False, fontsize="small")
    room = 0.5 if mark else 0.0
    ax.set_xlim(places.start - room, places.stop - 1 + room)
    if limit is not None:
        ax.set_ylim(-limit * factor, limit * factor)
    elif low < high:
        low, high = low - 0.1 * (high - low), high + 0.1 * (high - low)
        ax.set_ylim(low * factor, high * factor)
        values = np.concatenate(curves)
        beyond = values[(values < low) | (values > high)]
        if beyond.size:
            places_beyond = FIELDS[field][1] + ("s" if beyond.size > 1 else "")
            farthest = beyond[np.abs(beyond).argmax()] * factor
            note = f"{beyond.size} {places_beyond} beyond the frame, as far as {_plain(float(f'{farthest:.3g}'))} {unit}"
            ax.text(0.02, 0.97, note, transform=ax.transAxes, va="top", fontsize="small", color=_GREY)
    ax.set_ylabel(f"{field} ({unit})")


def plot_table(table: Table, y: str | Sequence[str] | None, x: str | None, ax: Axes | None) -> Axes:
    """Draws columns of a table over another one."""
    units = table.units
    below = x or ("time_s" if "time_s" in table else next(iter(table), ""))
    numbers = [name for name in table if table[name].dtype.kind in "if" and name not in ("frame", "step", below)]
    if y is None:
        y = [name for name in numbers if units[name] == units[numbers[-1]]] if numbers else []
    names = [y] if isinstance(y, str) else list(y)
    columns = {name: table[name] for name in [below, *names]}
    found = {units[name] for name in names}
    if len(found) != 1 or any(column.dtype.kind not in "if" for column in columns.values()):
        said = ", ".join(sorted(found)) or "no column"
        raise ValueError(f"y: found {said}; expected columns of numbers of one unit, such as {numbers[-1:]}")
    axes: Any = ax
    if ax is None:
        axes = need("matplotlib.pyplot").subplots(figsize=(6.4, 3.6), layout="constrained")[1]
    for number, name in enumerate(names):
        colour, dashes = _CURVES[number % len(_CURVES)], ("-", "--", ":")[number // len(_CURVES) % 3]
        axes.plot(columns[below], columns[name], dashes, color=colour, lw=1.2, label=_words(name))
    axes.set_xlabel(_label(_words(below), units[below]))
    axes.set_ylabel(_label(_words(names[0]), units[names[0]]) if len(names) == 1 else units[names[0]])
    if len(names) > 1:
        # beside the curves where it would hide them
        place = {} if len(names) <= _FEW_CURVES else {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
        axes.legend(frameon=False, fontsize="small", **place)
    drawn: Axes = axes
    return drawn


def _words(name: str) -> str:
    return name_and_unit(name)[0].replace("_", " ")


def _label(words: str, unit: str) -> str:
    return f"{words} ({unit})".strip() if unit else words
