"""Reads what `rerun mcap convert` makes of a Beadline recording, and compares it with our CSV.

    python check_with_rerun.py RUN.rrd MOTION.csv ENERGIES.csv

/state must have, bit for bit, the doubles in the columns u_<bead>_m and v_<bead>_m_s of `beadline impurity`, /summary the
scalars of `beadline energies` but for the order of the sum, and each row stands at its simulated time. Exit code 0 if all is
well, 1 if not.
"""

import csv
import math
import re
import sys

import pyarrow
from rerun.chunk import RrdReader


def rows_of(path):
    with open(path, newline="") as lines:
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def messages(path, entity):
    """Log time (ns) and fields of each message that Rerun has decoded for a topic."""
    found = []
    for chunk in RrdReader(path).stream():
        if chunk.entity_path != entity:
            continue
        batch = chunk.to_record_batch()
        columns = [name for name in batch.schema.names if name.endswith(":message")]
        if columns:
            times = batch.column("message_log_time").cast(pyarrow.int64()).to_pylist()
            found += [(time, cell[0]) for time, cell in zip(times, batch.column(columns[0]).to_pylist())]
    return sorted(found, key=lambda message: message[1]["step"])


def compare_state(row, state):
    compared = 0
    for name, text in row.items():
        if column := re.fullmatch(r"([uv])_(\d+)_(?:m|m_s)", name):
            values = state["displacement_m" if column[1] == "u" else "velocity_m_s"]
            assert repr(float(text)) == repr(values[int(column[2])]), f"{name} of frame {row['frame']}"
            compared += 1
    return compared


def compare_summary(row, summary):
    names = ["kinetic_j", "potential_j", "total_j"]
    for name in names:
        same = math.isclose(float(row[name]), summary[name], rel_tol=1e-12)
        assert same, f"{name} of frame {row['frame']}: {row[name]}, {summary[name]!r} in Rerun"
    return len(names)


def check(path, entity, table, compare):
    rows, found = rows_of(table), messages(path, entity)
    assert len(rows) == len(found), f"{entity}: {len(found)} messages, {len(rows)} rows of {table}"
    compared = 0
    for row, (log_time_ns, message) in zip(rows, found):
        assert int(row["frame"]) == message["frame"], f"{entity}: frame {message['frame']}"
        assert abs(log_time_ns - float(row["time_s"]) * 1e9) <= 1, f"{entity}: {log_time_ns} ns, {row['time_s']} s"
        compared += compare(row, message)
    assert compared, f"nothing to compare in {table}"
    return compared


def main(path, motion, energies):
    compared = check(path, "/state", motion, compare_state)
    compared += check(path, "/summary", energies, compare_summary)
    print(f"{path}: {compared} doubles compared")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
