"""Chains, runs of them, and runs made step by step."""

from __future__ import annotations

import json
import os
import re
import tomllib
import warnings
from collections.abc import Callable, ItemsView, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from . import _native
from ._numbers import count, in_si
from .errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ._native import Doubles
    from ._recording import Recording, State

    Initial = State | tuple["Values", "Values"] | Mapping[str, Any]

class Quantity(Protocol):
    """A number, or an array, with a unit: of pint, astropy, unyt and others."""

    def to(self, unit: Any, /) -> Any:
        """The same in another unit."""


Config = dict[str, Any]
Number = float | Quantity
Values = Sequence[float] | npt.NDArray[np.floating[Any]]
# a number, a value for each place, or a rule such as {"pattern": [1, 2]}
PerPlace = Number | Values | Mapping[str, Any]
OnFrame = Callable[["State"], object]

# runs that take longer than this are told of, and refused (s)
_TOLD_S, _ABSURD_S = 60.0, 365 * 86400.0


class Chain:
    """A chain of beads that repel where they touch, with ``F = k·δ^α``, or of others: CONFIGURATION explains all of them.

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
        on_site: What holds each bead at its place: ``linear_n_per_m``, ``cubic_n_per_m3``, ``drag_n_s_per_m``.
        resonators: A mass on a spring inside each bead: ``{"mass_kg": 1e-3, "stiffness_n_per_m": 1e4}``.
        left, right: What the ends touch: ``"free"`` (nothing), ``"fixed"`` (a wall), ``"periodic"`` (both: each other) or
            ``"absorbing"`` (drag that grows towards the end).
        left_stiffness, right_stiffness: Of the contacts with the walls (N·m^−α); else that of the chain.
        ends: What else is said of the ends: ``absorbing_beads``, ``absorbing_drag_n_s_per_m``, ``left_material``, ….
        gravity_m_s2: Acceleration of every bead (m/s²), positive towards higher bead numbers.
        precompression_n: Force (N) that presses the chain together.
        restitution: Coefficient of restitution of two beads, between 0 and 1.
        viscous_n_s_per_m: Or a dashpot in every closed contact (N·s/m).
        kuwabara_kono_s: Or viscoelastic spheres (s): ``F = k·δ^α + α·k·A·δ^(α−1)·dδ/dt``.
        power_damping: Or any power η·δ^p·dδ/dt: ``{"coefficient": 1.0, "exponent": 0.25}``.

    Where each bead has a mass of its own, lengths and times are scaled with the median mass; so are stiffnesses.

    Numbers are in SI units. Quantities with units, of pint, astropy or unyt, are converted to the unit that the name ends with; others
    are refused. So it is in :class:`Run`, too. ``spheres`` have their masses and stiffnesses from the material: others beside them are
    refused.
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
        alpha = _number("alpha", alpha)
        chain: Config = {"beads": _whole("beads", beads), "alpha": alpha}
        # the unit of every stiffness
        unit = None if alpha is None else f"N/m**{alpha:g}"
        chain["bead_mass_kg"], list_kg = _one_or_each("mass_kg", mass_kg)
        chain["stiffness"], each = _one_or_each("stiffness", stiffness, unit)
        chain["masses"] = masses if list_kg is None else {"list_kg": list_kg}
        chain["stiffnesses"] = stiffnesses if each is None else {"list": each}
        chain["impurities"] = [
            {"bead": _whole("impurities", bead), "mass_kg": _number(f"impurities[{bead!r}]", mass, "kg")}
            for bead, mass in _each("impurities", impurities or {})
        ]
        chain["contacts"] = [
            {"contact": _whole("contacts", contact), "stiffness": _number(f"contacts[{contact!r}]", k, unit)}
            for contact, k in _each("contacts", contacts or {})
        ]
        chain["spheres"], chain["odd_spheres"] = spheres, _tables("odd_spheres", odd_spheres)
        chain["alphas"], chain["gaps_m"] = _per_place("alphas", alphas), _per_place("gaps_m", gaps_m)
        chain["second"], chain["bonds"] = _places_of("second", second), _places_of("bonds", bonds)
        of_walls = {
            "left_stiffness": _number("left_stiffness", left_stiffness, unit),
            "right_stiffness": _number("right_stiffness", right_stiffness, unit),
        }
        self._config: Config = {
            "chain": chain,
            "disorder": _tables("disorder", disorder),
            "ends": {"left": left, "right": right, **of_walls, **_table("ends", ends)},
            "on_site": _places_of("on_site", on_site),
            "resonators": _places_of("resonators", resonators),
            "load": {
                "gravity_m_s2": _number("gravity_m_s2", gravity_m_s2),
                "precompression_n": _number("precompression_n", precompression_n),
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
        chain = self._config["chain"]
        alpha = "" if chain["alpha"] is None else f", α = {chain['alpha']:g}"
        return f"<Chain of {self.beads} beads{alpha}>"


def _whole(name: str, value: Any) -> int:
    """A whole number, such as 1000 or 1e3."""
    try:
        number = int(in_si(name, value))
        if number == value:
            return number
    except (OverflowError, TypeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
    raise ConfigError(f"{name}: found {value!r}; expected a whole number", key=name)


def _number(name: str, value: Any, unit: str | None = None) -> float | None:
    """A number in SI units."""
    if value is None:
        return None
    number = in_si(name, value, unit)
    try:
        return float(number)
    except (OverflowError, TypeError, ValueError) as error:
        raise ConfigError(f"{name}: found {value!r}; expected a number", key=name) from error


def _numbers(name: str, values: Any, unit: str | None = None) -> npt.NDArray[np.float64]:
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
    array = _numbers(name, values, unit)
    return (float(array), None) if array.ndim == 0 else (float(np.median(array)), array.tolist())


def _per_place(name: str, values: Any) -> Any:
    """A number, a rule, or the rule of a list."""
    if values is None or isinstance(values, Mapping | bool | int | float | str):
        return values
    array = _numbers(name, values)
    return float(array) if array.ndim == 0 else {"list": array.tolist()}


def _places_of(name: str, table: Mapping[str, Any] | None) -> Config | None:
    """A table of numbers, rules and lists."""
    return None if table is None else {key: _per_place(f"{name}.{key}", value) for key, value in _table(name, table).items()}


def _table(name: str, table: Mapping[str, Any] | None) -> Config:
    if isinstance(table, Mapping | None):
        return dict(table or {})
    raise ConfigError(f"{name}: found {table!r}; expected a dictionary", key=name)


def _tables(name: str, tables: Sequence[Mapping[str, Any]]) -> list[Config]:
    """Tables in a list; a single one is taken for a list of it."""
    if isinstance(tables, Mapping):
        return [dict(tables)]
    if isinstance(tables, str) or not np.iterable(tables):
        raise ConfigError(f"{name}: found {tables!r}; expected a list of dictionaries", key=name)
    return [_table(f"{name}[{number}]", one) for number, one in enumerate(tables)]


def _each(name: str, values: Mapping[int, Any]) -> ItemsView[int, Any]:
    try:
        return values.items()
    except AttributeError:
        raise TypeError(f"{name}: found {values!r}; expected numbers and values, such as {{0: 5.0}}") from None


class Run:
    """A run: a chain, what moves it, and for how long.

    Args:
        chain: The chain.
        strikers: Beads that move at first, and their velocities (m/s), positive towards higher bead numbers: ``{0: 5.0}``, or
            ``{0: 5.0, 99: -5.0}`` for two pulses that meet.
        drives: What moves walls or beads, or pushes beads: ``[{"wall": "left", "velocity_m_s": 5.0}]`` is a piston,
            ``[{"bead": 3, "force_n": {"sine": {"amplitude": 1e-3, "frequency_hz": 1e3}}}]`` a shaker. CONFIGURATION has the waveforms.
        initial: How it begins: displacements (m) and velocities (m/s) of all beads, ``(u, v)``; a :class:`State` of another run,
            such as ``rec[1000]``; or rules, such as ``{"thermal": {"temperature_k": 300}}``. What it gives is added to strikers.
        seed: Of everything that is random: disorder and thermal velocities.
        duration_s: Simulated time (s).
        dt_s: Time step (s); by default a fraction of the collision time.
        method: ``"rkn4"``, ``"velocity-verlet"``, ``"gear5"`` or ``"rk5"``; by default ``"rkn4"``, or one that can do what the chain
            needs.
        name: Name on the bus and in files, of ``a`` to ``z``, digits and ``-``.
        publish_every: Steps from one frame to the next.

    Raises:
        ConfigError: With the key, what was found, and what is allowed. Keys are those of a configuration, such as
            ``chain.bead_mass_kg`` for ``mass_kg``.
    """

    def __init__(
        self,
        chain: Chain,
        *,
        strikers: Mapping[int, Number] | None = None,
        drives: Sequence[Mapping[str, Any]] = (),
        initial: Initial | None = None,
        seed: int | None = None,
        duration_s: Number,
        dt_s: Number | None = None,
        method: str | None = None,
        name: str | None = None,
        publish_every: int = 1,
    ) -> None:
        config = deepcopy(chain._config)
        struck = _each("strikers", {} if strikers is None else strikers)
        each = [
            {"bead": _whole("strikers", bead), "velocity_m_s": _number(f"strikers[{bead!r}]", v, "m/s")} for bead, v in struck
        ]
        config["striker"] = each[0] if len(each) == 1 else each
        config["drive"] = _tables("drives", drives)
        config["initial"] = None if initial is None else _initial(initial)
        config["time"] = {"duration_s": _number("duration_s", duration_s), "dt_s": _number("dt_s", dt_s)}
        config["integrator"] = {"method": method}
        every = _whole("publish_every", publish_every)
        config["stream"] = {"publish_every_steps": every, "record_every_steps": every}
        self._set(_toml({"name": name, "seed": seed, **config}), None, "run")

    def _set(self, toml: str, path: str | None, name: str, is_seen: bool = False, folder: str | None = None) -> None:
        # where files are looked for that it names
        self._folder = os.path.dirname(os.path.abspath(path)) if path is not None else folder or os.getcwd()
        try:
            self._manifest = _native.Manifest.from_toml(toml, path, name, self._folder)
        except ConfigError as error:
            if not is_seen:
                # nobody has seen these lines
                error.line = None
                error.args = (re.sub(r"^line \d+: ", "", str(error)),)
            raise
        self._toml = toml

    @classmethod
    def _of(
        cls, toml: str, path: str | None = None, name: str = "run", is_seen: bool = False, folder: str | None = None
    ) -> Run:
        run = cls.__new__(cls)
        run._set(toml, path, name, is_seen, folder)
        return run

    @classmethod
    def from_toml(cls, source: str | os.PathLike[str]) -> Run:
        """A run as ``beadline run`` reads it: the text of a configuration, or the path of its file.

        Raises:
            ConfigError: With the line.
        """
        if isinstance(source, str) and "\n" in source:
            return cls._of(source, is_seen=True)
        path = Path(source)
        return cls._of(path.read_text(encoding="utf-8"), str(path), path.stem, is_seen=True)

    @classmethod
    def from_recording(cls, rec: Recording) -> Run:
        """The run that a recording is of, to be made again or changed: ``bl.Run.from_recording(rec).replace(…)``.

        Raises:
            ValueError: If the recording has no configuration.
        """
        if not rec.toml:
            raise ValueError(f"{rec!r} has no configuration: describe the run with bl.Run(…)")
        folder = None if rec.path is None or "://" in rec.path else os.path.dirname(rec.path)
        run = cls.__new__(cls)
        if rec.recomputes:
            # files that its text names may be gone
            run._folder, run._toml, run._manifest = folder or os.getcwd(), rec.toml, rec._manifest
        else:
            run._set(rec.toml, None, rec.name, folder=folder)
        return run

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> Run:
        """A run of a configuration as nested dictionaries and lists, such as ``tomllib`` reads: everything of CONFIGURATION. Arrays of
        NumPy's are lists, and what is None is left out.

        Raises:
            ConfigError: With the key.
        """
        return cls._of(_toml(config))

    def to_toml(self) -> str:
        """The configuration as ``beadline run`` reads it."""
        return self._toml

    def replace(self, values: Mapping[str, Any]) -> Run:
        """The same run with other values, by their keys: ``{"time.duration_s": 0.01, "chain.impurities[0].mass_kg": 2e-3}``.

        Keys are those of :meth:`to_toml`. A key that is not there yet is added.

        Raises:
            ConfigError: If there can be no such key, or no such value.
        """
        config: Config = tomllib.loads(self._toml)
        for key, value in values.items():
            place: Any = config
            try:
                names = re.findall(r"[^.\[\]]+", key)
                *parts, last = [int(name) if name.isdecimal() else name for name in names]
                for part in parts:
                    place = place.setdefault(part, {}) if isinstance(place, dict) else place[part]
                place[last] = value
            except (IndexError, TypeError, ValueError) as error:
                raise ConfigError(f"{key}: the configuration has no such key", key=key) from error
        return self._of(_toml(config), None, self.name, folder=self._folder)

    def starting_from(self, state: State | tuple[Values, Values]) -> Run:
        """The same chain, begun from a state: that of any step, ``rec[1000]``, or one that you have changed,
        ``(displacements in m, velocities in m/s)``. Strikers and other initial states are left out.

        Time begins at 0 again, so drives do, too; resonators begin unstretched and at rest, as everywhere.

        Raises:
            ConfigError: If it is no state of this chain.
        """
        return self.replace({"striker": None, "initial": _initial(state)})

    @property
    def name(self) -> str:
        """Name of the run."""
        return self._manifest.name

    @property
    def manifest(self) -> Config:
        """The validated run: ``physics`` decides every bit, ``provenance`` says where it comes from."""
        found: Config = json.loads(self._manifest.json)
        return found

    @property
    def steps(self) -> int:
        """Number of time steps."""
        return self._manifest.step_count

    @property
    def dt_s(self) -> float:
        """Time step (s)."""
        return self._manifest.dt_s

    @property
    def collision_length_m(self) -> float:
        """Collision length L (m)."""
        return self._manifest.scales[0]

    @property
    def collision_time_s(self) -> float:
        """Collision time T (s)."""
        return self._manifest.scales[1]

    def record(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        every: int | None = None,
        force: bool = False,
        publish: bool = False,
        wait_for: int = 0,
        on_frame: OnFrame | None = None,
        on_frame_every: int = 1,
        progress: bool | None = None,
        yes: bool = False,
    ) -> Recording:
        """Simulates the run and records it.

        Ctrl-C ends it in order: the file is whole and says that it was interrupted. A run of more than a minute begins with a warning
        that says how long it takes at least.

        Args:
            path: The file, ``.mcap``; by default the name of the run.
            every: Steps between two recorded states; the steps between them are recomputed when they are asked for. By
                default every frame is recorded.
            force: Replace a file that exists.
            publish: Publish the run on the bus, as ``beadline run`` does.
            wait_for: Of a published run: begin when so many lossless consumers are attached.
            on_frame: Called with the :class:`State` of frames; something true ends the run. It must not
                make this run, nor attach to it.
            on_frame_every: Frames from one call to the next.
            progress: Whether to show how far it is; by default in terminals and notebooks.
            yes: Begin without that warning, also if it takes more than a year.

        Raises:
            FileExistsError: If there is such a file.
            ValueError: If it takes more than a year, which looks like a mistake.
            RunError: If the values are no longer finite.
            LiveError: If it cannot be published.
        """
        from ._recording import mcap, open

        wait_for = count("wait_for", wait_for, 0)
        if wait_for and not publish:
            raise ValueError(f"wait_for: found {wait_for}; expected 0, or publish=True")
        manifest = self._begun(self._manifest.publish_every_steps if every is None else count("every", every))
        path = mcap(path if path is not None else f"{self.name}.mcap")
        if force or not path.exists():
            self._confirm(yes)
        with self._progress(progress) as tell:
            summary = _native.record(
                manifest,
                path,
                force=force,
                publish=publish,
                wait_for=wait_for,
                on_progress=tell,
                on_frame=_frames_to(on_frame, manifest, on_frame_every),
            )
        recording = open(path)
        recording.summary = summary
        return recording

    def simulate(
        self,
        *,
        every: int = 100,
        on_frame: OnFrame | None = None,
        on_frame_every: int = 1,
        progress: bool | None = None,
        yes: bool = False,
    ) -> Recording:
        """Simulates the run in memory, without a file.

        Args:
            every: Steps between two states that are kept; the steps between them are recomputed when they are asked for.
            on_frame, on_frame_every, progress, yes: As for :meth:`record`.

        Raises:
            MemoryError: If there is not enough of it for the states that are kept.
            ValueError: If it takes more than a year, which looks like a mistake.
            RunError: If the values are no longer finite.
        """
        from ._recording import Recording, check_memory

        published = self._manifest.publish_every_steps
        manifest = self._begun(-(-count("every", every) // published) * published)
        kept_bytes = 8 * self._manifest.frame_doubles * (self.steps // manifest.record_every_steps + 2)
        check_memory(f"a run that keeps every {every:,}. step", kept_bytes, "keep fewer with every=…, or record() them in a file")
        self._confirm(yes)
        with self._progress(progress) as tell:
            on = _frames_to(on_frame, manifest, on_frame_every)
            states, summary = _native.simulate(manifest, on_progress=tell, on_frame=on)
        recording = Recording(states)
        recording.summary = summary
        return recording

    def start(self) -> Simulation:
        """The run at its first step, to be made step by step."""
        return Simulation(self._manifest)

    def _begun(self, every: int) -> _native.Manifest:
        return self._manifest.begun(every)

    def _confirm(self, yes: bool) -> None:
        """Tells of a long run before it begins, as the command does."""
        from ._progress import duration

        takes_s = 0.0 if yes else self._manifest.computing_s()
        if takes_s > _ABSURD_S:
            takes = f"this takes at least {duration(takes_s)}, which looks like a mistake"
            raise ValueError(f"{takes}; take a shorter duration or fewer beads, or yes=True")
        if takes_s > _TOLD_S:
            warnings.warn(f"this takes at least {duration(takes_s)}; yes=True begins without this warning", RuntimeWarning, 3)

    @contextmanager
    def _progress(self, show: bool | None) -> Iterator[Callable[[int], object]]:
        from ._progress import Progress

        with Progress(self.steps, self.name, show) as bar:
            yield bar.update

    def _repr_html_(self) -> str:
        from ._html import of_run

        return of_run(self)

    def __repr__(self) -> str:
        return f"<Run {self.name}: {self._manifest.beads} beads, {self.steps} steps of {self.dt_s:.4g} s>"


def _initial(initial: Initial) -> Config:
    """How a run begins, as a configuration says it."""
    from ._recording import State

    if isinstance(initial, Mapping):
        return dict(initial)
    pair = (initial.displacement_m, initial.velocity_m_s) if isinstance(initial, State) else initial
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        found = f"{len(pair)} parts" if isinstance(pair, tuple | list) else repr(pair)
        wanted = "a State, (displacements in m, velocities in m/s), or a dictionary of rules"
        raise ConfigError(f"initial: found {found}; expected {wanted}", key="initial")
    # a text has no place for the sign of 0, and needs none: it is lost where states are added up
    names = ("displacements_m", "velocities_m_s")
    return {name: _numbers(f"initial.{name}", values).tolist() for name, values in zip(names, pair, strict=True)}


def _frames_to(
    call: OnFrame | None, manifest: _native.Manifest, every: int
) -> tuple[Callable[..., object], int] | None:
    from ._recording import State

    if call is None:
        return None
    return (lambda *state: call(State(manifest, state))), count("on_frame_every", every)


class Simulation:
    """A run that is made step by step, by one thread at a time.

    Its arrays are read-only and go on with the run; take ``.copy()`` of what is to stay, or a :meth:`state`.
    """

    def __init__(self, manifest: _native.Manifest) -> None:
        self._manifest = manifest
        self._native = _native.Simulation(manifest)

    def step(self, steps: int = 1) -> Simulation:
        """Makes steps, at most up to the end of the run.

        Raises:
            RunError: If the values are no longer finite.
        """
        self._native.step(count("steps", steps, 0))
        return self

    @property
    def step_number(self) -> int:
        """The step that was reached."""
        return self._native.step_number

    @property
    def time_s(self) -> float:
        """Its time (s)."""
        return self._native.time_s

    @property
    def is_done(self) -> bool:
        """Whether the last step was made."""
        return self._native.step_number == self._manifest.step_count

    @property
    def displacement_m(self) -> Doubles:
        """Displacement of each bead (m), read-only, which goes on with the run."""
        return self._native.u_m().view()

    @property
    def velocity_m_s(self) -> Doubles:
        """Velocity of each bead (m/s), read-only, which goes on with the run."""
        return self._native.v_m_s().view()

    @property
    def mass_kg(self) -> Doubles:
        """Mass of each bead (kg)."""
        return self._manifest.mass_kg

    def state(self) -> State:
        """A copy of the state."""
        from ._recording import State

        return State(self._manifest, self._native.state())

    def __repr__(self) -> str:
        return f"<Simulation of {self._manifest.name} at step {self.step_number} of {self._manifest.step_count}>"


def presets() -> dict[str, str]:
    """The ready-made runs: their names, and what they show."""
    return {name: about for name, about, _ in _native.presets()}


def preset(name: str) -> Run:
    """A ready-made run.

    Raises:
        KeyError: If there is none of this name.
    """
    for known, _, toml in _native.presets():
        if known == name:
            return Run._of(toml, None, name)
    raise KeyError(f"there is no preset {name!r}; there are: {', '.join(presets())}")


def _toml(config: Mapping[str, Any]) -> str:
    """A configuration as text; what is None or empty is left out."""
    config = in_si("", config)
    plain = {key: value for key, value in config.items() if not isinstance(value, Mapping)}
    lines = _lines(plain)
    for name, table in config.items():
        if isinstance(table, Mapping) and (inner := _lines(table)):
            lines += [f"[{name}]", *inner]
    return "\n".join(lines) + "\n"


def _lines(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {_value(value)}" for key, value in table.items() if not _is_nothing(value)]


def _is_nothing(value: Any) -> bool:
    return value is None or (isinstance(value, list | tuple | np.ndarray) and len(value) == 0)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)


def _value(value: Any) -> str:
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_lines(value)) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float) and not np.isfinite(value):
        return repr(float(value))
    try:
        # numbers, texts and truth values are written as in JSON
        return json.dumps(value)
    except TypeError as error:
        raise ConfigError(f"found {value!r}; expected a number, a text, a truth value, or lists and dictionaries of them") from error
