"""What `examples/python/read_recording.py` reads, beside our table of the same recording.

    python check_reading.py RECORDING TABLE.csv CUT

TABLE is that of `beadline impurity RECORDING --bead ...`, CUT a beginning of RECORDING. Exit code 0 if every double has
its bits, and reading takes less than three times as long as `mcap` needs to hand out the messages as they are, without
checksums. Prints how fast it was.
"""

import csv
import re
import sys
import time

import numpy as np
from mcap.reader import make_reader
from read_recording import read, states


def check_table(run, path):
    with open(path, newline="") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert run.step.tolist() == [int(row["step"]) for row in rows]
    assert same(run.time_s, column(rows, "time_s"))
    compared = 0
    for name in rows[0]:
        if found := re.fullmatch(r"([uv])_(\d+)_(?:m|m_s)", name):
            array = run.u if found[1] == "u" else run.v
            assert same(array[:, int(found[2])], column(rows, name)), name
            compared += 1
    assert compared >= 6, compared


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def same(left, right):
    return np.array_equal(np.ascontiguousarray(left).view("u8"), right.view("u8"))


def hand_out(path):
    with open(path, "rb") as file:
        return sum(len(message.data) for _, _, message in make_reader(file).iter_messages(topics=["/state"]))


def best_of(times, *programs):
    """The shortest time of each, in turns."""
    best = [float("inf")] * len(programs)
    for _ in range(times):
        for at, program in enumerate(programs):
            start = time.perf_counter()
            program()
            best[at] = min(best[at], time.perf_counter() - start)
    return best


def main(recording, table, cut):
    run = read(recording)
    assert run.u.shape == run.v.shape == (run.manifest["physics"]["step_count"] + 1, run.manifest["physics"]["beads"])
    assert run.end == "complete"
    check_table(run, table)

    some = read(recording, beads=[0, 500])
    assert same(some.u, np.ascontiguousarray(run.u[:, [0, 500]]))
    shorter = read(cut)
    assert shorter.end is None and 0 < len(shorter.u) < len(run.u)
    assert same(shorter.v, run.v[: len(shorter.v)])
    for state, step, v in zip(states(recording), run.step, run.v):
        assert state.frame == state.step == step and same(state.v, v)

    ours, theirs = best_of(3, lambda: read(recording), lambda: hand_out(recording))
    megabytes = (run.u.nbytes + run.v.nbytes) / 1e6
    print(f"read_recording.py: {megabytes / ours:.0f} MB/s, mcap alone {megabytes / theirs:.0f} MB/s")
    assert ours < 3 * theirs, f"{ours} s, {theirs} s"


main(*sys.argv[1:])
