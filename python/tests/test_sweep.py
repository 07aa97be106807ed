"""Sweeps: the same rows wherever they are computed."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from threading import Event

import numpy as np
import pytest

import beadline as bl

CHAIN = bl.Chain(beads=60, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={30: 0.6e-3})
RUN = bl.Run(CHAIN, strikers={0: 5.0}, duration_s=1e-3)
MASSES_KG = np.geomspace(5e-4, 4e-3, 40)
GRID = {"chain.alpha": [1.5, 2], "chain.impurities[0].mass_kg": MASSES_KG}


@pytest.fixture(scope="module")
def table() -> bl.Table:
    return bl.sweep(RUN, GRID, jobs=2)


def is_same(a: bl.Table, b: bl.Table) -> bool:
    """Whether two tables have the same columns, to the bit."""
    assert list(a) == list(b)
    same = (a[name].dtype == b[name].dtype and a[name].tobytes() == b[name].tobytes() for name in a)
    return all(same)


def test_the_grid_comes_first_and_its_last_key_varies_fastest(table: bl.Table) -> None:
    assert list(table)[:3] == [*GRID, "end"] and len(table) == 80
    assert table["chain.alpha"].tolist() == 40 * [1.5] + 40 * [2.0]
    assert table["chain.impurities[0].mass_kg"].tobytes() == np.tile(MASSES_KG, 2).tobytes()
    assert set(table["end"]) == {"complete"} and set(table["error"]) == {""}
    assert table["steps"].dtype == np.int64


def test_a_row_is_what_the_analysis_of_its_run_says(table: bl.Table) -> None:
    run = RUN.replace({"chain.alpha": 2.0, "chain.impurities[0].mass_kg": float(MASSES_KG[7])})
    last = run.simulate()[-1]
    row = table[40 + 7 : 40 + 8]
    assert (row["steps"][0], row["time_s"][0], row["dt_s"][0]) == (last.step, last.time_s, run.dt_s)
    kinetic_j = 0.5 * last.mass_kg @ last.velocity_m_s**2
    # the order of the sum is another
    assert row["kinetic_j"][0] == pytest.approx(kinetic_j, rel=1e-13)


def test_threads_and_processes_compute_the_same(table: bl.Table) -> None:
    # processes that are forked of one with threads may hang
    pools: list[Executor] = [ThreadPoolExecutor(2), ProcessPoolExecutor(2, get_context("spawn"))]
    for pool in pools:
        with pool:
            assert is_same(bl.sweep(RUN, GRID, executor=pool), table)


def test_the_command_computes_the_same_and_goes_on(table: bl.Table, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = bl.sweep(RUN, GRID, out=out, jobs=2)
    assert is_same(first, table) and first.summary["computed"] == 80
    again = bl.sweep(RUN, GRID, out=out)
    assert is_same(again, table) and again.summary["computed"] == 0


def test_another_sweep_does_not_replace_the_rows_of_one(tmp_path: Path) -> None:
    one, other = {"chain.alpha": [1.5]}, {"chain.alpha": [2.0, 2.5]}
    bl.sweep(RUN, one, out=tmp_path / "out")
    with pytest.raises(bl.CommandError, match="holds another sweep, of 1 points"):
        bl.sweep(RUN, other, out=tmp_path / "out")
    assert len(bl.sweep(RUN, other, out=tmp_path / "out", force=True)) == 2


def test_a_sweep_file_has_the_rows_of_the_command(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(RUN.to_toml())
    file = tmp_path / "s.toml"
    file.write_text(
        'until = "stationary"\nsplit_bead = 20\ncheck = true\n[base]\nfile = "base.toml"\n[grid]\n'
        'chain.alpha = { from = 1.3, to = 2.0, count = 3 }\n[[case]]\n"integrator.method" = "gear5"\n'
        '[[case]]\n"striker.velocity_m_s" = 2\n'
    )
    here = bl.sweep(file)
    # the keys of cases are those that a row may be without
    assert here["integrator.method"].tolist() == 3 * ["gear5"] + 3 * [""]
    assert np.isnan(here["striker.velocity_m_s"][:3]).all() and set(here["split_bead"]) == {20}
    assert "determined_until_s" in here
    assert is_same(bl.sweep(file, out=tmp_path / "out"), here)
    with pytest.raises(ValueError, match="beside it"):
        bl.sweep(file, {"chain.alpha": [2.0]})
    with pytest.raises(TypeError, match="run: found <Chain .*; expected a beadline.Run, or the path of a sweep file"):
        bl.sweep(CHAIN, {"chain.alpha": [2.0]})  # type: ignore[arg-type]


def test_columns_over_time_are_in_a_file_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(RUN.to_toml())
    file = tmp_path / "s.toml"
    file.write_text('[base]\nfile = "base.toml"\n[grid]\nchain.alpha = [1.5, 2.0]\n[series]\nmeasure = ["energies.kinetic_j"]\ncount = 3\n')
    assert is_same(bl.sweep(file, out=tmp_path / "out"), bl.sweep(file))
    assert (tmp_path / "out" / "series.csv").exists()


def test_what_a_sweep_file_can_say_can_be_said_here() -> None:
    alpha = {"from": 1, "to": 4, "count": 3, "spacing": "log"}
    cases: list[dict[str, str | float]] = [
        {"integrator.method": "gear5"},
        {"integrator.method": "rkn4", "time.dt_s": 1e-6},
    ]
    grid = {"chain.alpha": alpha}
    table = bl.sweep(RUN, grid, cases=cases, until="stationary", check=True, split=20)
    assert table["chain.alpha"].tolist() == [1.0, 2.0, 4.0] * 2
    assert table["integrator.method"].tolist() == 3 * ["gear5"] + 3 * ["rkn4"]
    assert set(table["split_bead"]) == {20} and "determined_until_s" in table


def test_frames_are_analysed_as_often_as_the_run_is_published() -> None:
    grid = {"chain.alpha": [1.5]}
    often = bl.sweep(RUN, {**grid, "stream.publish_every_steps": [7]})
    run = bl.Run(CHAIN, strikers={0: 5.0}, duration_s=1e-3, publish_every=7)
    seventh = bl.sweep(run, grid)
    assert all(often[name].tobytes() == seventh[name].tobytes() for name in seventh)


def test_files_that_a_run_names_are_those_of_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chain = {"beads": 5, "bead_mass_kg": 1e-3, "alpha": 1.5, "stiffness": 1e7}
    config = {"chain": chain, "drive": [{"bead": 0, "force_n": {"csv": "push.csv"}}], "time": {"duration_s": 2e-4}}
    for folder, number in (("mine", 1), ("other", 2)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "push.csv").write_text(f"time_s,value\n0,{number}\n1e-3,{number}\n")
        (tmp_path / folder / "twice.csv").write_text(f"time_s,value\n0,{2 * number}\n1e-3,{2 * number}\n")
    monkeypatch.chdir(tmp_path / "mine")
    run = bl.Run.from_config(config)
    monkeypatch.chdir(tmp_path / "other")
    expected = [kinetic_j(run), kinetic_j(run.replace({"drive[0].force_n.csv": "twice.csv"}))]
    grid = {"drive[0].force_n.csv": np.array(["push.csv", "twice.csv"])}
    cases = [{"drive": [{"bead": 0, "force_n": {"csv": name}}]} for name in ("push.csv", "twice.csv")]
    for where in ({}, {"out": tmp_path / "out", "force": True}):
        assert bl.sweep(run, {"integrator.method": ["rkn4"]}, **where)["kinetic_j"] == pytest.approx(expected[:1], rel=1e-12)
        assert bl.sweep(run, grid, **where)["kinetic_j"] == pytest.approx(expected, rel=1e-12)
        assert bl.sweep(run, cases=cases, **where)["kinetic_j"] == pytest.approx(expected, rel=1e-12)


def kinetic_j(run: bl.Run) -> float:
    return run.simulate()[-1].kinetic_j


def test_recordings_are_in_the_directory(tmp_path: Path) -> None:
    table = bl.sweep(RUN, {"chain.alpha": [1.5, 2.0]}, out=tmp_path, record=True)
    rec = bl.open(tmp_path / "recordings" / "point-000001.mcap")
    assert rec.last_step == table["steps"][1]
    with pytest.raises(ValueError, match="`out`"):
        bl.sweep(RUN, GRID, record=True)


def test_values_can_be_lists_of_any_length() -> None:
    impurities = [[], [{"bead": 20, "mass_kg": 2e-3}, {"bead": 30, "mass_kg": 2e-3}]]
    table = bl.sweep(RUN, {"chain.impurities": impurities})
    # without one the middle bead is the one that divides
    assert table["split_bead"].tolist() == [30, 20]


def test_a_run_that_cannot_be_is_named_before_any_begins() -> None:
    with pytest.raises(bl.ConfigError, match=r"^chain\.alpha: found 0\.5; allowed") as caught:
        bl.sweep(RUN, {"chain.alpha": [1.5, 0.5]})
    assert (caught.value.key, caught.value.line) == ("chain.alpha", None)


def test_what_is_no_list_of_cases_and_no_executor_is_refused() -> None:
    with pytest.raises(TypeError, match="cases: found {'chain.alpha': 1.5}; expected a list of dictionaries"):
        bl.sweep(RUN, cases={"chain.alpha": 1.5})  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="executor: found 5; expected an executor"):
        bl.sweep(RUN, GRID, executor=5)  # type: ignore[arg-type]


def test_a_run_that_fails_has_a_row_that_says_why() -> None:
    # the longest step that is taken: the Gear method gains energy with it, ever faster between two walls
    chain = bl.Chain(beads=10, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed", right="fixed")
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=1.0, method="gear5")
    with pytest.warns(RuntimeWarning, match="1 of 2 runs failed"):
        table = bl.sweep(run, {"time.dt_s": [1.8e-5, 2e-6]})
    assert table["end"].tolist() == ["failed", "complete"]
    assert "not finite at step" in table["error"][0] and table["error"][1] == ""
    assert np.isnan(table["total_j"][0]) and table.summary["failed"] == [0]


@pytest.mark.extras
def test_values_of_a_grid_are_any_sequence() -> None:
    import pandas

    table = bl.sweep(RUN, {"chain.beads": range(50, 53), "chain.alpha": pandas.Series([1.5, 2.0])})
    assert table["chain.beads"].tolist() == [50, 50, 51, 51, 52, 52]
    assert table["chain.alpha"].tolist() == [1.5, 2.0] * 3
    with pytest.raises(bl.ConfigError, match="allowed: a list of values, or a range"):
        bl.sweep(RUN, {"chain.alpha": 1.5})


def test_a_base_that_has_changed_is_read_again(tmp_path: Path) -> None:
    base, file = tmp_path / "base.toml", tmp_path / "s.toml"
    file.write_text('[base]\nfile = "base.toml"\n[grid]\nchain.alpha = [1.5]\n')
    with ThreadPoolExecutor(1) as pool:
        for duration_s in (1e-3, 2e-3):
            base.write_text(RUN.replace({"time.duration_s": duration_s}).to_toml())
            assert bl.sweep(file, executor=pool)["time_s"][0] == pytest.approx(duration_s, rel=1e-2)


INTERRUPTED = """
import signal, time
from concurrent.futures import ThreadPoolExecutor
import beadline as bl
class Pool(ThreadPoolExecutor):
    tasks = []
    def submit(self, *call):
        self.tasks.append(super().submit(*call))
        return self.tasks[-1]
