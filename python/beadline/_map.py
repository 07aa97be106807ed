"""Space and time as pictures of bounded size, and their colours."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._comparison import Difference
    from ._fields import FieldArray
    from ._native import Doubles, Numbers
    from ._recording import Recording

Steps = npt.NDArray[np.int64]

# doubles that are read at a time
_BLOCK_DOUBLES = 4_000_000


@dataclass(frozen=True)
class Map:
    """A field over space and time.

    Attributes:
        values: Its values (rows × columns), in SI units, beyond those at rest; NaN if unknown.
        places: The beads or contacts.
        from_s, until_s: Times of the first and of the last row (s).
        dt_s: The time step (s).
        is_loaded: True if the values at rest are subtracted.
    """

    values: Doubles
    places: range
    from_s: float
    until_s: float
    dt_s: float
    is_loaded: bool

    @property
    def extremes(self) -> tuple[float, float]:
        """The least and the largest value, and 0."""
        known = self.values[np.isfinite(self.values)]
        return float(known.min(initial=0.0)), float(known.max(initial=0.0))


def map_of(
    rec: Recording | Difference,
    array: FieldArray,
    places: range,
    rows: int,
    columns: int,
    *,
    during_s: tuple[float, float] | None = None,
    every: int | None = None,
    fewest: int = 0,
) -> Map:
    """A field in at most ``rows`` × ``columns`` values.

    A row is a recorded state or, where there are fewer than ``fewest`` of them, any; with ``every``
    one of so many steps. A column that stands for several places has the value farthest from 0.
    """
    inside = range(rec.first_step, rec.last_step + 1)
    if during_s is not None:
        # times that people write are those of steps; none is inside of NaN
        least_s, most_s = during_s[0] * (1 - 1e-12), during_s[1] * (1 + 1e-12)
        end = bisect_left(inside, True, key=lambda step: not step * rec.dt_s <= most_s)
        inside = inside[bisect_left(inside, True, key=lambda step: step * rec.dt_s >= least_s) : end]
    recorded: Steps = np.asarray(rec.recorded_steps, np.int64)
    recorded = recorded[(recorded >= inside.start) & (recorded < inside.stop)]
    is_computed = rec.recomputes and (every is not None or len(recorded) < fewest)
    known = inside[:: every or 1] if is_computed else recorded
    if not len(known):
        raise ValueError(f"during_s: found {during_s}; expected a time in which there is a state")
    rows = min(rows, len(known))
    wanted = np.linspace(known[0], known[-1], rows)
    steps = nearest(known, wanted)
    which, back = np.unique(steps, return_inverse=True)
    at_rest = {"overlap": "rest_overlap_m", "force": "rest_force_n"}.get(array.name)
    rest = getattr(rec, at_rest)[places.start : places.stop] if at_rest else np.zeros(1)
    values = _read(array, rows_of(rec, which), places, rest, min(columns, len(places)))[back]
    # where states are missing, the nearest is none of that time
    apart = max(rec.record_every, (wanted[-1] - wanted[0]) / rows)
    values[np.abs(steps - wanted) > apart] = np.nan
    times_s = wanted[[0, -1]] * rec.dt_s
    return Map(values, places, float(times_s[0]), float(times_s[1]), rec.dt_s, bool(rest.any()))


def rows_of(rec: Recording | Difference, steps: Steps) -> Steps:
    """Positions of steps on the first axis of the arrays of a recording."""
    if isinstance(rec.steps, range):
        return (steps - rec.steps.start) // rec.steps.step
    return np.searchsorted(rec.steps, steps).astype(np.int64)


def multiples(steps: range | Numbers, every: int) -> range | Numbers:
    """The multiples of ``every`` among steps that ascend.

    Raises:
        ValueError: If there are none.
    """
    first, last = int(steps[0]), int(steps[-1])
    begin = -(-first // every) * every
    found: range | Numbers = range(begin, last + 1, every) if isinstance(steps, range) else steps[steps % every == 0]
    if not len(found):
        raise ValueError(f"every: found {every}; allowed: numbers with a multiple from step {first} to {last}, where there are states")
    return found


def nearest(known: range | Steps, wanted: Doubles) -> Steps:
    """The nearest of ``known``, which ascend, to each number."""
    if isinstance(known, range):
        at = known.start + ((wanted - known.start) / known.step).round() * known.step
        return at.astype(np.int64).clip(known[0], known[-1])
    after = np.searchsorted(known, wanted).clip(0, len(known) - 1)
    before = (after - 1).clip(0)
    nearest: Steps = np.where(
        wanted - known[before] < known[after] - wanted, known[before], known[after]
    )
    return nearest


def _read(array: FieldArray, rows: Steps, places: range, rest: Doubles, columns: int) -> Doubles:
    begins = np.arange(columns) * len(places) // columns
    found = np.empty((len(rows), columns))
    at_once = max(1, _BLOCK_DOUBLES // len(places))
    for begin in range(0, len(rows), at_once):
        block = slice(begin, begin + at_once)
        values = np.asarray(array[rows[block], places.start : places.stop]) - rest
        low = np.minimum.reduceat(values, begins, axis=1)
        high = np.maximum.reduceat(values, begins, axis=1)
        found[block] = np.where(-low > high, low, high)
    return found


@dataclass(frozen=True)
class Shades:
    """A scale from numbers to shades from −1 to 1: white for 0, and darker farther from it.

    Attributes:
        limit: The number that has the darkest shade.
        log_beyond: From this number on shades follow the logarithm; None: in proportion.
    """

    limit: float
    log_beyond: float | None = None

    def of(self, values: Any) -> Any:
        """The shades of numbers."""
        if self.log_beyond is None:
            return np.asarray(values) / self.limit
        parts = np.log1p(np.abs(values) / self.log_beyond) / np.log1p(self.limit / self.log_beyond)
        return np.copysign(parts, values)

    def numbers(self, shades: Any) -> Any:
        """The numbers of shades."""
        if self.log_beyond is None:
            return np.asarray(shades) * self.limit
        parts = np.expm1(np.abs(shades) * np.log1p(self.limit / self.log_beyond)) * self.log_beyond
        return np.copysign(parts, shades)


def shades_of(low: float, high: float, is_log: bool) -> Shades:
    """Shades for numbers from ``low`` to ``high``, which have 0 between them."""
    limit = max(high, -low) or 1.0
    if not is_log:
        return Shades(limit)
    # three decades below the sign that reaches less far, or four below the other if that is more
    return Shades(limit, max(1e-3 * min(high, -low), 1e-4 * limit))


def diverging(shades: Doubles) -> Doubles:
    """The colours of shades as sRGB from 0 to 1, as the command has them.

    Lightness falls evenly from white for 0, to blue below and to red above.
    """
    parts = np.abs(shades)
    return _coloured(shades, 1.0 - 0.6 * parts, 0.13 * parts * (2.0 - parts))


def see_through(shades: Doubles) -> Doubles:
    """Colours of shades as sRGB and opacity, for white and black grounds: 0 is not seen."""
    colours = _coloured(shades, np.full(shades.shape, 0.6), np.full(shades.shape, 0.15))
    return np.concatenate([colours, np.abs(shades)[:, None]], axis=1)


def _coloured(shades: Doubles, lightness: Doubles, chroma: Doubles) -> Doubles:
    """Colours in OKLab: B. Ottosson, A perceptual color space for image processing (2020)."""
    hue = np.radians(np.where(shades < 0, 255.0, 38.0))
    a, b = chroma * np.cos(hue), chroma * np.sin(hue)
    cones = np.stack(
        [
            lightness + 0.3963377774 * a + 0.2158037573 * b,
            lightness - 0.1055613458 * a - 0.0638541728 * b,
            lightness - 0.0894841775 * a - 1.2914855480 * b,
        ],
        axis=-1,
    )
    to_light = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    light = (cones**3 @ to_light.T).clip(0.0, 1.0)
    srgb: Doubles = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return srgb
