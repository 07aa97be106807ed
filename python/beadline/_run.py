"""Runs of chains, and runs made step by step."""

from __future__ import annotations

import json
import os
import re
import tomllib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from ._chain import Chain, Config, Number, Values, items_of, number, number_if_any, numbers, tables, whole
from ._numbers import count, in_si
from .errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from ._native import Doubles
    from ._recording import Recording, State

    Initial = State | tuple[Values, Values] | Mapping[str, Any]
    # runs beside a run, with a smaller and a larger number, and how far these are apart
    _Pair = tuple[_native.Manifest, _native.Manifest, float]

OnFrame = Callable[["State"], object]

# runs that take longer than this are told of, and refused (s)
_TOLD_S, _ABSURD_S = 60.0, 365 * 86400.0

# part by which numbers of runs differ between which derivatives are found
_PART = 1e-5

# lists of tables, which may be empty
_LISTS = ("impurities", "contacts", "odd_spheres", "disorder", "striker", "drive", "bath")


class Run:
    """A run: a chain, its strikers and drives, and a duration.

    Args:
        chain: The chain.
        strikers: Beads that move at first, and their velocities (m/s), positive towards higher bead numbers: ``{0: 5.0}``, or
            ``{0: 5.0, 99: -5.0}`` for two pulses that meet.
        drives: Drives, which move walls or beads, or push beads: ``[{"wall": "left", "velocity_m_s": 5.0}]`` is a piston,
            ``[{"bead": 3, "force_n": {"sine": {"amplitude": 1e-3, "frequency_hz": 1e3}}}]`` a shaker. CONFIGURATION has the waveforms.
        baths: Heat baths: ``[{"beads": "..4", "temperature_j": 1e-9, "friction_per_s": 1e3}]``. CONFIGURATION has all keys.
        initial: Its beginning: displacements (m) and velocities (m/s) of all beads, ``(u, v)``; a :class:`State` of another run,
            such as ``rec[1000]``; or rules, such as ``{"thermal": {"temperature_k": 300}}``. Strikers are added to it.
        seed: Seed of disorder, thermal velocities and baths.
        duration_s: Simulated time (s).
        dt_s: Time step (s); by default a fraction of the collision time.
        method: ``"rkn4"``, ``"velocity-verlet"``, ``"gear5"`` or ``"rk5"``; by default ``"rkn4"``, or one that can compute the chain.
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
        baths: Sequence[Mapping[str, Any]] = (),
        initial: Initial | None = None,
        seed: int | None = None,
        duration_s: Number,
        dt_s: Number | None = None,
        method: str | None = None,
        name: str | None = None,
        publish_every: int = 1,
    ) -> None:
        if not isinstance(chain, Chain):
            raise TypeError(f"chain: found {chain!r}; expected a beadline.Chain; Run.from_config takes dictionaries")
        config = deepcopy(chain._config)
        struck = items_of("strikers", {} if strikers is None else strikers)
        each = [
            {"bead": whole("strikers", bead), "velocity_m_s": number(f"strikers[{bead!r}]", v, "m/s")} for bead, v in struck
        ]
        config["striker"] = each[0] if len(each) == 1 else each
        config["drive"] = tables("drives", drives)
        config["bath"] = tables("baths", baths)
        config["seed"] = seed
        config["initial"] = None if initial is None else _initial(initial, config)
        config["time"] = {"duration_s": number("duration_s", duration_s), "dt_s": number_if_any("dt_s", dt_s)}
        config["integrator"] = {"method": method}
        every = whole("publish_every", publish_every)
        config["stream"] = {"publish_every_steps": every, "record_every_steps": every}
        self._set(_toml({"name": name, **config}), None, "run")

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
    def from_recording(cls, recording: Recording) -> Run:
        """The run of a recording, to be made again or changed: ``bl.Run.from_recording(rec).replace(…)``. Numbers that it had from other
        files are those of the recording.

        Raises:
            ValueError: If the recording has no configuration.
        """
        if not recording.toml:
            raise ValueError(f"{recording!r} has no configuration: describe the run with bl.Run(…)")
        folder = None if recording.path is None or "://" in recording.path else os.path.dirname(recording.path)
        # files that its text names may be gone, or others
        toml = _with_numbers(recording.toml, recording.manifest["physics"])
        run = cls.__new__(cls)
        if recording.recomputes:
            run._folder, run._toml, run._manifest = folder or os.getcwd(), toml, recording._manifest
        else:
            run._set(toml, None, recording.name, folder=folder)
        return run

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> Run:
        """A run of a configuration as nested dictionaries and lists, such as ``tomllib`` reads: everything of CONFIGURATION. Arrays of
        NumPy become lists, and None is left out.

        Raises:
            ConfigError: With the key.
        """
        if not hasattr(config, "items"):
            raise TypeError(f"config: found {config!r}; expected nested dictionaries, such as tomllib.loads(text)")
        return cls._of(_toml(config))

    def to_toml(self) -> str:
        """The configuration as ``beadline run`` reads it."""
        return self._toml

    def replace(self, values: Mapping[str, Any]) -> Run:
        """The same run with other values, by their keys: ``{"time.duration_s": 0.01, "chain.impurities[0].mass_kg": 2e-3}``.

        Keys are those of :meth:`to_toml`. A key that is not there yet is added. ``stream.record_every_steps`` follows
        ``stream.publish_every_steps`` if they were the same.

        Raises:
            ConfigError: If the key or the value is impossible.
        """
        if not hasattr(values, "items"):
            raise TypeError(f"values: found {values!r}; expected keys and values, such as {{'time.duration_s': 0.01}}")
        config: Config = tomllib.loads(self._toml)
        for key, value in values.items():
            place: Any = config
            # another key may change it; a value that has no copy is refused below
            with suppress(TypeError):
                value = deepcopy(value)
            try:
                *parts, last = parts_of(key)
                for part in parts:
                    place = place.setdefault(_name(key, part), {}) if isinstance(place, dict) else place[part]
                old = place.get(last) if isinstance(place, dict) else None
                if any(isinstance(table, dict) and "sha256" in table for table in (place, old)):
                    found = "found a state that has been read, whose numbers stand in the lists beside it"
                    raise ConfigError(f"{key}: {found}; replace 'initial', without these lists and the sha256", key=key)
                place[_name(key, last) if isinstance(place, dict) else last] = value
            except (IndexError, TypeError, ValueError) as error:
                if isinstance(error, ConfigError):
                    raise
                raise ConfigError(f"{key}: the configuration has no such key", key=key) from error
        stream = config.get("stream", {})
        follows = "stream.publish_every_steps" in values and "stream.record_every_steps" not in values
        if follows and stream.get("record_every_steps") == self._manifest.publish_every_steps:
            stream["record_every_steps"] = stream["publish_every_steps"]
        return self._of(_toml(config), None, self.name, folder=self._folder)

    def starting_from(self, state: State | tuple[Values, Values], *, seed: int | None = None) -> Run:
        """The same chain, begun from a state: a state of any step, ``rec[1000]``, or one that you have changed,
        ``(displacements in m, velocities in m/s)``. Strikers and other initial states are left out.

        Time begins at 0 again, so drives do, too; resonators begin as in a ``State``, beside a pair at rest in their beads. The noise of
        baths begins again as well: pieces of a thermal run take a seed each. With the seed of before there is a ``RuntimeWarning``.

        Args:
            state: The state.
            seed: Seed of the noise of its baths; by default that of before. Disorder keeps its own.

        Raises:
            ConfigError: If the state does not fit this chain.
        """
        config: Config = tomllib.loads(self._toml)
        if seed is not None:
            config["bath"] = [{**bath, "seed": whole("seed", seed)} for bath in tables("bath", config.get("bath", ()))]
        values: Config = {"striker": None, "bath": config.get("bath"), "initial": _initial(state, config)}
        ends = self.manifest["physics"].get("ends", {})
        if "absorbing" in ends.values():
            # its default is in units that follow the beginning
            values["ends.absorbing_drag_n_s_per_m"] = self._manifest.absorbing_drag_n_s_per_m
        return self.replace(values)

    @property
    def name(self) -> str:
        """Name of the run."""
        return self._manifest.name

    @property
    def manifest(self) -> Config:
        """The validated run: ``physics`` decides every bit, ``provenance`` is its origin."""
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

        Ctrl-C ends it in order: the file is whole, with the end ``interrupted``. A run of more than a minute begins with a warning
        that has its least time.

        Args:
            path: The file, ``.mcap``; by default the name of the run.
            every: Steps between two recorded states; the steps between them are recomputed when they are asked for. By
                default every frame is recorded.
            force: Replace a file that exists.
            publish: Publish the run on the bus, as ``beadline run`` does.
            wait_for: For a published run: begin when so many lossless consumers are attached.
            on_frame: Called with the :class:`State` of frames; something true ends the run. It must not
                make this run, nor attach to it.
            on_frame_every: Frames from one call to the next.
            progress: Show the progress; by default in terminals and notebooks.
            yes: Begin without that warning, also if it takes more than a year.

        Raises:
            FileExistsError: If there is such a file.
            ValueError: If it takes more than a year, which looks like a mistake.
            RunError: If the values are no longer finite.
            LiveError: If it cannot be published.
        """
        from ._files import mcap
        from ._recording import open

        wait_for = count("wait_for", wait_for, 0)
        if wait_for and not publish:
            raise ValueError(f"wait_for: found {wait_for}; expected 0, or publish=True")
        manifest = self._begun(self._manifest.publish_every_steps if every is None else count("every", every))
        path = mcap(path if path is not None else f"{self.name}.mcap")
        if force or not path.exists():
            _confirm(self._manifest.computing_s(), yes)
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
            every: Steps between two states that are kept, or the next multiple of ``publish_every``; the steps between them are recomputed
                when they are asked for.
            on_frame, on_frame_every, progress, yes: As for :meth:`record`.

        Raises:
            MemoryError: If there is not enough of it for the states that are kept.
            ValueError: If it takes more than a year, which looks like a mistake.
            RunError: If the values are no longer finite.
        """
        from ._fields import check_memory
        from ._recording import Recording

        manifest, kept_bytes = self._kept(count("every", every))
        check_memory(f"a run that keeps every {every:,}. step", kept_bytes, "keep fewer with every=…, or record() them in a file")
        _confirm(self._manifest.computing_s(), yes)
        with self._progress(progress) as tell:
            on = _frames_to(on_frame, manifest, on_frame_every)
            states, summary = _native.simulate(manifest, on_progress=tell, on_frame=on)
        recording = Recording(states)
        recording.summary = summary
        return recording

    def start(self, tangents: npt.ArrayLike | None = None) -> Simulation:
        """The run at its first step, to be made step by step.

        Args:
            tangents: Small changes of the state, which are carried with it by the exact derivative of each step: 2N numbers (of all
                displacements, then of all velocities), or several of these. Resonators have 2N more.

        Raises:
            ValueError: If there are other numbers, or the method has no derivatives.
        """
        return Simulation(self._manifest, tangents)

    def tangent(self, w0: npt.ArrayLike) -> Doubles:
        """The change of the last state by a small change of the first one: ``run.tangent(w0)`` for 2N numbers, or several of these.

        Raises:
            ValueError: As :meth:`start`.
            RunError: If the values are no longer finite.
        """
        found = self.start(w0).step(self.steps).tangents
        return found if np.ndim(w0) == 2 else found[0]

    def derivative(self, *keys: str) -> Doubles:
        """The derivative of the last state by a number of the configuration, at the same steps: of all displacements, then of all
        velocities (and of those of resonators), for each unit of the number. By several keys: a row for each.

        ``run.derivative("chain.impurities[0].mass_kg")`` is carried with the run, as :meth:`tangent` is: also where the run is chaotic it
        has some 9 digits, which differences of two runs lose. Keys are those of :meth:`replace`.

        Raises:
            ValueError: If a key is no number other than 0, changes no step, or changes the time step, the drives or baths; or the method has
                no derivatives.
            RunError: If the values are no longer finite.
        """
        beside = []
        for key in keys:
            value = self._number(key)
            step = _PART * abs(value)
            below, above = (self.replace({"time.dt_s": self.dt_s, key: value + change}) for change in (-step, step))
            if below._steps_alone() == above._steps_alone():
                what = f"{key}: found a number that changes no step, and derivatives are those at the same steps"
                raise ValueError(f"{what}; expected one of the chain, its loads or its beginning")
            beside.append((below._manifest, above._manifest, 2.0 * step))
        if not beside:
            raise ValueError("derivative: found no key; expected one or more, such as chain.stiffness")
        found = Simulation(self._manifest, beside=beside).step(self.steps).tangents
        return found[0] if len(keys) == 1 else found

    def _number(self, key: str) -> float:
        """The number that a key of the configuration has."""
        value = value_of(tomllib.loads(self._toml), key)
        if isinstance(value, bool) or not isinstance(value, int | float) or value == 0:
            raise ValueError(f"{key}: found {value!r}; expected a number other than 0")
        return float(value)

    def _steps_alone(self) -> Config:
        """All that decides the bits of a step."""
        return {**self.manifest["physics"], "step_count": None}

    def _begun(self, every: int) -> _native.Manifest:
        return self._manifest.begun(every)

    def _kept(self, every: int) -> tuple[_native.Manifest, int]:
        """The run that keeps every ``every``. step, or the next that is published, and the bytes that it keeps."""
        published = self._manifest.publish_every_steps
        manifest = self._begun(-(-every // published) * published)
        return manifest, 8 * self._manifest.frame_doubles * (self.steps // manifest.record_every_steps + 2)

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


def initial_of(state: State) -> Config:
    """A state in the form of a configuration."""
    lists = {"displacements_m": state.displacement_m, "velocities_m_s": state.velocity_m_s}
    of_resonators = {
        "resonator_displacements_m": state.resonator_displacement_m,
        "resonator_velocities_m_s": state.resonator_velocity_m_s,
    }
    return {name: values.tolist() for name, values in {**lists, **of_resonators}.items() if len(values)}


def rooted(folder: str, key: str, value: Any) -> Any:
    """The value of a key with the whole paths of files that it names, which lie in ``folder``."""
    if isinstance(value, Mapping):
        return {name: rooted(folder, name, one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [rooted(folder, key, one) for one in value]
    is_file = isinstance(value, str) and key.rpartition(".")[2] in ("csv", "recording") and "://" not in value
    return os.path.join(folder, value) if is_file else value


def _with_numbers(toml: str, physics: Config) -> str:
    """A configuration with the numbers of a manifest in place of the files that they were read from."""
    config: Config = tomllib.loads(toml)
    for name in ("drive", "bath"):
        for one, own in zip(config.get(name, []), physics.get(f"{name}s", []), strict=True):
            one.update({key: own[key] for key, value in one.items() if isinstance(value, dict) and "csv" in value})
    if "from" in config.get("initial", {}):
        if "energy_per_bead_j" in config["initial"]:
            # the velocities have those of strikers
            config.pop("striker", None)
        config["initial"] = physics["initial"]
    return toml if config == tomllib.loads(toml) else _toml(config)


def _initial(initial: Initial, chain: Config) -> Config:
    """The beginning of a run of a chain, in the form of a configuration."""
    from ._recording import State

    if isinstance(initial, Mapping):
        return dict(initial)
    if isinstance(initial, State):
        _warn_of_noise(initial, chain)
        lists = initial_of(initial)
        return {name: lists[name] for name in lists if chain.get("resonators") or not name.startswith("resonator")}
    pair = initial
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        found = f"{len(pair)} parts" if isinstance(pair, tuple | list) else repr(pair)
        wanted = "a State, (displacements in m, velocities in m/s), or a dictionary of rules"
        raise ConfigError(f"initial: found {found}; expected {wanted}", key="initial")
    # a text has no place for the sign of 0, and needs none: it is lost where states are added up
    names = ("displacements_m", "velocities_m_s")
    return {name: numbers(f"initial.{name}", values).tolist() for name, values in zip(names, pair, strict=True)}


def _warn_of_noise(state: State, config: Config) -> None:
    """Tells of baths whose noise led to the state that the run begins with."""
    if not config.get("bath") or not state.step:
        return
    physics = json.loads(state._manifest.json)["physics"]
    had = [bath.get("seed", physics.get("seed", 0)) for bath in physics.get("baths", [])]
    if any(bath.get("seed", config.get("seed") or 0) in had for bath in tables("bath", config["bath"])):
        found = "the baths make the same noise again that led to this state, so the run does not go on with it as a thermal one"
        warnings.warn(f"{found}; give another seed, such as starting_from(state, seed=1)", RuntimeWarning, 4)


def simulate(
    runs: Iterable[Run],
    *,
    every: int = 100,
    jobs: int | None = None,
    progress: bool | None = None,
    yes: bool = False,
) -> list[Recording]:
    """Simulates many runs in memory, in threads: each as ``Run.simulate`` does, with the same bits.

    Short chains that differ in numbers alone (masses, stiffnesses, loads, time steps, beginnings, seeds) are computed side by side in the
    processor's registers, up to eight at once: put such runs next to each other.

    Args:
        runs: The runs.
        every: Steps between two states that are kept; the steps between them are recomputed when they are asked for.
        jobs: Threads; by default one for each core.
        progress: Show the progress; by default in terminals and notebooks.
        yes: Begin without a warning, also if they take more than a year.

    Raises:
        MemoryError: If there is not enough of it for the states that are kept.
        ValueError: If they take more than a year, which looks like a mistake.
        RunError: If the values of one are no longer finite; ``runs[3]:`` says which.
    """
    from ._fields import check_memory
    from ._progress import Progress
    from ._recording import Recording

    runs = list(runs)
    for number, run in enumerate(runs):
        if not isinstance(run, Run):
            raise TypeError(f"runs[{number}]: found {run!r}; expected a beadline.Run")
    every, jobs = count("every", every), jobs if jobs is None else count("jobs", jobs)
    kept = [run._kept(every) for run in runs]
    kept_bytes = sum(kept_bytes for _, kept_bytes in kept)
    check_memory(f"{len(runs)} runs that keep every {every:,}. step", kept_bytes, "keep fewer with every=…, or sweep() for a table")
    _confirm(sum(run._manifest.computing_s() for run in runs) / (jobs or os.cpu_count() or 1), yes)
    with Progress(len(runs), "simulate", progress, "runs") as bar:
        made = _native.simulate_all([manifest for manifest, _ in kept], jobs=jobs, on_progress=bar.update)
    recordings = []
    for states, summary in made:
        recordings.append(Recording(states))
        recordings[-1].summary = summary
    return recordings


def _confirm(takes_s: float, yes: bool) -> None:
    """Tells of long work before it begins, as the command does."""
    from ._progress import duration

    if yes:
        return
    if takes_s > _ABSURD_S:
        takes = f"this takes at least {duration(takes_s)}, which looks like a mistake"
        raise ValueError(f"{takes}; take a shorter duration or fewer beads, or yes=True")
    if takes_s > _TOLD_S:
        warnings.warn(f"this takes at least {duration(takes_s)}; yes=True begins without this warning", RuntimeWarning, 3)


def _frames_to(
    call: OnFrame | None, manifest: _native.Manifest, every: int
) -> tuple[Callable[..., object], int] | None:
    from ._recording import State

    if call is None:
        return None
    return (lambda *state: call(State(manifest, state))), count("on_frame_every", every)


class Simulation:
    """A run that is made step by step, by one thread at a time.

    Its arrays are read-only and go on with the run; take a ``.copy()`` of an array that is to stay, or a :meth:`state`.
    """

    def __init__(
        self, manifest: _native.Manifest, tangents: npt.ArrayLike | None = None, beside: Sequence[_Pair] = ()
    ) -> None:
        self._manifest = manifest
        carried = None if tangents is None else np.atleast_2d(np.asarray(tangents, dtype=np.float64)).tolist()
        self._native = _native.Simulation(manifest, carried, list(beside))

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
        """True if the last step was made."""
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

    @property
    def tangents(self) -> Doubles:
        """The changes that it carries, at this step: a row for each.

        Raises:
            ValueError: If it carries none.
        """
        found = self._native.tangents()
        if found is None:
            raise ValueError("this run carries no tangents; begin it with run.start(tangents=…)")
        return np.array(found)

    def state(self) -> State:
        """A copy of the state."""
        from ._recording import State

        return State(self._manifest, self._native.state())

    def __repr__(self) -> str:
        return f"<Simulation of {self._manifest.name} at step {self.step_number} of {self._manifest.step_count}>"


def parts_of(key: str) -> list[str | int]:
    """Names and numbers of a key: ``chain``, ``impurities``, 0 and ``mass_kg`` of ``chain.impurities[0].mass_kg``."""
    if not re.fullmatch(r"(?:\.[^.\[\]]+(?:\[\d+\])*)+", f".{key}"):
        what = "names with points between them, and numbers in brackets, such as chain.impurities[0].mass_kg"
        raise ConfigError(f"found the key {key!r}; expected {what}", key=key)
    return [int(name) if name.isdecimal() else name for name in re.findall(r"[^.\[\]]+", key)]


def value_of(config: Config, key: str) -> Any:
    """The value that a key of a configuration has.

    Raises:
        ConfigError: If there is none.
    """
    value: Any = config
    try:
        for part in parts_of(key):
            value = value[part]
    except (IndexError, KeyError, TypeError) as error:
        raise ConfigError(f"{key}: the configuration has no such key; give it a value with run.replace", key=key) from error
    return value


def _name(key: str, part: str | int) -> str:
    """A part of a key where the configuration has a table, which has names."""
    if isinstance(part, int):
        what = f"{key}: found the number {part} where there is no list; allowed: the key without it for a single one, or a whole list"
        raise ConfigError(what, key=key)
    return part


def presets() -> dict[str, str]:
    """The ready-made runs: their names and descriptions."""
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
    """A configuration as text; None, empty tables and empty lists of tables are left out."""
    config = in_si("", config)
    plain = {key: value for key, value in config.items() if not isinstance(value, Mapping)}
    lines = _lines(plain)
    for name, table in config.items():
        if isinstance(table, Mapping) and (inner := _lines(table)):
            lines += [f"[{name}]", *inner]
    return "\n".join(lines) + "\n"


def _lines(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {_value(value, key)}" for key, value in table.items() if not _is_nothing(key, value)]


def _is_nothing(key: str, value: Any) -> bool:
    is_empty = getattr(value, "size", 1) == 0 or (isinstance(value, list | tuple) and len(value) == 0)
    return value is None or (key in _LISTS and is_empty)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)


def _value(value: Any, key: str = "") -> str:
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_lines(value)) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(one, key) for one in value) + "]"
    if isinstance(value, float) and not np.isfinite(value):
        return repr(float(value))
    if isinstance(value, str | bool | float) or isinstance(value, int) and -(2**63) <= value < 2**63:
        # written as in JSON, but for a character that TOML has not
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    expected = "a number, a text, a truth value, or lists and dictionaries of them, and whole numbers below 2^63"
    raise ConfigError(f"{key or 'configuration'}: found {value!r}; expected {expected}", key=key or None)
