"""Numbers as users give them: with units, or whole; and the units that names end with."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from datetime import timedelta
from typing import Any

import numpy as np

from .errors import ConfigError

_SYMBOLS = {"n": "N", "j": "J", "w": "W", "hz": "Hz", "pa": "Pa", "k": "K"}
_ONE = r"(?:kg|hz|pa|rad|beads|[msnjkw])[23]?"
_ENDS = re.compile(rf"(?:^|.*?[^_]_)((?:{_ONE}_)*(?:{_ONE}|per_(?:{_ONE}|bead)))")


def name_and_unit(name: str) -> tuple[str, str | None]:
    """The name of a key or of a column without its unit, and that: ``gravity`` and ``m/s**2`` of ``gravity_m_s2``. None if it has none. A place
    stays: ``impulse@5`` of ``impulse_n_s@5``."""
    name, at, place = name.partition("@")
    name = name.rpartition(".")[2]
    found = _ENDS.fullmatch(name)
    if found is None or found[1] == name:
        return name + at + place, None
    above, _, below = found[1].partition("per_")
    factors = [_symbol(part) for part in above.split("_") if part]
    divisors = [_symbol(below)] if below else []
    if not below:
        # m_s is a velocity, n_s and kg_m_s are momenta
        over = 2 if re.fullmatch(r"n_s|kg(\d?)_m\1_s\1", found[1]) else 1
        factors, divisors = factors[:over], factors[over:]
    return name[: found.start(1) - 1] + at + place, "/".join(["*".join(factors) or "1", *divisors])


def unit_of(name: str) -> str | None:
    """The unit that the name of a key or of a column ends with, such as ``m/s**2`` of ``gravity_m_s2``; None if it has none."""
    return name_and_unit(name)[1]


def _symbol(part: str) -> str:
    name, power = (part[:-1], f"**{part[-1]}") if part[-1] in "23" else (part, "")
    return _SYMBOLS.get(name, name) + power


def shown(unit: str) -> str:
    """A unit as people write it."""
    return unit.replace("**2", "²").replace("**3", "³").replace("**", "^").replace("*", "·")


def count(name: str, value: Any, least: int = 1) -> int:
    """A whole number, at least ``least``, that 64 bits hold; 1e3 is one, too.

    Raises:
        ValueError: If it is none.
    """
    number, is_whole = 0, False
    with suppress(OverflowError, TypeError, ValueError):
        number = int(value)
        is_whole = number == value
    if not is_whole:
        raise ValueError(f"{name}: found {value!r}; expected a whole number")
    if not least <= number < 2**63:
        raise ValueError(f"{name}: found {value!r}; expected {least} or more{' below 2^63' if number > least else ''}")
    return number


def in_si(key: str, value: Any, unit: str | None = None) -> Any:
    """A value without units, in the unit that its key ends with, or else in ``unit``, that of what it is part of.

    Raises:
        ConfigError: If it has a unit that cannot be converted to that.
    """
    unit = unit_of(key) or unit
    if isinstance(value, Mapping):
        return {name: in_si(f"{key}.{name}" if key else str(name), part, unit) for name, part in value.items()}
    if isinstance(value, list | tuple):
        is_plain = all(type(part) in (float, int) for part in value)
        return value if is_plain else [in_si(key, part, unit) for part in value]
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [in_si(key, part, unit) for part in value]
    has = _unit_that_has(value)
    if isinstance(value, timedelta) and unit == "s":
        return value.total_seconds()
    if has is None or unit is not None and has in (unit, shown(unit)):
        return value if has is None else np.asarray(getattr(value, "magnitude", value))[()]
    in_roots: Any = getattr(value, "to_root_units", None)
    root = in_roots() if unit == "Hz" and in_roots is not None else None
    if root is not None and "radian" in str(root.units):
        # pint takes a radian for 1, and a turn has 2π of them
        return np.asarray(root.magnitude / (2 * np.pi))[()]
    try:
        convert: Any = getattr(value, "to")  # noqa: B009
        converted = convert("" if unit is None else unit)
        return np.asarray(converted.magnitude if hasattr(converted, "magnitude") else converted.value)[()]
    except Exception as error:
        wanted = "a number" if unit is None else f"a number, or a quantity that is a multiple of {shown(unit)}"
        raise ConfigError(f"{key}: found {value!s}, in {has or 'no unit'}; expected {wanted}", key=key) from error


def _unit_that_has(value: Any) -> str | None:
    """The unit of a quantity of pint, astropy, unyt and others; None of what is no quantity."""
    if isinstance(value, bool | int | float | str | None):
        return None
    if isinstance(value, timedelta):
        return "s"
    if getattr(getattr(value, "dtype", None), "kind", "") == "m":
        return str(value.dtype)
    attributes = getattr(value, "attrs", None)
    found = attributes.get("units") if isinstance(attributes, Mapping) else None
    for holder in (value, getattr(value, "dtype", None)):
        for name in ("units", "unit"):
            found = getattr(holder, name, None) if found is None else found
    is_quantity = found is not None and not callable(found) or hasattr(value, "to_base_units")
    return str(found) if is_quantity else None
