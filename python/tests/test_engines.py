"""Sweeps by other people's engines, each with two worker processes: the same rows as here."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import beadline as bl

CHAIN = bl.Chain(beads=60, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={30: 0.6e-3})
RUN = bl.Run(CHAIN, strikers={0: 5.0}, duration_s=1e-3)
GRID = {"chain.alpha": [1.5, 2.0], "chain.impurities[0].mass_kg": np.geomspace(5e-4, 4e-3, 40)}


class Losing:
    """An executor whose workers no longer find a file that the sweep names."""

    def __init__(self, executor: Any, file: Path) -> None:
        self.executor, self.file = executor, file

    def submit(self, *call: Any) -> Any:
        self.file.unlink(missing_ok=True)
        return self.executor.submit(*call)


def check(executor: Any, tmp_path: Path) -> None:
    here, there = bl.sweep(RUN, GRID, jobs=2), bl.sweep(RUN, GRID, executor=executor)
    assert list(here) == list(there) and len(here) == 80
    assert all(here[name].tobytes() == there[name].tobytes() for name in here)
    # what goes wrong there is said here, also where tasks cannot be cancelled
    base, file = tmp_path / "base.toml", tmp_path / "s.toml"
    base.write_text(RUN.to_toml())
    file.write_text('[base]\nfile = "base.toml"\n[grid]\nchain.alpha = [1.5, 2.0]\n')
    with pytest.raises((bl.BeadlineError, OSError), match="base.toml"):
        bl.sweep(file, executor=Losing(executor, base))


@pytest.mark.extras
def test_dask_computes_the_same(tmp_path: Path) -> None:
    from distributed import Client

    flags = {"host": "127.0.0.1", "dashboard_address": None}
    with Client(n_workers=2, threads_per_worker=1, processes=True, **flags) as client:
        assert len(client.scheduler_info()["workers"]) == 2
        check(client.get_executor(), tmp_path)


@pytest.mark.extras
def test_parsl_computes_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from parsl.concurrent import ParslPoolExecutor
    from parsl.config import Config
    from parsl.executors import HighThroughputExecutor

    monkeypatch.chdir(tmp_path)
    # it looks for its own programs there
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    workers = HighThroughputExecutor(max_workers_per_node=2, address="127.0.0.1")
    with ParslPoolExecutor(Config(executors=[workers], run_dir=str(tmp_path / "runs"))) as executor:
        check(executor, tmp_path)
