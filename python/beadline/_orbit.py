"""Periodic orbits, their multipliers, and branches of orbits."""

from __future__ import annotations

import os
import re
import tempfile
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ._chain import Chain, number
from ._command import Json, run_command
from ._numbers import count, in_si
from ._recording import Recording
from ._recording import open as open_recording
from ._run import Run, _toml, initial_of, parts_of, rooted, value_of
from ._table import Table, read_csv
from .errors import CommandError


class Orbit:
    """A periodic orbit, or the end of a branch of them, in a directory of results."""

    def __init__(self, directory: str | os.PathLike[str], summary: Json, text: str) -> None:
        self._text = text
        #: The directory.
        self.path = Path(directory)
        #: All that the command says.
        self.summary = summary
        last = summary.get("last", summary)
        #: Period (s).
        self.period_s: float = last["period_s"]
        #: Energy (J) at its beginning.
        self.energy_j: float = last["energy_j"]
        #: The largest displacement (m) at its beginning.
        self.amplitude_m: float = last["amplitude_m"]
        #: Distance between the state and that a period later, over its size.
        self.returns: float = last["returns"]
        #: True if no multiplier is outside of the unit circle; None if none is found there, and not all are known.
        self.is_stable: bool | None = last["is_stable"]
        #: Of long chains the size above which all multipliers are known, else None.
        self.multipliers_above: float | None = (last.get("multipliers_limit") or {}).get("above")
        #: Its multipliers, by descending size; of a long chain the largest.
        self.multipliers: npt.NDArray[np.complex128] = np.array([complex(one["re"], one["im"]) for one in last["multipliers"]])
        #: Changes of stability along a branch, in its order.
        self.changes: list[Json] = summary.get("changes", [])

    @property
    def recording(self) -> Recording:
        """One period of it."""
        return open_recording(self.path / ("last.mcap" if "last" in self.summary else "orbit.mcap"))

    @property
    def branch(self) -> Table:
        """The orbits of a branch: the parameter, ``period_s``, ``energy_j``, ``amplitude_m``, ``largest_multiplier``, ``unstable``, ``returns``, ``branch``."""
        if "last" not in self.summary:
            raise ValueError("this is one orbit; orbit.continue_ follows it along a parameter")
        return read_csv(self.path / "branch.csv")

    def continue_(
        self,
        key: str,
        until: float,
        out: str | os.PathLike[str],
        *,
        step: float | None = None,
        most: int | None = None,
        branches: bool | None = None,
        force: bool = False,
    ) -> Orbit:
        """Follows this orbit along a key, with every change of stability.

        Args:
            key: A key of a configuration with the table ``orbit``: ``"orbit.energy_j"``, ``"drive[0].displacement_m.sine.amplitude"``.
            until: The value at which the branch ends. It begins at that of this orbit.
            out: A directory for the results. A branch that was interrupted goes on there.
            step: First step, over the whole way; by default 0.02.
            most: Most orbits; by default 1000.
            branches: Also follow the branches that are born at its changes of stability.
            force: Replace the results in the directory.

        Raises:
            ConfigError: If the key is not there.
            CommandError: If the branch has no first orbit.
        """
        config = self._from_here([key])
        begin = number(key, value_of(config, key))
        follow = {"key": key, "from": begin, "to": float(until), "step": step, "most": most, "branches": branches}
        config["continue"] = {name: one for name, one in follow.items() if one is not None}
        return Orbit(out, *_found(config, out, force))

    def map(self, grid: Mapping[str, Iterable[float]], out: str | os.PathLike[str], *, force: bool = False) -> OrbitMap:
        """Finds the orbit at each pair of values of two keys, and whether it is stable.

        Args:
            grid: Two keys of a configuration with the table ``orbit``, and the values of each, which rise or fall. Orbits along the second
                key are found one after the other, from this orbit on.
            out: A directory for the results. A map that was interrupted goes on there.
            force: Replace the results in the directory.

        Raises:
            CommandValueError: If there are other than two keys, or the chain has no orbits.
        """
        values = {key: [float(value) for value in values] for key, values in grid.items()}
        summary, _ = _found({**self._from_here(values), "grid": values}, out, force)
        return OrbitMap(out, summary, values)

    def _from_here(self, keys: Iterable[str]) -> dict[str, Any]:
        """An orbit file that begins at this orbit, and asks for one by those of these keys that tell which."""
        config = tomllib.loads(self._text)
        if (followed := config.pop("continue", None)) is not None:
            *parts, name = parts_of(followed["key"])
            place: Any = config
            for part in parts:
                place = place[part]
            # the last orbit of the first branch
            place[name] = float(self.branch[followed["key"]][self.branch["branch"] == 0][-1])
        beginning = self.recording[0]
        config.pop("striker", None)
        asked: dict[str, Any] = config.setdefault("orbit", {})
        asked.pop("mode", None)
        if "drive" not in config:
            asked["period_s"] = self.period_s
        quantities = {
            "orbit.period_s": self.period_s,
            "orbit.energy_j": self.energy_j,
            "orbit.amplitude_m": float(beginning.displacement_m[np.abs(beginning.displacement_m).argmax()]),
        }
        for key in quantities.keys() & set(keys):
            # another quantity may have been asked for
            for name in ("energy_j", "amplitude_m"):
                asked.pop(name, None)
            asked[key.removeprefix("orbit.")] = quantities[key]
        config["initial"] = initial_of(beginning)
        return config

    def __repr__(self) -> str:
        way = {True: "stable", False: "unstable", None: "stable as far as known"}[self.is_stable]
        return f"Orbit(period_s={self.period_s!r}, energy_j={self.energy_j!r}, {way})"


