"""Measures this machine: each figure of the package beside its limit. ``python -m beadline.bench``; exit code 3 if one is missed.

Two programs that are compared run in turns; the figure is the median over the rounds.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

import beadline as bl

COMMAND = (sys.executable, "-m", "beadline")
PRESET = "light-impurity"


class Row(NamedTuple):
    """A figure beside its limit."""

    what: str
    value: float
    unit: str
    limit: float
    is_floor: bool
    note: str

    @property
    def is_met(self) -> bool:
        """True if the figure keeps to its limit."""
        return self.value >= self.limit if self.is_floor else self.value <= self.limit

    def __str__(self) -> str:
        figure = f"{self.value:,.3g} {self.unit}" if self.value < 1000 else f"{self.value:,.0f} {self.unit}"
        limit = f"{'≥' if self.is_floor else '≤'} {self.limit:,g}"
        return f"{self.what:<50}{figure:<20}{limit:<12}{'met' if self.is_met else 'missed':<8}{self.note}"


def timed(work: Callable[[], object]) -> float:
    """Time that it takes (s)."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def command(*arguments: str) -> dict[str, Any]:
    """A command's answer."""
    done = subprocess.run([*COMMAND, *arguments, "--json"], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def random_step(rec: bl.Recording, what: str, limit_ms: float, steps: int) -> Row:
    """Any step of a recording, by its number."""
    chosen = np.random.default_rng(1).integers(rec.first_step, rec.last_step, steps).tolist()

    def seconds(step: int) -> float:
        return timed(lambda: rec[step].velocity_m_s)

    each_ms = [1e3 * seconds(step) for step in chosen]
    note = f"median of {steps:,}; p99 {np.quantile(each_ms, 0.99):.3g} ms"
    return Row(what, median(each_ms), "ms", limit_ms, False, note)


def every_step(rec: bl.Recording, path: Path, rounds: int) -> Row:
    """Every step as an array, beside the command that computes energies of every step, without the time of its start."""

    def through_arrays() -> None:
        for _ in rec.velocity.blocks():
            pass

    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(rounds):
        ours.append(timed(through_arrays))
        start_s = timed(lambda: subprocess.run([*COMMAND, "--version"], check=True, stdout=subprocess.DEVNULL))
        theirs.append(timed(lambda: command("energies", str(path), "--every-step")) - start_s)
    ratio = median(their / our for our, their in zip(ours, theirs, strict=True))
    note = f"{len(rec) / median(ours):,.0f} steps/s, the command {len(rec) / median(theirs):,.0f}"
    return Row("every step of a 1:100 log ÷ energies --every-step", ratio, "", 0.8, True, note)


def live_frames(arguments: list[str], rounds: int) -> Row:
    """A loop that reads a number of each frame of a run in another process, which waits for it."""
    rates: list[float] = []
    for _ in range(rounds):
        run = [*COMMAND, "run", "--preset", PRESET, "--name", "bench", "--no-record", "--wait-for", "1", *arguments]
        producer = subprocess.Popen(run, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            with bl.attach("bench", timeout_s=60.0) as live:
                frames, sum_m_s, first_s = 0, 0.0, 0.0
                for frame in live:
                    first_s = first_s or time.perf_counter()
                    sum_m_s += frame.velocity_m_s[0]
                    frames += 1
            rates.append(frames / (time.perf_counter() - first_s))
        finally:
            producer.terminate()
            producer.wait()
    return Row("live loop, 16 kB a frame", median(rates), "frames/s", 100_000, True, "two processes, nothing lost")


def simulate(run: bl.Run, arguments: list[str], rounds: int) -> Row:
    """A run in memory, beside the command, of which only the run is counted."""
    ratios: list[float] = []
    for _ in range(rounds):
        ours_s = timed(lambda: run.simulate(progress=False))
        theirs_s = float(command("run", "--preset", PRESET, "--no-record", *arguments)["wall_s"])
        ratios.append(ours_s / theirs_s)
    note = f"{min(ratios):.3g} to {max(ratios):.3g}; ours keeps every 100th state"
    return Row("run.simulate ÷ run --no-record, time", median(ratios), "", 1.05, False, note)


def rows(directory: Path, quick: bool) -> Iterator[Row]:
    """All figures, one after the other."""
    rounds, steps = (1, 10) if quick else (9, 1000)
    duration_s = 2e-3 if quick else 0.08
    arguments = ["--duration", str(duration_s)]
    run = bl.preset(PRESET).replace({"time.duration_s": duration_s})
    sparse = run.record(directory / "sparse.mcap", every=100, progress=False)
    yield random_step(sparse, "a random step of a 1:100 log", 1.5, steps)
    full = run.record(directory / "full.mcap", progress=False)
    yield random_step(full, "a random step of a full log", 0.6, steps)
    yield every_step(sparse, directory / "sparse.mcap", rounds)
    yield live_frames(arguments, rounds)
    yield simulate(run, arguments, rounds)


def main() -> int:
    """Prints the table; 3 if a figure does not keep to its limit."""
    about = "Measures each figure of the package beside its limit; exit code 3 if one is missed."
    parser = argparse.ArgumentParser(prog="python -m beadline.bench", description=about)
    parser.add_argument("--quick", action="store_true", help="a short run, once: says that it works, not how fast it is")
    quick = parser.parse_args().quick
    is_met = True
    with tempfile.TemporaryDirectory(prefix="bl-", dir="/tmp") as place:
        # runs of others on the bus are left alone
        os.environ["BEADLINE_ROOT"] = f"{place}/bus"
        for row in rows(Path(place), quick):
            print(row, flush=True)
            is_met = is_met and row.is_met
    return 0 if is_met else 3


if __name__ == "__main__":
    sys.exit(main())
