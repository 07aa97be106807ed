"""What strangers, long runs and other hands do to the package."""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Callable
from pathlib import Path
from shutil import copyfile
from threading import Thread
from typing import Any

import numpy as np
import pytest

import beadline as bl
from beadline import _native

BEADS = 12


def made(steps: int, every: int) -> bl.Recording:
    """A run in memory that claims to go on for a long time, with its first and its last state."""
    chain = bl.Chain(BEADS, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=1e-6 * steps, dt_s=1e-6)
    states = np.zeros((2, 2 * BEADS))
    states[:, BEADS] = 5.0
    kept = np.array([0, run.steps], np.uint64)
    return bl.Recording(_native.States.of_kept(run._manifest.begun(every), kept, states, "complete"))


@pytest.fixture(scope="module")
def short() -> bl.Recording:
    chain = bl.Chain(BEADS, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    return bl.Run(chain, strikers={0: 5.0}, duration_s=1e-4).simulate(every=10)


def test_steps_of_a_long_run_cost_nothing_before_they_are_taken() -> None:
    rec = made(10**15, 10**14)
    velocity = rec.velocity
    assert len(velocity) == len(rec) == 10**15 + 1
    assert velocity[0, 0] == velocity[-1, 0] == velocity[[0, -1]][1, 0] == 5.0
    assert velocity[:: 10**15].shape == (2, BEADS) and velocity[5:0:-1].shape == (5, BEADS)
    assert len(rec.recorded_steps) == 11 and next(rec.states(10**15)).step == 0
    with pytest.raises(IndexError, match="1,000,000,000,000,001"):
        velocity[10**15 + 1]
    with pytest.raises(MemoryError, match="a part"):
        np.asarray(velocity)


def test_a_file_that_claims_more_states_than_memory_is_still_opened(tmp_path: Path) -> None:
    rec = made(10**15, 1).save(tmp_path / "claims.mcap")
    assert "steps 0 to 1000000000000000" in repr(rec) and rec[0].step == 0
    assert "MemoryError" in rec._repr_html_()
    for what in ("recorded_steps", "time_s"):
        with pytest.raises(MemoryError, match="a list of"):
            getattr(rec, what)


def test_a_map_of_contacts_is_no_recording_of_states() -> None:
    golden = Path(__file__).parents[2] / "tests/golden/1.0-kernel-2/contacts.mcap"
    with pytest.raises(bl.RecordingError, match="holds no states, only /contacts"):
        bl.open(golden)


def test_a_recording_stays_the_same_file_in_another_directory(
    short: bl.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = short.save(tmp_path / "made.mcap")
    monkeypatch.chdir(tmp_path)
    # names that the command would take for something else, or that are no text, which it does not take
    for name in ("live", "-v.mcap", os.fsdecode(b"\xff \xc3\xa9.mcap")):
        copyfile(str(made.path), name)
        rec = bl.open(name)
        monkeypatch.chdir("/")
        assert np.array_equal(rec.velocity[3], short.velocity[3])
        assert rec.refresh().last_step == rec.last_step
        assert not name.isascii() or len(rec.energies()) == len(short.recorded_steps)
        monkeypatch.chdir(tmp_path)


def test_modules_of_the_working_directory_are_nobody_elses(
    short: bl.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("beadline.py", "types.py", "json.py"):
        (tmp_path / name).write_text("not Python")
    monkeypatch.chdir(tmp_path)
    assert len(short.energies()) == len(short.recorded_steps)


@pytest.mark.parametrize(
    "key", [True, False, (0, True), (True, [1, 2]), np.array(True), np.ones(3, bool), np.ones((70, 11), bool), np.array([])]
)
def test_truth_values_index_as_those_of_numpy(short: bl.Recording, key: Any) -> None:
    whole = np.asarray(short.velocity)
    try:
        expected = whole[key]
    except IndexError:
        with pytest.raises(IndexError):
            short.velocity[key]
    else:
        assert np.array_equal(np.asarray(short.velocity[key]), expected)


def test_a_lazy_array_is_gone_through_and_not_changed(short: bl.Recording) -> None:
    whole = np.asarray(short.velocity)
    assert np.array_equal(list(short.velocity), whole) and list(short.velocity[:, 1]) == whole[:, 1].tolist()
    assert 5.0 in short.velocity and 5.5 not in short.velocity
    velocity = short.velocity
    with pytest.raises(TypeError, match="cannot be changed"):
        velocity += 1.0


def test_what_is_done_to_the_arrays_of_a_simulation_does_not_reach_it() -> None:
    chain = bl.Chain(BEADS, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    simulation = bl.Run(chain, strikers={0: 5.0}, duration_s=1e-4).start()
    velocity_m_s = simulation.velocity_m_s
    velocity_m_s.shape = (3, 4)
    with pytest.raises(ValueError):
        velocity_m_s.resize(5, refcheck=False)
    simulation.step()
    assert simulation.velocity_m_s.shape == (BEADS,)
    assert np.array_equal(velocity_m_s.ravel(), simulation.state().velocity_m_s)


def test_numbers_of_beads_are_whole() -> None:
    kind = {"mass_kg": 1e-3, "alpha": 1.5, "stiffness": 1e7}
    chain = bl.Chain(1e2, **kind)  # type: ignore[arg-type]
    assert chain.beads == 100
    for wrong in (
        lambda: bl.Chain(2.5, **kind),  # type: ignore[arg-type]
        lambda: bl.Chain(9, **kind, impurities={1.5: 1e-3}),  # type: ignore[arg-type, dict-item]
        lambda: bl.Run(chain, strikers={0.5: 5.0}, duration_s=1e-4),  # type: ignore[dict-item]
        lambda: bl.Run(chain, strikers={0: 5.0}, duration_s=1e-4, publish_every=1.5),  # type: ignore[arg-type]
    ):
        with pytest.raises(bl.ConfigError, match="a whole number"):
            wrong()
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=1e-4)
    assert run.replace({"chain.beads": np.int64(7)}).replace({"time.dt_s": np.float64(1e-6)}).dt_s == 1e-6


def in_a_fork(work: Callable[[], bool]) -> bool:
    """Whether ``work`` is true in a process that is forked from this one."""
    child = os.fork()
    if child == 0:
        code = 1
        signal.alarm(60)
        try:
            code = 0 if work() else 1
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1] == 0


def test_a_forked_process_reads_a_recording_at_places_of_its_own(tmp_path: Path) -> None:
    chain = bl.Chain(200, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=3e-3)
    rec = run.record(tmp_path / "full.mcap")
    whole = np.asarray(rec.velocity)

    def is_right() -> bool:
        return all(np.array_equal(block, whole[rows]) for rows, block in rec.velocity.blocks(1_000_000))

    assert all(in_a_fork(is_right) and is_right() for _ in range(3))


def test_a_file_that_became_another_run_is_not_taken_for_this_one(tmp_path: Path) -> None:
    chain = bl.Chain(BEADS, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    path = tmp_path / "run.mcap"
    rec = bl.Run(chain, strikers={0: 5.0}, duration_s=1e-4).record(path)
    bl.Run(chain, strikers={0: 3.0}, duration_s=1e-4).record(path, force=True)
    uses: list[Callable[[], object]] = [
        lambda: rec.velocity[0, 0],
        rec.energies,
        rec.verify,
        lambda: rec.export(tmp_path / "run.npz"),
        lambda: rec.share(tmp_path / "run.html"),
        lambda: rec.thin(tmp_path / "thin.mcap", 10),
        lambda: rec.recover(tmp_path / "back.mcap"),
        lambda: pickle.loads(pickle.dumps(rec)),
    ]
    for use in uses:
        with pytest.raises(bl.RecordingError, match=r"run\.mcap is of another run now: open it again"):
            use()
    assert list(tmp_path.iterdir()) == [path]
    assert rec.refresh().velocity[0, 0] == 3.0


def test_a_forked_process_does_not_detach_the_one_it_is_of(tmp_path: Path) -> None:
    chain = bl.Chain(BEADS, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=1e-3, name="forked")
    producer = Thread(target=run.record, args=(tmp_path / "run.mcap",), kwargs={"publish": True, "wait_for": 1})
    producer.start()
    live = bl.attach("forked")
    held = [next(live)]

    def is_closed() -> bool:
        held.clear()
        live.close()
        return live.end == "stopped"

    assert in_a_fork(is_closed)
    steps = [held.pop().step]
    steps += [frame.step for frame in live]
    assert steps == list(range(run.steps + 1))
    assert live.end == "complete"
    producer.join()
