"""Chains and their parts."""

from __future__ import annotations

from collections.abc import ItemsView, Mapping, Sequence
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ._numbers import in_si
from .errors import ConfigError


class Quantity(Protocol):
    """A number, or an array, with a unit: of pint, astropy, unyt and others."""

    def to(self, unit: Any, /) -> Any:
        """The same in another unit."""


Config = dict[str, Any]
Number = float | Quantity
Values = Sequence[float] | npt.NDArray[np.floating[Any]]
# a number, a value for each place, or a rule such as {"pattern": [1, 2]}
PerPlace = Number | Values | Mapping[str, Any]


class Chain:
    """A chain of beads. By default beads that touch repel with ``F = k·δ^α``; CONFIGURATION explains all other kinds.

    Args:
        beads: Number of beads N.
        mass_kg: Mass of a bead (kg), or of each bead (N values). Like ``alpha`` and ``stiffness`` it may be left out with
            ``spheres``, and the last two with ``bonds``.
        alpha: Exponent α ≥ 1; 1.5 for spheres.
        stiffness: Stiffness k of a contact (N·m^−α), or of each contact (N − 1 values).
        impurities: Beads of another mass, ``{bead: mass in kg}``.
        contacts: Contacts of another stiffness, ``{contact: stiffness}``.
        masses: A rule for all masses: ``{"pattern_kg": [1e-3, 2e-3]}`` repeats; with ``{"taper": 0.98}`` each bead has that
            part of the mass of the one before.
        stiffnesses: A rule for all stiffnesses: ``"radii"`` (spheres of one material), or ``{"pattern": [1e7, 2e7]}``.
        spheres: Spheres of a material: ``{"material": "steel", "radius_m": 4.75e-3}``, or several that repeat.
        odd_spheres: Single other spheres: ``[{"bead": 30, "material": "brass", "radius_m": 4.75e-3}]``.
        alphas: Exponents of the contacts: a number, N − 1 values, or ``{"pattern": [1.5, 2]}``.
        second: A second power that is added to every force: ``{"alpha": 3, "stiffness": 1e12}``.
        gaps_m: Gap of each contact (m) where both displacements are 0: a number, N − 1 values, or a pattern.
        bonds: Springs that pull as well as push, in place of contacts: ``{"linear": 1.0, "quadratic": 0.25, "cubic": 0.0}``, or
            ``{"toda": {"stiffness": 1.0, "steepness_per_m": 1.0}}``.
        disorder: Random factors: ``[{"of": "masses", "uniform": 0.2}]``. They follow from the ``seed`` of the run.
        on_site: Springs that hold each bead at its place, and drag: ``linear_n_per_m``, ``cubic_n_per_m3``, ``drag_n_s_per_m``.
        resonators: A mass on a spring inside each bead: ``{"mass_kg": 1e-3, "stiffness_n_per_m": 1e4}``.
        left, right: The ends: ``"free"`` (nothing), ``"fixed"`` (a wall), ``"periodic"`` (both: each other) or
            ``"absorbing"`` (drag that grows towards the end).
        left_stiffness, right_stiffness: Stiffness of the contacts with the walls (N·m^−α); by default that of the chain.
        ends: Further keys of the ends: ``absorbing_beads``, ``absorbing_drag_n_s_per_m``, ``left_material``, ….
        gravity_m_s2: Acceleration of every bead (m/s²), positive towards higher bead numbers.
        precompression_n: Force (N) that presses the chain together.
        restitution: Coefficient of restitution of two beads, between 0 and 1.
        viscous_n_s_per_m: Or a dashpot in every closed contact (N·s/m).
        kuwabara_kono_s: Or viscoelastic spheres (s): ``F = k·δ^α + α·k·A·δ^(α−1)·dδ/dt``.
        power_damping: Or any power η·δ^p·dδ/dt: ``{"coefficient": 1.0, "exponent": 0.25}``.

    If each bead has a mass of its own, the median mass scales lengths and times. The same holds for stiffnesses.

    Numbers are in SI units. Quantities of pint, astropy or unyt are converted to the unit at the end of the name; quantities of
    another dimension are refused. The same holds for :class:`Run`. ``spheres`` get their masses and stiffnesses from the material: other
    masses and stiffnesses beside them are refused.
    """

    def __init__(
        self,
        beads: int,
        *,
        mass_kg: Number | Values | None = None,
        alpha: float | None = None,
        stiffness: Number | Values | None = None,
        impurities: Mapping[int, Number] | None = None,
        contacts: Mapping[int, Number] | None = None,
        masses: Mapping[str, Any] | None = None,
        stiffnesses: str | Mapping[str, Any] | None = None,
        spheres: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
        odd_spheres: Sequence[Mapping[str, Any]] = (),
        alphas: PerPlace | None = None,
        second: Mapping[str, Any] | None = None,
        gaps_m: PerPlace | None = None,
        bonds: Mapping[str, Any] | None = None,
        disorder: Sequence[Mapping[str, Any]] = (),
        on_site: Mapping[str, Any] | None = None,
        resonators: Mapping[str, Any] | None = None,
        left: str = "free",
        right: str = "free",
        left_stiffness: Number | None = None,
        right_stiffness: Number | None = None,
        ends: Mapping[str, Any] | None = None,
        gravity_m_s2: Number = 0.0,
        precompression_n: Number = 0.0,
        restitution: float | None = None,
        viscous_n_s_per_m: Number | None = None,
        kuwabara_kono_s: Number | None = None,
        power_damping: Mapping[str, Any] | None = None,
    ) -> None:
        alpha = number_if_any("alpha", alpha)
        chain: Config = {"beads": whole("beads", beads), "alpha": alpha}
        # the unit of every stiffness
        unit = None if alpha is None or not np.isfinite(alpha) else _unit_of_stiffness(alpha)
        chain["bead_mass_kg"], list_kg = _one_or_each("mass_kg", mass_kg)
        chain["stiffness"], each = _one_or_each("stiffness", stiffness, unit)
        _one_of("mass_kg", list_kg, "masses", masses)
        _one_of("stiffness", each, "stiffnesses", stiffnesses)
        chain["masses"] = masses if list_kg is None else {"list_kg": list_kg}
        chain["stiffnesses"] = stiffnesses if each is None else {"list": each}
        chain["impurities"] = [
            {"bead": whole("impurities", bead), "mass_kg": number(f"impurities[{bead!r}]", mass, "kg")}
            for bead, mass in items_of("impurities", impurities or {})
        ]
        chain["contacts"] = [
            {"contact": whole("contacts", contact), "stiffness": number(f"contacts[{contact!r}]", k, unit)}
            for contact, k in items_of("contacts", contacts or {})
        ]
        chain["spheres"], chain["odd_spheres"] = spheres, tables("odd_spheres", odd_spheres)
        chain["alphas"], chain["gaps_m"] = _per_place("alphas", alphas), _per_place("gaps_m", gaps_m)
        chain["second"], chain["bonds"] = _places_of("second", second), _places_of("bonds", bonds)
        of_walls = {
            "left_stiffness": number_if_any("left_stiffness", left_stiffness, unit),
            "right_stiffness": number_if_any("right_stiffness", right_stiffness, unit),
        }
        of_ends = _table("ends", ends)
        for name, given in {"left": left, "right": right, **of_walls}.items():
            _one_of(name, None if given == "free" else given, f"ends.{name}", of_ends.get(name))
        self._config: Config = {
            "chain": chain,
            "disorder": tables("disorder", disorder),
            "ends": {"left": left, "right": right, **of_walls, **of_ends},
            "on_site": _places_of("on_site", on_site),
            "resonators": _places_of("resonators", resonators),
            "load": {
                "gravity_m_s2": number("gravity_m_s2", gravity_m_s2),
                "precompression_n": number("precompression_n", precompression_n),
            },
            "damping": {
                "restitution": restitution,
                "viscous_n_s_per_m": viscous_n_s_per_m,
                "kuwabara_kono_s": kuwabara_kono_s,
                "power": power_damping,
            },
        }
        self._config = in_si("", self._config)

    @property
    def beads(self) -> int:
        """Number of beads N."""
        beads: int = self._config["chain"]["beads"]
        return beads

    def __repr__(self) -> str:
        return f"<Chain of {self.beads} beads{exponents_in_words(self._config['chain'])}>"


