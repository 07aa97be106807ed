"""What a recording is made into: other files, a page, the run again; and its end."""

from __future__ import annotations

import gc
import os
import pickle
import subprocess
import sys
import urllib.request
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest

import beadline as bl

CHAIN = bl.Chain(beads=30, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={15: 0.6e-3})
RUN = bl.Run(CHAIN, strikers={0: 5.0}, duration_s=1e-3, name="filed")


@pytest.fixture
def rec(tmp_path: Path) -> bl.Recording:
    return RUN.record(tmp_path / "filed.mcap", every=10)


def open_files() -> set[str]:
    found = set()
    for number in os.listdir("/proc/self/fd"):
        try:
            found.add(os.readlink(f"/proc/self/fd/{number}"))
        except FileNotFoundError:
            pass
    return found


def test_a_closed_recording_lets_go_of_its_file(rec: bl.Recording) -> None:
    path = str(rec.path)
    with bl.open(path) as opened:
        last, velocity = opened[-1], opened.velocity
        assert path in open_files()
    gc.collect()
    assert path not in open_files()
    assert last.velocity_m_s.size == 30 and opened.mass_kg[15] == 0.6e-3
    for use in (lambda: opened[0], lambda: np.asarray(velocity), lambda: opened.energies()):
        with pytest.raises(ValueError, match=r"the recording of filed is closed: bl\.open\(.*\) opens it again"):
            use()
    opened.close()


def test_a_recording_becomes_other_files(rec: bl.Recording, tmp_path: Path) -> None:
    told = rec.export(tmp_path / "part.npz", beads=slice(5, 10), from_s=1e-4, until_s=5e-4)
    part = np.load(tmp_path / "part.npz")
    assert told["states"] == len(part["step"])
    assert np.array_equal(part["velocity_m_s"], np.asarray(rec.velocity)[part["step"].astype(int), 5:10])
    with pytest.raises(FileExistsError, match="part.npz exists already; .* force=True"):
        rec.export(tmp_path / "part.npz")
    with pytest.raises(bl.CommandValueError, match="^to: found exe; expected npz, csv"):
        rec.export(tmp_path / "part.exe", to="exe")
    with pytest.raises(bl.CommandValueError, match="^every: found it beside every_step=True; expected one of them$"):
        rec.export(tmp_path / "part.csv", every=3, every_step=True)
    with pytest.raises(ValueError, match="^clouds: found 3 for a format without point clouds"):
        rec.export(tmp_path / "part.csv", clouds=3)
    thin = rec.thin(tmp_path / "thin.mcap", 100)
    assert thin.record_every == 100 and np.array_equal(thin.velocity[::7], rec.velocity[::7])
    with pytest.raises(FileExistsError):
        RUN.simulate().thin(tmp_path / "thin.mcap", 100)
    assert len(RUN.simulate().export(tmp_path / "all.csv", every=200)["paths"]) >= 1


def test_the_relay_that_is_not_in_a_wheel_says_how_to_get_it() -> None:
    relay = [sys.executable, "-m", "beadline", "relay", "--from", "live"]
    said = subprocess.run(relay, capture_output=True, text=True)
    assert said.returncode == 2
    assert "Python package" in said.stderr and "--features relay beadline`" in said.stderr


