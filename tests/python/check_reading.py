"""What `examples/python/read_recording.py` reads, beside our table of the same recording.

    python check_reading.py RECORDING TABLE.csv CUT NO_INDEX HOLE WALLS

TABLE is that of `beadline impurity RECORDING --bead ...`, CUT a beginning of RECORDING, NO_INDEX the same with damage in its
summary section, HOLE with damage in the middle; WALLS is of a loaded chain between walls. Exit code 0 if every double has
its bits, and reading takes less than three times as long as `mcap` needs to hand out the messages as they are, without
checksums. Prints how fast it was.
"""

import csv
import re
import sys
import time

import numpy as np
import read_recording
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from read_recording import chain, read, states


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


def check_chain(path):
    """Beside what others decode."""
    found = chain(path)
    with open(path, "rb") as file:
        decoded = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/chain"])
        (theirs,) = [message for *_, message in decoded]
    for ours, values in zip(found, (theirs.mass_kg, theirs.stiffness, theirs.rest_overlap_m, theirs.rest_force_n)):
        assert same(ours, np.array(values))
    assert len(found.damping) == len(found.stiffness) == len(found.mass) - 1
    for ours, wall in ((found.left_wall, theirs.left_wall), (found.right_wall, theirs.right_wall)):
        assert ours == (wall.stiffness, wall.rest_overlap_m, wall.rest_force_n, wall.damping)
    return found


def check_times(run, recording, others):
    """Some time of a recording is a slice of all of it, however it is found."""
    for first, last in ((0, 0), (1, 200), (len(run) // 2 - 7, len(run) // 2), (len(run) - 3, len(run) - 1)):
        from_s, until_s = run.time_s[first], run.time_s[last]
        for path in (recording, *others):
            some = read(path, from_s=from_s, until_s=until_s)
            assert same(some.v, run.v[first : last + 1]) and same(some.chain.mass, run.chain.mass), (path, first)
            assert some.step.tolist() == run.step[first : last + 1].tolist()
            assert some.end == "complete"
    assert len(read(recording, from_s=run.time_s[-1] * 2)) == 0
    between = (run.time_s[10] + run.time_s[11]) / 2
    assert next(states(recording, from_s=between)).step == run.step[11]


def chunks_read(path, **window):
    """How many chunks are unpacked."""
    unpacked, unpack = [], read_recording.unpack
    read_recording.unpack = lambda chunk: unpacked.append(chunk) or unpack(chunk)
    read(path, **window)
    read_recording.unpack = unpack
    return len(unpacked)


def check_every_cut(path):
    """Wherever a file ends, the states up to there are read."""
    whole, states_of_it = open(path, "rb").read(), len(read(path))
    for length in range(len(whole) - 24, len(whole)):
        with open("shorter.mcap", "wb") as file:
            file.write(whole[:length])
        run = read("shorter.mcap")
        assert len(run) == states_of_it and run.end is None, length


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


def main(recording, table, cut, no_index, hole, walls):
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

    check_times(run, recording, [no_index])
    part = dict(from_s=run.time_s[-1] / 2, until_s=run.time_s[-1] / 2 + 1e-4)
    assert 2 <= chunks_read(recording, **part) <= 4 < chunks_read(recording)
    last = shorter.time_s[-1]
    assert same(read(cut, from_s=last / 2).v, shorter.v[shorter.time_s >= last / 2])
    early = read(hole, until_s=run.time_s[100])
    assert same(early.v, run.v[:101])
    try:
        read(hole, from_s=run.time_s[-1] / 4)
        raise AssertionError("damage was read")
    except ValueError as error:
        assert "damaged" in str(error), error
    check_every_cut(walls)
    assert check_chain(recording).left_wall == (0, 0, 0, 0)
    assert check_chain(walls).left_wall.rest_force > 0
    assert same(chain(cut).mass, run.chain.mass)

    ours, theirs = best_of(3, lambda: read(recording), lambda: hand_out(recording))
    megabytes = (run.u.nbytes + run.v.nbytes) / 1e6
    print(f"read_recording.py: {megabytes / ours:.0f} MB/s, mcap alone {megabytes / theirs:.0f} MB/s")
    assert ours < 3 * theirs, f"{ours} s, {theirs} s"


main(*sys.argv[1:])