def exponents_of(chain: Config) -> list[float]:
    """The exponents of the contacts, each once; none if bonds are in their place."""
    own = chain.get("alphas")
    found: list[Any] = np.ravel(chain["alpha"] if own is None else list(own.values()) if isinstance(own, Mapping) else own).tolist()
    return [] if chain.get("bonds") or None in found else sorted(set(found))


def exponents_in_words(chain: Config) -> str:
    """The exponent of the contacts behind what a chain is."""
    found = exponents_of(chain)
    return ", several exponents" if len(found) > 1 else f", α = {found[0]:g}" if found else ""


def _unit_of_stiffness(alpha: float) -> str | None:
    # packages of units know no other powers than fractions
    power = Fraction(alpha).limit_denominator(1000)
    return f"N/m**({power})" if power == alpha else None


def whole(name: str, value: Any) -> int:
    """A whole number, such as 1000 or 1e3."""
    try:
        number = int(in_si(name, value))
        if number == value:
            return number
    except (OverflowError, TypeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
    raise ConfigError(f"{name}: found {value!r}; expected a whole number", key=name)


def number(name: str, value: Any, unit: str | None = None) -> float:
    """A number in SI units."""
    try:
        return float(in_si(name, value, unit))
    except (OverflowError, TypeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{name}: found {value!r}; expected a number", key=name) from error


def number_if_any(name: str, value: Any, unit: str | None = None) -> float | None:
    """A number in SI units, or None."""
    return None if value is None else number(name, value, unit)


def numbers(name: str, values: Any, unit: str | None = None) -> npt.NDArray[np.float64]:
    """A number, or one for each place, in SI units."""
    try:
        return np.asarray(in_si(name, values, unit), dtype=np.float64)
    except (OverflowError, TypeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{name}: found {values!r}; expected numbers", key=name) from error


def _one_or_each(name: str, values: Any, unit: str | None = None) -> tuple[float | None, list[float] | None]:
    """A value for all, and the list if there is one for each."""
    if values is None:
        return None, None
    array = numbers(name, values, unit)
    return (float(array), None) if array.ndim == 0 else (float(np.median(array)), array.tolist())


def _one_of(name: str, value: Any, other: str, beside: Any) -> None:
    """Refuses two values for the same."""
    if value is not None and beside is not None:
        raise ConfigError(f"{name}: found it beside {other}; expected one of them", key=name)


def _per_place(name: str, values: Any) -> Any:
    """A number, a rule, or the rule of a list."""
    if values is None or isinstance(values, Mapping | bool | int | float | str):
        return values
    array = numbers(name, values)
    return float(array) if array.ndim == 0 else {"list": array.tolist()}


def _places_of(name: str, table: Mapping[str, Any] | None) -> Config | None:
    """A table of numbers, rules and lists."""
    return None if table is None else {key: _per_place(f"{name}.{key}", value) for key, value in _table(name, table).items()}


def _table(name: str, table: Mapping[str, Any] | None) -> Config:
    if isinstance(table, Mapping | None):
        return dict(table or {})
    raise ConfigError(f"{name}: found {table!r}; expected a dictionary", key=name)


def tables(name: str, tables: Sequence[Mapping[str, Any]]) -> list[Config]:
    """Tables in a list; a single one is taken for a list of it."""
    if isinstance(tables, Mapping):
        return [dict(tables)]
    if isinstance(tables, str) or not np.iterable(tables):
        raise ConfigError(f"{name}: found {tables!r}; expected a list of dictionaries", key=name)
    return [_table(f"{name}[{number}]", one) for number, one in enumerate(tables)]


def items_of(name: str, values: Mapping[int, Any]) -> ItemsView[int, Any]:
    try:
        return values.items()
    except AttributeError:
        raise TypeError(f"{name}: found {values!r}; expected numbers and values, such as {{0: 5.0}}") from None
