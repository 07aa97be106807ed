"""Recordings: every step of them, whole or damaged, as arrays."""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import beadline as bl

BEADS, STEPS, DT_S = 40, 413, 1.45e-6


@pytest.fixture(scope="module")
def run() -> bl.Run:
    chain = bl.Chain(BEADS, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={20: 0.6e-3})
    return bl.Run(chain, strikers={0: 5.0}, duration_s=STEPS * DT_S, dt_s=DT_S)


@pytest.fixture(scope="module")
def full(run: bl.Run, tmp_path_factory: pytest.TempPathFactory) -> bl.Recording:
    return run.record(tmp_path_factory.mktemp("full") / "full.mcap")


@pytest.fixture(scope="module")
def sparse(run: bl.Run, tmp_path_factory: pytest.TempPathFactory) -> bl.Recording:
    return run.record(tmp_path_factory.mktemp("sparse") / "sparse.mcap", every=37)


@pytest.fixture(scope="module")
def velocities(full: bl.Recording) -> Any:
    """Every velocity, read state by state."""
    return np.array([state.velocity_m_s for state in full])


def test_a_recording_says_what_it_is(sparse: bl.Recording) -> None:
    assert (sparse.first_step, sparse.last_step, len(sparse)) == (0, STEPS, STEPS + 1)
    assert sparse.recorded_steps.tolist() == [*range(0, STEPS, 37), STEPS]
    assert sparse.about["is_complete"] and sparse.about["states"] == len(sparse.recorded_steps)
    assert sparse.time_s[-1] == STEPS * sparse.dt_s == sparse[-1].time_s
    assert sparse.mass_kg[[19, 20]].tolist() == [1e-3, 0.6e-3]
    assert sparse.manifest["physics"]["alpha"] == 1.5 and "alpha = 1.5" in str(sparse.toml)


def test_every_step_of_a_sparse_recording_has_the_bits_of_the_full_one(
    full: bl.Recording, sparse: bl.Recording
) -> None:
    for step in (0, 1, 36, 37, 38, 200, STEPS - 1, STEPS):
        one, other = full[step], sparse[step]
        assert (one.frame, one.step, one.time_s) == (other.frame, other.step, other.time_s)
        for name in ("displacement_m", "velocity_m_s", "overlap_m", "force_n"):
            assert np.array_equal(getattr(one, name), getattr(other, name))
    for name in ("displacement", "velocity", "overlap", "force"):
        assert np.array_equal(getattr(full, name), getattr(sparse, name))


def test_what_a_recording_has_cannot_be_changed_by_mistake(full: bl.Recording) -> None:
    for array in (full.mass_kg, full.stiffness, full.rest_force_n, full.recorded_steps, full[3].velocity_m_s):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_a_lazy_array_says_where_its_other_methods_are(full: bl.Recording) -> None:
    with pytest.raises(AttributeError, match=r"a lazy array has no var: take np\.asarray\(…\)\.var"):
        full.velocity.var()
    assert not hasattr(full.velocity, "nothing")


def test_a_step_is_a_whole_number(full: bl.Recording) -> None:
    with pytest.raises(TypeError):
        full[1.5]  # type: ignore[index]
    assert full[np.uint64(3)].step == 3


def test_overlaps_and_forces_are_those_of_the_contact_law(full: bl.Recording) -> None:
    state = full[100]
    overlap = state.displacement_m[:-1] - state.displacement_m[1:]
    assert np.array_equal(state.overlap_m, overlap)
    force = 1e7 * np.where(overlap > 0, overlap, 0) ** 1.5
    # the law is 0 for the smallest overlaps, whose powers doubles hardly hold
    np.testing.assert_allclose(state.force_n, force, rtol=1e-12, atol=1e-100)
    assert np.array_equal(full.force[100], state.force_n)


def test_damped_contacts_have_their_damping_force() -> None:
    chain = bl.Chain(10, mass_kg=1e-3, alpha=1.5, stiffness=1e7, viscous_n_s_per_m=2.0)
    state = bl.Run(chain, strikers={0: 5.0}, duration_s=2e-4).simulate()[-1]
    closed = state.overlap_m > 0
    elastic = 1e7 * np.where(closed, state.overlap_m, 0) ** 1.5
    rate = state.velocity_m_s[:-1] - state.velocity_m_s[1:]
    expected = np.where(closed, np.maximum(elastic + 2.0 * rate, 0), 0)
    np.testing.assert_allclose(state.force_n, expected, rtol=1e-12)