class OrbitMap:
    """Orbits at all pairs of values of two keys, in a directory of results."""

    def __init__(self, directory: str | os.PathLike[str], summary: Json, values: Mapping[str, list[float]]) -> None:
        #: The directory; its ``map.png`` shows where the orbits are stable.
        self.path = Path(directory)
        #: The two keys, and their values.
        self.values = {key: np.array(of_key) for key, of_key in values.items()}
        #: The number of points by ``"stable"``, the name of an instability, or ``"no orbit found"``, with the reason behind it where steps became too long.
        self.stability: dict[str, int] = summary["stability"]

    @property
    def table(self) -> Table:
        """The points, of which those along the second key are neighbours: both keys, ``period_s``, ``energy_j``, ``amplitude_m``, ``largest_multiplier``,
        ``unstable``, ``returns``, ``largest_angle_rad``, ``stability``. All but keys and stability are empty where no orbit was found, and
        the angle where no multiplier is outside of the unit circle."""
        return read_csv(self.path / "map.csv")

    def column(self, name: str) -> npt.NDArray[Any]:
        """A column of the table as an array over the values of both keys."""
        return self.table[name].reshape([len(of_key) for of_key in self.values.values()])

    def __repr__(self) -> str:
        return f"OrbitMap({', '.join(f'{name}: {count}' for name, count in self.stability.items())})"


def orbit(
    run: Run | Chain,
    out: str | os.PathLike[str],
    *,
    period_s: float | None = None,
    energy_j: float | None = None,
    amplitude_m: float | None = None,
    mode: Mapping[str, Any] | None = None,
    periods: int | None = None,
    shift_beads: int | None = None,
    steps: int | None = None,
    segments: int | None = None,
    force: bool = False,
) -> Orbit:
    """Finds a periodic orbit and its multipliers, as ``beadline orbit`` does.

    Args:
        run: A chain; or a run, whose beginning is the seed and whose drives give the period.
        out: A directory for the results.
        period_s: The period (s); beside another quantity a first guess of it.
        energy_j: The energy (J), with the period free.
        amplitude_m: The displacement (m) at the beginning of the bead that the seed displaces most, with the period free.
        mode: A linear mode as the seed: ``{"number": 22, "displacement_m": 0.02}``, as ``beadline modes`` counts them.
        periods: Periods of the drive in one of the orbit; by default 1.
        shift_beads: Beads by which the state is displaced after a period, for waves.
        steps: Steps of a period; by default those that the run takes for it.
        segments: Parts into which the period is divided: for very unstable orbits.
        force: Replace the results in the directory.

    Raises:
        CommandError: If no orbit is found near the seed; the message has the residuals and what may help.
        CommandValueError: If the chain has no orbits.
    """
    if isinstance(run, Chain):
        config = tomllib.loads(Run(run, strikers={0: 1.0}, duration_s=1.0).to_toml())
        del config["striker"], config["time"]
    elif not isinstance(run, Run):
        raise TypeError(f"run: found {run!r}; expected a beadline.Run or a Chain; Run.from_recording(rec) is the run of a recording")
    else:
        config = rooted(run._folder, "", tomllib.loads(run.to_toml()))
    numbers = {"period_s": period_s, "energy_j": energy_j, "amplitude_m": amplitude_m}
    counts = {"periods": periods, "shift_beads": shift_beads, "steps": steps, "segments": segments}
    asked: dict[str, Any] = {name: float(in_si(name, one)) for name, one in numbers.items() if one is not None}
    asked |= {name: count(name, one) for name, one in counts.items() if one is not None}
    if mode is not None:
        asked["mode"] = dict(mode)
    return Orbit(out, *_found({**config, "orbit": asked}, out, force))


def _found(config: Mapping[str, Any], out: str | os.PathLike[str], force: bool) -> tuple[Json, str]:
    """Runs an orbit file: the summary of the command, and the file."""
    text = _toml(config)
    flags = [f"--out={os.fspath(out)}", *(["--force"] if force else [])]
    with tempfile.TemporaryDirectory(prefix="beadline-") as directory:
        path = os.path.join(directory, "orbit.toml")
        Path(path).write_text(text, encoding="utf-8")
        try:
            summary = run_command(["orbit", path, *flags])
        except CommandError as error:
            # nobody has seen this file
            error.args = (re.sub(rf"{re.escape(path)}(:\d+)?: ", "", str(error)),)
            raise
    return summary, text
