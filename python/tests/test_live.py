"""Live runs, with producers in processes of their own."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import beadline as bl
from beadline import _native

COMMAND = [sys.executable, "-m", "beadline"]
CHAIN = ["--beads", "50", "--impurity", "25=5e-4", "--dt", "1e-7"]
# 2001 frames
SHORT = [*CHAIN, "--duration", "2e-4"]
# goes on until somebody ends it
LONG = [*CHAIN, "--duration", "100", "--yes"]


@pytest.fixture(autouse=True)
def root(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    path = Path(tempfile.mkdtemp(prefix="bl", dir="/tmp"))
    monkeypatch.setenv("BEADLINE_ROOT", str(path / "bus"))
    yield path
    shutil.rmtree(path)


class Processes:
    def __init__(self, folder: Path) -> None:
        self.folder, self.all = folder, list[subprocess.Popen[str]]()

    def start(self, *command: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.all.append(process)
        return process

    def run(self, *arguments: str, wait_for: int = 1) -> subprocess.Popen[str]:
        """Starts a run, recorded as light.mcap unless it says otherwise."""
        run = ["run", "--name", "light", "--wait-for", str(wait_for)]
        return self.start(*COMMAND, *run, *arguments)

    def python(self, program: str) -> subprocess.Popen[str]:
        return self.start(sys.executable, "-c", program)


@pytest.fixture
def processes(root: Path) -> Iterator[Processes]:
    them = Processes(root)
    yield them
    for process in them.all:
        process.kill()
        process.communicate()


def states_of(path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    states = _native.States.open(path)
    return [states.state(step)[3:5] for step in range(states.last_step + 1)]


def test_a_loop_sees_every_frame_as_it_is_recorded(processes: Processes, root: Path) -> None:
    run = processes.run(*SHORT, "--out", "light.mcap")
    with bl.attach("light", timeout_s=20) as live:
        assert (live.name, live.first_frame, live.end) == ("light", 0, None)
        assert live.manifest["physics"]["beads"] == live.mass_kg.size == 50
        frames = [frame.copy() for frame in live]
        assert (live.end, live.missed, live.behind) == ("complete", 0, 0)
        assert next(live, None) is None
    assert run.wait() == 0
    expected = states_of(root / "light.mcap")
    assert [frame.frame for frame in frames] == list(range(len(expected)))
    for frame, (u_m, v_m_s) in zip(frames, expected, strict=True):
        assert frame.displacement_m.tobytes() == u_m.tobytes()
        assert frame.velocity_m_s.tobytes() == v_m_s.tobytes()


def test_frames_are_views_that_cannot_be_written_to(processes: Processes) -> None:
    processes.run(*LONG, "--no-record")
    with bl.attach(timeout_s=20) as live:
        frame = next(live)
        u_m, v_m_s = frame.displacement_m, frame.velocity_m_s
        for values in (u_m, v_m_s, frame.extra, frame.mass_kg, frame.overlap_m):
            with pytest.raises(ValueError, match="read-only"):
                values[...] = 0
        with pytest.raises(ValueError, match="WRITEABLE"):
            frame.velocity_m_s.flags.writeable = True
        assert frame.wall_force_n.tolist() == [0.0, 0.0] and not hasattr(frame, "wall")
        assert frame.total_j == frame.kinetic_j + frame.potential_j > 0.0
        first, again = frame.velocity_m_s, frame.velocity_m_s
        assert first.ctypes.data == again.ctypes.data
        np.testing.assert_array_equal(frame.overlap_m, u_m[:-1] - u_m[1:] + live.rest_overlap_m)
        assert frame.force_n.shape == (49,)


def test_arrays_stay_as_they_are_when_the_run_goes_on_without_us(processes: Processes) -> None:
    processes.run(*LONG, "--no-record", wait_for=0)
    live = bl.attach(timeout_s=20)
    kept = [next(live), next(live)]
    views = [(frame.displacement_m, frame.velocity_m_s[10:]) for frame in kept]
    copies = [(u_m.copy(), v_m_s.copy()) for u_m, v_m_s in views]
    live.close()
    assert live.end == "stopped"
    # the memory of every frame is used again and again meanwhile
    with bl.attach(timeout_s=20) as other:
        for _ in range(2000):
            next(other)
    for frame, view, copy in zip(kept, views, copies, strict=True):
        np.testing.assert_array_equal(view[0], copy[0])
        np.testing.assert_array_equal(view[1], copy[1])
        np.testing.assert_array_equal(frame.velocity_m_s[10:], copy[1])
    del kept, live
    np.testing.assert_array_equal(views[0][0], copies[0][0])


def test_arrays_outlive_the_run(processes: Processes, root: Path) -> None:
    run = processes.run(*SHORT, "--out", "light.mcap")
    with bl.attach(timeout_s=20) as live:
        for frame in live:
            last = frame.velocity_m_s
    assert run.wait() == 0
    assert last.tobytes() == states_of(root / "light.mcap")[-1][1].tobytes()


def test_who_keeps_too_many_frames_is_told_before_one_is_lost(processes: Processes) -> None:
    processes.run(*SHORT, "--no-record")
    with bl.attach(timeout_s=20) as live:
        kept = [next(live), next(live)]
        with pytest.raises(bl.LiveError, match=r"frame\.copy\(\)"):
            next(live)
        kept.clear()
        assert next(live).frame == 2
        assert sum(1 for _ in live) == 1998
        assert live.missed == 0


def test_a_late_consumer_begins_with_its_first_frame(processes: Processes) -> None:
    processes.run(*LONG, "--no-record", wait_for=0)
    with bl.attach(timeout_s=20) as first:
        came = next(first).frame
    with bl.attach(timeout_s=20) as later:
        assert next(later).frame == later.first_frame > came


def test_latest_never_waits_and_counts_what_it_misses(processes: Processes) -> None:
    processes.run(*LONG, "--no-record", wait_for=0)
    with bl.attach(latest=True, timeout_s=20) as live, bl.attach() as lossless:
        first = next(live).frame
        for _ in range(500):
            next(lossless)
        seen = missed = 0
        for frame in live:
            seen += 1
            missed += frame.missed
            if missed:
                break
        assert live.missed == missed > 0
        assert frame.frame == first + seen + missed


@pytest.mark.parametrize(
    ("sent", "end"), [(signal.SIGINT, "interrupted"), (signal.SIGKILL, "producer lost")]
)
def test_a_run_that_ends_early_says_how(
    processes: Processes, sent: signal.Signals, end: str
) -> None:
    run = processes.run(*LONG, "--no-record")
    with bl.attach(timeout_s=20) as live:
        next(live)
        run.send_signal(sent)
        if end == "interrupted":
            assert sum(1 for _ in live) >= 0
        else:
            with pytest.raises(bl.LostError, match="producer lost") as lost:
                sum(1 for _ in live)
            assert lost.value.frame is not None
            with pytest.raises(bl.LostError):
                next(live)
        assert live.end == end


def test_no_run_and_several_runs_are_errors(processes: Processes) -> None:
    with pytest.raises(bl.LiveError, match="beadline run"):
        bl.attach("none", timeout_s=0.1)
    for name in ("one", "two"):
        processes.start(*COMMAND, "run", *LONG, "--no-record", "--name", name)
        bl.attach(name, timeout_s=20).close()
    with pytest.raises(bl.LiveError, match="one, two"):
        bl.attach(timeout_s=1)


def test_live_runs_and_their_consumers_are_listed(processes: Processes) -> None:
    assert bl.live_runs() == []
    run = processes.run(*LONG, "--no-record")
    with bl.attach(timeout_s=20, label="mine") as live:
        next(live)
        (found,) = bl.live_runs()
        assert (found.name, found.state, found.pid) == ("light", "running", run.pid)
        (me,) = found.consumers
        assert (me.label, me.delivery, me.pid) == ("mine", "lossless", os.getpid())


@pytest.mark.parametrize("attached", [True, False])
def test_ctrl_c_ends_a_wait(processes: Processes, attached: bool) -> None:
    if attached:
        processes.run(*LONG, "--no-record", "--pace", "1e-9")
    loop = "for frame in live: print(frame.frame, flush=True)"
    waiting = f"""