def test_a_cut_recording_is_recovered(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    long = RUN.replace({"chain.beads": 300, "time.duration_s": 3e-3}).record(path, every=1)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    back = bl.open(path).recover(tmp_path / "back.mcap")
    assert back.about["is_finished"] and 0 < back.last_step < long.last_step
    assert back.summary is not None and back.summary["path"] == str(tmp_path / "back.mcap")


def test_a_check_says_how_the_errors_grow(rec: bl.Recording) -> None:
    errors = rec.check()
    assert errors.summary["determined"] and "velocity_step" in errors and errors["time_s"][-1] == pytest.approx(1e-3)
    with pytest.raises(bl.CommandValueError, match="^tolerance: found -1"):
        rec.check(tolerance=-1)


def test_a_page_is_served_until_it_is_closed(rec: bl.Recording) -> None:
    with rec.view(open=False) as page:
        assert page.url.startswith("http://127.0.0.1:") and page.url in page._repr_html_()
        with urllib.request.urlopen(page.url) as answer:
            assert b"<html" in answer.read()
    with pytest.raises(OSError):
        urllib.request.urlopen(page.url)


def test_a_recording_is_run_again_and_otherwise(rec: bl.Recording, tmp_path: Path) -> None:
    again = bl.Run.from_recording(rec)
    assert (again.name, again.steps) == ("filed", RUN.steps)
    assert again.simulate()[-1] in rec and again.replace({"chain.alpha": 2.0}).simulate()[-1] not in rec
    # a file that the text names is gone
    folder = tmp_path / "gone"
    folder.mkdir()
    (folder / "push.csv").write_text("0,0\n1e-3,1\n")
    (folder / "push.toml").write_text(
        RUN.to_toml() + '[[drive]]\nbead = 3\nforce_n = { csv = "push.csv" }\n'
    )
    pushed = bl.Run.from_toml(folder / "push.toml").record(folder / "push.mcap")
    (folder / "push.csv").unlink()
    assert bl.Run.from_recording(bl.open(folder / "push.mcap")).simulate()[-1] in pushed


def test_a_recording_says_how_long_and_of_what(rec: bl.Recording) -> None:
    assert rec.alpha == 1.5 and rec.duration_s == rec.last_step * rec.dt_s == rec[-1].time_s


def test_a_state_has_the_energies_of_the_table() -> None:
    chain = bl.Chain(
        12,
        mass_kg=1e-3,
        alpha=1.5,
        stiffness=1e7,
        left="fixed",
        right="fixed",
        precompression_n=3.0,
        resonators={"mass_kg": 1e-4, "stiffness_n_per_m": 1e4},
        on_site={"linear_n_per_m": 10.0},
    )
    rec = bl.Run(chain, strikers={3: 0.5}, duration_s=3e-4).simulate(every=1)
    energies = rec.energies()
    for row in (0, 57, len(energies) - 1):
        state = rec[int(energies["step"][row])]
        assert state.kinetic_j == pytest.approx(energies["kinetic_j"][row], rel=1e-12)
        assert state.total_j == pytest.approx(energies["total_j"][row], rel=1e-12)
    # the striker: m·v²/2
    assert RUN.simulate()[0].total_j == 0.5 * 1e-3 * 5.0**2


def test_membership_and_conversion_compute_no_run(rec: bl.Recording) -> None:
    state = rec[123]
    assert state in rec
    other = bl.Run(CHAIN, strikers={0: 3.0}, duration_s=1e-3).simulate()
    assert other[123] not in rec and other[0] not in rec
    with pytest.raises(TypeError, match="expected a State, or a value in an array"):
        5.0 in rec  # noqa: B015
    with pytest.raises(TypeError, match=r"many arrays: take one, such as np.asarray\(rec.velocity"):
        np.asarray(rec)


def test_lazy_arrays_have_the_usual_methods(rec: bl.Recording) -> None:
    whole, v = np.asarray(rec.velocity), rec.velocity
    assert v.std() == whole.std() and np.array_equal(v.std(axis=0, ddof=1), whole.std(axis=0, ddof=1))
    for name in ("max", "min", "mean", "sum", "std", "argmax"):
        kept = getattr(v, name)(axis=1, keepdims=True)
        assert kept.shape == (len(v), 1) and np.array_equal(kept, getattr(whole, name)(axis=1, keepdims=True))
    assert v.astype(np.float32).dtype == np.float32


def test_arrays_begin_where_others_take_them_without_a_copy(rec: bl.Recording) -> None:
    sim = RUN.start().step(10)
    states = [rec[step] for step in range(1, 40)] + [sim.state(), sim]
    arrays = [array for state in states for array in (state.displacement_m, state.velocity_m_s)]
    arrays += [np.asarray(rec.velocity[at:, ::3]) for at in range(20)]
    assert all(array.ctypes.data % 64 == 0 for array in arrays)
    assert all(array.flags.c_contiguous for array in arrays)


@bl.consumer(columns=["speed_m_s"])
def fastest(frame: Any) -> float:
    return float(np.abs(frame.velocity_m_s).max())


def speed_of(state: bl.State) -> tuple[str, float]:
    return type(state).__name__, float(np.abs(state.velocity_m_s).max())


def test_a_process_pool_takes_everything(rec: bl.Recording) -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        states = [rec[5], rec[6]]
        assert list(pool.map(fastest, states)) == [fastest(state) for state in states]
        assert list(pool.map(speed_of, states)) == [speed_of(state) for state in states]
        assert pool.submit(np.asarray, rec.velocity[::50]).result().tolist() == np.asarray(rec.velocity[::50]).tolist()
    again = pickle.loads(pickle.dumps(states[0]))
    assert again in rec and not again.velocity_m_s.flags.writeable and again.total_j == states[0].total_j
    run = pickle.loads(pickle.dumps(RUN))
    assert run.to_toml() == RUN.to_toml() and pickle.loads(pickle.dumps(CHAIN)).beads == 30


def test_a_live_frame_becomes_a_state_in_another_process(tmp_path: Path) -> None:
    run = bl.Run(CHAIN, strikers={0: 5.0}, duration_s=1e-4, name="sent")
    producer = Thread(target=run.record, args=(tmp_path / "run.mcap",), kwargs={"publish": True, "wait_for": 1})
    producer.start()
    with bl.attach("sent", timeout_s=60) as live:
        sent = [(pickle.dumps(frame), frame.step) for frame in live]
    producer.join()
    rec = bl.open(tmp_path / "run.mcap")
    for text, step in sent:
        state = pickle.loads(text)
        assert state.step == step and state in rec