def test_a_recording_has_a_state_with_all_that_belongs_to_it() -> None:
    chain = bl.Chain(6, mass_kg=1e-3, alpha=1.5, stiffness=1e7, resonators={"mass_kg": 5e-4, "stiffness_n_per_m": 1e5})
    rest = bl.Run(chain, strikers={0: 1.0}, duration_s=1e-4).simulate()
    moved = bl.Run(chain, strikers={0: 1.0}, initial={"resonator_displacements_m": [1e-6] * 6}, duration_s=1e-4).simulate()
    assert moved[0].velocity_m_s.tobytes() == rest[0].velocity_m_s.tobytes()
    assert rest[0] in rest and moved[0] in moved and moved[0] not in rest


def test_a_chain_has_the_exponents_of_its_contacts() -> None:
    law: dict[str, Any] = {"mass_kg": 1e-3, "alpha": 1.5, "stiffness": 1e7}
    alphas: list[tuple[dict[str, Any], str, float]] = [
        (law, ", α = 1.5", 1.5),
        ({**law, "alphas": 2}, ", α = 2", 2.0),
        ({**law, "alphas": [2.0, 2.0]}, ", α = 2", 2.0),
        ({**law, "alphas": {"pattern": [1.5, 2.0]}}, ", several exponents", np.nan),
        ({"mass_kg": 1e-3, "bonds": {"linear": 1e4}}, "", np.nan),
    ]
    for said, words, alpha in alphas:
        chain = bl.Chain(3, **said)
        run = bl.Run(chain, strikers={0: 1.0}, duration_s=1e-4)
        rec = run.simulate()
        assert repr(chain) == f"<Chain of 3 beads{words}>"
        assert all(f">3 beads{words}<" in shown._repr_html_() for shown in (run, rec))
        assert np.array_equal(rec.alpha, alpha, equal_nan=True)
    assert repr(bl.Chain(3, spheres={"material": "steel", "radius_m": 1e-3})) == "<Chain of 3 beads>"


def test_a_state_is_found_by_its_time(sparse: bl.Recording) -> None:
    assert sparse.at(time_s=100.4 * sparse.dt_s).step == 100
    with pytest.raises(ValueError, match="time_s: found 1; the recording has 0 s to"):
        sparse.at(time_s=1.0)


def test_a_step_that_is_not_there_is_refused(sparse: bl.Recording) -> None:
    assert sparse[-1].step == STEPS
    for step in (STEPS + 1, -STEPS - 2):
        with pytest.raises(IndexError, match=f"the recording has steps 0 to {STEPS}"):
            sparse[step]
    wrong: Any = slice(1, 2)
    with pytest.raises(TypeError, match="rec.velocity"):
        sparse[wrong]


axis = st.one_of(
    st.integers(-BEADS, BEADS - 1),
    st.slices(BEADS),
    st.lists(st.integers(-BEADS, BEADS - 1), max_size=6),
)
key = st.one_of(
    axis,
    st.tuples(axis, axis),
    st.tuples(st.just(Ellipsis), axis),
    st.tuples(axis, st.just(Ellipsis)),
    st.tuples(axis, st.none(), axis),
    st.tuples(st.none(), axis),
    st.tuples(st.lists(st.booleans(), min_size=STEPS + 1, max_size=STEPS + 1), axis),
    st.tuples(axis, st.lists(st.booleans(), min_size=BEADS, max_size=BEADS)),
    st.tuples(st.lists(st.lists(st.integers(0, 9), min_size=2, max_size=2), max_size=3), axis),
    st.just(()),
)