import beadline as bl, time
try:
    print("here", flush=True)
    live = bl.attach("light")
    {loop}
except KeyboardInterrupt:
    print("ended", time.monotonic())
"""
    program = processes.python(waiting)
    assert program.stdout is not None
    program.stdout.readline()
    if attached:
        program.stdout.readline()
    began_s = time.monotonic()
    program.send_signal(signal.SIGINT)
    out, err = program.communicate()
    ended = [line for line in out.splitlines() if line.startswith("ended")]
    assert ended, err
    assert float(ended[0].split()[1]) - began_s < 2


def test_other_tasks_go_on_and_a_cancelled_one_detaches(processes: Processes) -> None:
    processes.run(*LONG, "--no-record", "--pace", "1e-6")

    async def main() -> tuple[int, int]:
        frames = turns = 0
        listening = bl.attach_async("light", timeout_s=20)

        async def listen() -> None:
            nonlocal frames
            async for frame in listening:
                assert frame.velocity_m_s.shape == (50,)
                frames += 1

        task = asyncio.create_task(listen())
        while frames < 5 and not task.done():
            await asyncio.sleep(0.001)
            turns += 1
        assert len(bl.live_runs()[0].consumers) == 1
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert listening.live is not None and listening.live.end == "stopped"
        assert not bl.live_runs()[0].consumers
        return frames, turns

    frames, turns = asyncio.run(main())
    assert frames >= 5
    assert turns > 5


def test_an_async_loop_sees_every_frame(processes: Processes) -> None:
    processes.run(*SHORT, "--no-record")

    async def main() -> list[int]:
        return [frame.frame async for frame in bl.attach_async("light", timeout_s=20)]

    assert asyncio.run(main()) == list(range(2001))


def test_waiting_for_a_run_can_be_cancelled() -> None:
    async def main() -> None:
        async with asyncio.timeout(0.1):
            await anext(bl.attach_async("none"))

    with pytest.raises(TimeoutError):
        asyncio.run(main())


def test_closing_ends_a_loop_in_another_thread(processes: Processes) -> None:
    processes.run(*LONG, "--no-record", "--pace", "1e-9")
    live = bl.attach(timeout_s=20)
    seen: list[int] = []
    first = threading.Event()

    def loop() -> None:
        for frame in live:
            seen.append(frame.frame)
            first.set()

    thread = threading.Thread(target=loop)
    thread.start()
    assert first.wait(20)
    live.close()
    thread.join(20)
    assert not thread.is_alive()
    assert live.end == "stopped"


def test_threads_share_the_frames_of_a_run(processes: Processes) -> None:
    processes.run(*SHORT, "--no-record")
    live = bl.attach(timeout_s=20)
    seen: list[list[int]] = [[], []]

    def loop(mine: list[int]) -> None:
        while True:
            try:
                frame = next(live, None)
            except bl.LiveError:
                continue  # both hold a frame
            if frame is None:
                return
            mine.append(frame.frame)
            del frame

    threads = [threading.Thread(target=loop, args=(mine,)) for mine in seen]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert sorted(seen[0] + seen[1]) == list(range(2001))


def frames_seen(name: str) -> int:
    with bl.attach(name, timeout_s=20) as live:
        return sum(1 for _ in live)


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes_of_a_pool_attach(processes: Processes, method: str) -> None:
    bl.live_runs()
    processes.run(*SHORT, "--no-record", wait_for=2)
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.map(frames_seen, ["light", "light"], chunksize=1) == [2001, 2001]


def test_memory_does_not_grow_with_the_frames(processes: Processes) -> None:
    program = """
