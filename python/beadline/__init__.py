"""Shocks in granular chains: simulated, recorded, watched and analysed.

>>> import beadline as bl
>>> chain = bl.Chain(beads=100, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={50: 0.6e-3})
>>> rec = bl.Run(chain, strikers={0: 5.0}, duration_s=2e-3).simulate()
>>> rec.velocity.shape[1]
100

Units are SI and part of names: ``_m``, ``_s``, ``_kg``, ``_n``, ``_j``, ``_m_s``. Beads and contacts are numbered from 0;
contact ``i`` joins beads ``i`` and ``i + 1``.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from ._native import __version__

if TYPE_CHECKING:
    from ._analyses import Forces, Motion, Pulses
    from ._live import (
        Analysis,
        AsyncLive,
        Consumer,
        Frame,
        Live,
        LiveConsumer,
        LiveRun,
        analysis,
        attach,
        attach_async,
        consumer,
        live_runs,
    )
    from ._chain import Chain
    from ._comparison import Comparison, Difference, compare
    from ._fields import FieldArray
    from ._files import Verdict, View
    from ._orbit import Orbit, OrbitMap, orbit
    from ._recording import Recording, State, open
    from ._run import Run, Simulation, preset, presets, simulate
    from ._sweep import sweep
    from ._table import Table
    from .errors import (
        BeadlineError,
        CommandError,
        CommandValueError,
        ConfigError,
        LiveError,
        LostError,
        MissingExtraError,
        RecordingError,
        RunError,
    )

# where each name is: the command, which is in this package, too, starts without NumPy
_PLACES = {
    "_analyses": ("Forces", "Motion", "Pulses"),
    "_chain": ("Chain",),
    "_comparison": ("Comparison", "Difference", "compare"),
    "_fields": ("FieldArray",),
    "_files": ("Verdict", "View"),
    "_live": (
        "Analysis",
        "AsyncLive",
        "Consumer",
        "Frame",
        "Live",
        "LiveConsumer",
        "LiveRun",
        "analysis",
        "attach",
        "attach_async",
        "consumer",
        "live_runs",
    ),
    "_orbit": ("Orbit", "OrbitMap", "orbit"),
    "_recording": ("Recording", "State", "open"),
    "_run": ("Run", "Simulation", "preset", "presets", "simulate"),
    "_sweep": ("sweep",),
    "_table": ("Table",),
    "errors": (
        "BeadlineError",
        "CommandError",
        "CommandValueError",
        "ConfigError",
        "LiveError",
        "LostError",
        "MissingExtraError",
        "RecordingError",
        "RunError",
    ),
}

__all__ = [
    "Analysis",
    "AsyncLive",
    "BeadlineError",
    "Chain",
    "CommandError",
    "CommandValueError",
    "Comparison",
    "ConfigError",
    "Consumer",
    "Difference",
    "FieldArray",
    "Forces",
    "Frame",
    "Live",
    "LiveConsumer",
    "LiveError",
    "LiveRun",
    "LostError",
    "MissingExtraError",
    "Motion",
    "Orbit",
    "OrbitMap",
    "Pulses",
    "Recording",
    "RecordingError",
    "Run",
    "RunError",
    "Simulation",
    "State",
    "Table",
    "Verdict",
    "View",
    "__version__",
    "analysis",
    "attach",
    "attach_async",
    "compare",
    "consumer",
    "live_runs",
    "open",
    "orbit",
    "preset",
    "presets",
    "simulate",
    "sweep",
]


def __getattr__(name: str) -> object:
    for place, names in _PLACES.items():
        if name in names:
            found: object = getattr(importlib.import_module(f".{place}", __name__), name)
            globals()[name] = found
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