@settings(
    max_examples=300,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(first=key, second=st.none() | axis)
def test_parts_of_a_lazy_array_are_numpys_parts(
    sparse: bl.Recording, velocities: Any, first: Any, second: Any
) -> None:
    """What is asked of a lazy array, or of a part of one, is what NumPy makes of the whole."""

    def outcome(array: Any) -> Any:
        try:
            part = array[first]
            return np.asarray(part if second is None else part[second])
        except IndexError:
            return None

    expected, found = outcome(velocities), outcome(sparse.velocity)
    assert (expected is None) == (found is None)
    if expected is not None:
        assert expected.shape == found.shape and np.array_equal(expected, found)


def test_a_lazy_array_takes_part_in_numpy(sparse: bl.Recording, velocities: Any) -> None:
    v = sparse.velocity[::10, 5:15]
    part = velocities[::10, 5:15]
    assert (v.shape, v.ndim, v.size, v.dtype) == (part.shape, 2, part.size, part.dtype)
    assert "computed when it is needed" in repr(v)
    assert np.array_equal(v * 2 + v, part * 3) and np.array_equal(np.abs(v), np.abs(part))
    assert np.array_equal(np.concatenate([v, v]), np.concatenate([part, part]))
    assert v.max() == part.max() and np.array_equal(np.mean(v, axis=0), part.mean(axis=0))
    assert np.asarray(v, dtype=np.float32).dtype == np.float32
    assert isinstance(sparse.velocity[3, 4], float)
    assert sum(len(rows) for _, rows in sparse.velocity.blocks(10_000)) == len(velocities)
    mask = velocities > 1.0
    assert np.array_equal(sparse.velocity[mask], velocities[mask])


TOO_LARGE = """
import resource
import beadline as bl
resource.setrlimit(resource.RLIMIT_AS, (3_000_000_000, -1))
chain = bl.Chain(1_000_000, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
rec = bl.Run(chain, strikers={0: 5.0}, duration_s=500e-6, dt_s=1e-6).simulate(every=500)
try:
    rec.velocity[:].compute()
except MemoryError as error:
    print(error)
"""


def test_what_does_not_fit_into_memory_says_how_large_it_would_be() -> None:
    done = subprocess.run([sys.executable, "-c", TOO_LARGE], capture_output=True, text=True)
    assert "velocity of 501 × 1,000,000 values takes 4.0 GB" in done.stdout, done


def test_a_run_in_memory_is_saved_with_the_same_bits(run: bl.Run, tmp_path: Path) -> None:
    kept = run.simulate(every=50)
    saved = kept.save(tmp_path / "saved.mcap")
    assert kept.path is None and saved.path == str(tmp_path / "saved.mcap")
    assert np.array_equal(saved.recorded_steps, kept.recorded_steps)
    assert np.array_equal(saved.velocity, kept.velocity)
    with pytest.raises(FileExistsError):
        kept.save(tmp_path / "saved.mcap")


def most(rec: bl.Recording) -> float:
    """For other processes."""
    return float(rec.velocity[::7].max())


def test_recordings_states_and_errors_go_to_other_processes(
    run: bl.Run, sparse: bl.Recording
) -> None:
    kept = run.simulate(every=50)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert list(pool.map(most, [sparse, kept])) == [most(sparse), most(kept)]
    state = pickle.loads(pickle.dumps(sparse[100]))
    assert np.array_equal(state.force_n, sparse[100].force_n) and state.step == 100
    error = pickle.loads(pickle.dumps(bl.RecordingError("damaged", byte=7, remedy="again")))
    assert (str(error), error.byte, error.remedy) == ("damaged", 7, "again")


def test_a_file_cut_short_has_what_is_there(tmp_path: Path) -> None:
    chain = bl.Chain(1000, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=400 * DT_S, dt_s=DT_S)
    whole = Path(str(run.record(tmp_path / "whole.mcap").path)).read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: len(whole) * 3 // 4])
    cut = bl.open(path)
    assert not cut.about["is_finished"] and 0 < cut.last_step < 400
    expected = run.simulate()[cut.last_step].velocity_m_s
    assert np.array_equal(cut[-1].velocity_m_s, expected)
    assert np.array_equal(cut.velocity[-1], expected)


def test_a_damaged_file_is_an_error_of_ours_or_has_the_right_bits(
    run: bl.Run, velocities: Any, tmp_path: Path
) -> None:
    path = tmp_path / "whole.mcap"
    run.record(path, every=37)
    whole = path.read_bytes()
    changed = tmp_path / "changed.mcap"
    refused = 0
    for at in range(8, len(whole), max(1, len(whole) // 150)):
        damaged = bytearray(whole)
        damaged[at] ^= 0x55
        changed.write_bytes(damaged)
        try:
            rec = bl.open(changed)
            found = np.asarray(rec.velocity[:: STEPS // 3])
            assert np.array_equal(found, velocities[: rec.last_step + 1 : STEPS // 3]), at
        except bl.RecordingError as error:
            refused += 1
            assert error.path in (None, str(changed)), error
    assert refused > 30


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        bl.open(tmp_path / "none.mcap")
    with pytest.raises(TypeError, match="path: found b'none.mcap'; expected a text"):
        bl.open(b"none.mcap")  # type: ignore[arg-type]
    path = tmp_path / "text.mcap"
    path.write_text("no recording" * 100)
    with pytest.raises(bl.RecordingError, match="is not an MCAP file"):
        bl.open(path)


def test_a_changed_state_is_named(run: bl.Run) -> None:
    kept = run.simulate(every=100)
    make, (manifest, steps, doubles, end) = kept.__reduce__()
    doubles[2, BEADS + 7] = np.nextafter(doubles[2, BEADS + 7], 1.0)
    lies = make(manifest, steps, doubles, end)
    assert np.array_equal(lies[99].velocity_m_s, kept[99].velocity_m_s)
    with pytest.raises(bl.RecordingError, match="velocity of bead 7 at step 200") as found:
        lies[150]
    assert (found.value.step, found.value.bead) == (200, 7)


def test_a_recording_of_another_kernel_has_its_kept_states() -> None:
    golden = Path(__file__).parents[2] / "tests/golden/1.0-kernel-1"
    sparse = [rec for rec in map(bl.open, sorted(golden.glob("[!c]*.mcap"))) if rec.record_every > 1]
    rec = sparse[0]
    assert not rec.recomputes and len(rec.steps) == len(rec.recorded_steps)
    assert np.array_equal(rec.velocity[::2][-1], rec[int(rec.steps[::2][-1])].velocity_m_s)
    assert rec.at(time_s=rec.last_step * rec.dt_s).step == rec.last_step
    with pytest.raises(bl.RecordingError, match="kernel version 1"):
        rec[1]


def test_a_file_is_read_while_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "growing.mcap"
    chain = bl.Chain(1000, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    seen: list[tuple[int, bool]] = []

    def look(_: bl.State) -> bool:
        try:
            rec = bl.open(path)
        except (bl.RecordingError, FileNotFoundError):
            return False
        seen.append((rec.last_step, np.array_equal(rec[-1].velocity_m_s, rec.velocity[-1])))
        return len(seen) == 3

    run = bl.Run(chain, strikers={0: 5.0}, duration_s=0.05)
    rec = run.record(path, on_frame=look, on_frame_every=200)
    assert len(seen) == 3 and all(same for _, same in seen)
    assert rec.refresh().last_step == rec.last_step >= seen[-1][0]


def test_a_run_that_is_recorded_anew_is_not_taken_for_the_one_before(run: bl.Run, tmp_path: Path) -> None:
    path, partial = tmp_path / "run.mcap", tmp_path / "run.mcap.partial"
    chain = bl.Chain(1000, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    again = bl.Run(chain, strikers={0: 5.0}, duration_s=0.05, name="again")
    run.record(path)
    seen: list[bl.Recording] = []

    def look(state: bl.State) -> bool:
        with suppress(bl.RecordingError, FileNotFoundError):
            seen.append(bl.open(partial).refresh())
            assert len(seen[-1].energies(until_s=0.0)) == 1
        return len(seen) == 3

    again.record(path, force=True, on_frame=look, on_frame_every=200)
    growing = seen[0]
    assert [(rec.name, rec.path) for rec in seen] == 3 * [("again", str(partial))]
    now = growing.refresh()
    assert (now.name, now.path) == ("again", str(path)) and now.last_step >= seen[-1].last_step
    run.record(path, force=True)
    with pytest.raises(bl.RecordingError, match=r"run\.mcap is of another run now: open it again"):
        growing.refresh()


# the command tells of what a late one does not have
@pytest.mark.filterwarnings("ignore:1 frame")
def test_every_takes_the_multiples_that_the_command_takes(run: bl.Run, tmp_path: Path) -> None:
    make, (manifest, steps, doubles, end) = run.simulate(every=50).__reduce__()
    # as one that was attached to later
    late: bl.Recording = make(manifest, steps[1:], doubles[1:], end)
    late.export(tmp_path / "late.npz", every=120)
    with np.load(tmp_path / "late.npz") as exported:
        assert exported["step"].tolist() == [120, 240, 360]
    assert [state.step for state in late.states(120)] == late.sel(every=120, bead=0)["step"].tolist() == [120, 240, 360]
    # of single times the nearest that is there
    ends_s = [step * late.dt_s for step in (50, 61, 179, STEPS)]
    assert late.sel(time_s=ends_s, every=120, bead=0)["step"].tolist() == [120, 120, 120, 360]
    assert late.sel(time_s=STEPS * late.dt_s, every=250, bead=0)["step"].tolist() == [250]
    with pytest.raises(ValueError, match="every: found 1000; allowed: numbers with a multiple from step 50 to 413"):
        next(late.states(1000))


def test_threads_share_a_recording(sparse: bl.Recording, velocities: Any) -> None:
    wrong: list[int] = []

    def read(first: int) -> None:
        for step in range(first, STEPS, 4):
            if not np.array_equal(sparse[step].velocity_m_s, velocities[step]):
                wrong.append(step)

    threads = [threading.Thread(target=read, args=(first,)) for first in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


COMPUTING = """
import beadline as bl, sys
chain = bl.Chain(100_000, mass_kg=1e-3, alpha=1.0, stiffness=1e7)
rec = bl.Run(chain, strikers={50_000: 5.0}, duration_s=60_000e-7, dt_s=1e-7).simulate(every=60_000)
try:
    print("computing", flush=True)
    while True:
        rec.velocity[:, 0].compute() if sys.argv[1] == "all" else rec[59_000]
except KeyboardInterrupt:
    print("ended", flush=True)
"""


@pytest.mark.parametrize("what", ["all", "one"])
def test_ctrl_c_ends_a_computation(what: str) -> None:
    command = [sys.executable, "-c", COMPUTING, what]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "computing\n"
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert (out, process.returncode) == ("ended\n", 0)