signal.signal(signal.SIGALRM, signal.default_int_handler)
run = bl.preset("light-impurity").replace({"time.duration_s": DURATION_S})
sweep = bl.sweep
try:
    begin_s = time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    sweep(run, {"chain.alpha": [1.5, 1.6, 1.7, 1.8, 1.9]}, executor=EXECUTOR)
except KeyboardInterrupt:
    print(time.monotonic() - begin_s - 0.3, sum(task.cancelled() for task in Pool.tasks))
"""


@pytest.mark.parametrize(
    ("executor", "duration_s", "cancelled"), [("None", 10.0, 0), ("Pool(1)", 0.5, 4)]
)
def test_ctrl_c_ends_a_sweep_and_no_run_begins_after_it(
    executor: str, duration_s: float, cancelled: int
) -> None:
    script = INTERRUPTED.replace("EXECUTOR", executor).replace("DURATION_S", str(duration_s))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    took_s, found = done.stdout.split()
    # 0.2 s, and what a busy machine adds; the pool was at its first run
    assert float(took_s) < 2.0 and int(found) == cancelled


def test_an_analysis_of_ones_own_is_measured_in_a_sweep() -> None:
    @bl.analysis(columns={"way_m": "way that bead 0 has gone"}, name="way-of-0")
    def way():  # type: ignore[no-untyped-def]
        way = last = 0.0
        while True:
            frame = yield way
            way, last = way + abs(frame.displacement_m[0] - last), frame.displacement_m[0]

    run = bl.preset("homogeneous").replace({"chain.beads": 20, "time.duration_s": 2e-4})
    table = bl.sweep(run, {"chain.alpha": [1.5, 2.0]}, measure=["way-of-0.way_m", "energies.driven_j"], jobs=2)
    with pytest.raises(ValueError, match="^way-of-0.way_m: found an analysis of this process beside out"):
        bl.sweep(run, {"chain.alpha": [1.5]}, measure=["way-of-0.way_m"], out="out")
    assert table["energies.driven_j"].tolist() == [0.0, 0.0]
    every = int(table["steps"][0]) // 10
    assert (table["way-of-0.way_m"] > 0).all() and every > 0
    # frames of a recording give what the last frame of a sweep has
    of_file = way.follow(run.replace({"chain.alpha": 1.5}).simulate(every=1), every_step=True)["way_m"][-1]
    assert abs(of_file / table["way-of-0.way_m"][0] - 1) < 1e-2


def test_a_generator_that_ends_before_the_frames_says_so() -> None:
    @bl.analysis(columns={"a_m": "nothing"})
    def brief():  # type: ignore[no-untyped-def]
        yield 0.0
        yield 1.0

    run = bl.preset("homogeneous").replace({"chain.beads": 20, "time.duration_s": 2e-4})
    said = "^brief ended before the frames did, at frame 1; a generator yields"
    with pytest.raises(bl.BeadlineError, match=said) as caught:
        list(map(brief.follow, [run.simulate(every=1)]))
    assert (caught.value.frame, caught.value.step) == (1, 1)
    with pytest.raises(bl.BeadlineError, match="^brief ended before the frames did"):
        bl.sweep(run, {"chain.alpha": [1.5]}, measure=["brief.a_m"])


def test_an_analysis_of_ones_own_that_raises_ends_the_sweep() -> None:
    @bl.analysis(columns={"a_m": "nothing"})
    class Wrong:
        def frame(self, frame: object) -> float:
            raise RuntimeError("of mine")

    run = bl.preset("homogeneous").replace({"chain.beads": 20, "time.duration_s": 2e-4})
    with pytest.raises(RuntimeError, match="of mine"):
        bl.sweep(run, {"chain.alpha": [1.5]}, measure=["wrong.a_m"])
    with pytest.raises(ValueError, match="energies"):
        bl.analysis(columns={"a_m": "nothing"}, name="energies")(Wrong.function)


def test_an_exception_is_raised_by_the_sweep_that_it_is_of_and_ends_it() -> None:
    raised = Event()
    seen: list[object] = []

    @bl.analysis(columns={"a_m": "nothing"})
    class Guilty:
        def frame(self, frame: object) -> float:
            seen.append(frame)
            raised.set()
            raise RuntimeError("of mine")

    @bl.analysis(columns={"a_m": "nothing"})
    class Innocent:
        def frame(self, frame: object) -> float:
            # its sweep ends while the other has an exception
            assert raised.wait(60)
            return 1.0

    run = bl.preset("homogeneous").replace({"chain.beads": 20, "time.duration_s": 2e-4})

    def swept(name: str, points: int) -> bl.Table:
        alphas = [1.5 + 0.01 * point for point in range(points)]
        return bl.sweep(run, {"chain.alpha": alphas}, measure=[f"{name}.a_m"], jobs=1)

    with ThreadPoolExecutor(2) as pool:
        innocent, guilty = pool.submit(swept, "innocent", 1), pool.submit(swept, "guilty", 100)
        with pytest.raises(RuntimeError, match="of mine"):
            guilty.result()
        assert innocent.result()["innocent.a_m"].tolist() == [1.0]
    # those beside each other in the processor's registers
    assert len(seen) <= 8


YIELDING = """
import os
import beadline as bl
@bl.analysis(columns={"a_m": "nothing"})
class Yielding:
    def __init__(self):
        for _ in range(10):
            os.sched_yield()
    def frame(self, frame):
        return 1.0
run = bl.preset("homogeneous").replace({"chain.beads": 20, "time.duration_s": 2e-4})
alphas = [1.5 + 0.01 * point for point in range(40)]
print(bl.sweep(run, {"chain.alpha": alphas}, measure=["yielding.a_m"], jobs=2)["yielding.a_m"].sum())
"""


def test_an_analysis_that_lets_others_have_the_interpreter_is_begun_in_two_threads() -> None:
    done = subprocess.run([sys.executable, "-c", YIELDING], capture_output=True, text=True, check=True, timeout=60)
    assert float(done.stdout) == 40.0