import beadline as bl
def used():
    lines = open("/proc/self/status")
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))
with bl.attach("light", timeout_s=20) as live:
    for frame in live:
        frame.velocity_m_s.max()
        if frame.frame == 5000:
            before = used()
    print(frame.frame, used() - before)
"""
    processes.run(*CHAIN, "--duration", "1e-2", "--no-record")
    out, err = processes.python(program).communicate()
    assert out, err
    last, grown_kb = map(int, out.split())
    assert last == 100_000
    assert grown_kb < 4096


@bl.consumer(columns=["momentum_n_s", "fastest_m_s"])
def motion(frame: bl.Frame) -> tuple[float, float]:
    return frame.mass_kg @ frame.velocity_m_s, np.abs(frame.velocity_m_s).max()


def test_a_consumer_gives_the_same_rows_of_a_run_and_of_its_recording(
    processes: Processes, root: Path
) -> None:
    run = processes.run(*SHORT, "--out", "light.mcap")
    live = motion.follow("live:light", timeout_s=20)
    assert run.wait() == 0
    file = motion.follow(root / "light.mcap")
    assert list(live) == ["frame", "step", "time_s", "momentum_n_s", "fastest_m_s"]
    for name in live:
        np.testing.assert_array_equal(live[name], file[name])
    with pytest.raises(ValueError, match="live"):
        motion.follow(root / "light.mcap", publish=True)


def test_published_rows_are_recorded(processes: Processes, root: Path) -> None:
    processes.run(*SHORT, "--no-record", wait_for=2)
    recorder = processes.start(*COMMAND, "record", "live:light", "--out", "all.mcap")
    table = motion.follow("live", publish=True, timeout_s=20)
    assert recorder.wait() == 0
    channels = dict(_native.States.open(root / "all.mcap").about()["channels"])
    assert channels["/own/motion"] == len(table) == 2001


def test_a_row_of_another_width_names_both(processes: Processes, root: Path) -> None:
    run = processes.run(*SHORT, "--out", "light.mcap", wait_for=0)
    assert run.wait() == 0
    wrong = bl.consumer(columns=["a_m", "b_m"])(lambda frame: [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match=r"gave 3 values for frame 0, not 2 \(a_m, b_m\)"):
        wrong.follow(root / "light.mcap")
    for given in (None, "1.5", 1j, {"a_m": 1.0}):
        with pytest.raises(ValueError, match=r"^odd gave .* for frame 0; expected numbers \(a_m\) by return or yield"):
            bl.consumer(columns=["a_m"], name="odd")(lambda frame, given=given: given).follow(root / "light.mcap")
    missing = bl.consumer(columns=["a_m"])(lambda frame: float("nan"))
    assert np.isnan(missing.follow(root / "light.mcap")["a_m"]).all()
    wide = bl.consumer(columns=["v_m_s"], name="wide")(lambda frame: frame.velocity_m_s[:3])
    assert list(wide.follow(root / "light.mcap"))[3:] == ["v_0_m_s", "v_1_m_s", "v_2_m_s"]


def test_columns_that_a_table_would_lose_are_refused() -> None:
    for columns in (["time_s"], ["a_m", "a_m"]):
        with pytest.raises(ValueError, match=f"columns: found '{columns[0]}'; allowed: other names than frame, step and time_s"):
            bl.consumer(columns=columns)(lambda frame: [1.0] * len(columns))
    with pytest.raises(ValueError, match="columns: found 'step'; allowed"):
        bl.analysis(columns={"a_m": "a length", "step": "a number"})(object)
    with pytest.raises(ValueError, match="columns: found 'T_j'; allowed: names without capitals"):
        bl.analysis(columns={"T_j": "a temperature"})(object)
