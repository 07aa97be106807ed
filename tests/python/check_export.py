"""Compares exports of Beadline recordings with a recording, each read by packages that others wrote.

    pip install -r requirements.txt
    python check_export.py TRUTH.mcap EXPORT=STEPS=BEADS...

STEPS is FIRST:LAST:EVERY and says which steps of TRUTH.mcap, a recording of the same physics with a state for every
step, EXPORT must hold: the multiples of EVERY from FIRST to LAST, and with FIRST:LAST:EVERY+ also LAST. BEADS is
A:B, without B. Steps, frames, times, displacements, velocities, masses, stiffnesses and rest overlaps must be
the same, doubles bit for bit, and so must the physics of the manifest. What an export is, its name says: .npz (read by
numpy), .csv (Python's csv), .parquet (pyarrow). Exit code 0 if all is well.
"""

import csv
import json
import sys

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def read_truth(path):
    """Physics, chain and the states by their steps."""
    states, chain = {}, None
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(topics=["/chain", "/state"]):
            if channel.topic == "/chain":
                chain = message
            else:
                values = np.array(message.displacement_m), np.array(message.velocity_m_s)
                states[message.step] = message.time_s, *values
        metadata = [record for record in reader.iter_metadata() if record.name == "beadline.run"]
    return json.loads(metadata[0].metadata["physics"]), chain, states


def numbers(table, name):
    return np.array([float(value) if value not in ("", None) else np.nan for value in table[name]])


def read_npz(path):
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays} | {"manifest": json.loads(str(arrays["manifest"]))}


def read_csv_columns(path):
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, zip(*rows)))


def read_csv(path):
    table, chain = read_csv_columns(path), read_csv_columns(path.replace(".csv", ".chain.csv"))
    beads = [int(bead) for bead in chain["bead"]]
    columns = ["frame", "step", "time_s"]
    columns += [f"u_{bead}_m" for bead in beads] + [f"v_{bead}_m_s" for bead in beads]
    if list(table) != columns:
        sys.exit(f"{path}: columns {list(table)[:5]}…, expected {columns[:5]}…")
    with open(path.replace(".csv", ".manifest.json")) as file:
        manifest = json.load(file)
    return {
        "frame": np.array([int(frame) if frame else -1 for frame in table["frame"]]),
        "step": np.array([int(step) for step in table["step"]]),
        "time_s": numbers(table, "time_s"),
        "displacement_m": np.stack([numbers(table, f"u_{bead}_m") for bead in beads], axis=1),
        "velocity_m_s": np.stack([numbers(table, f"v_{bead}_m_s") for bead in beads], axis=1),
        "bead": np.array(beads),
        "mass_kg": numbers(chain, "mass_kg"),
        "stiffness": numbers(chain, "stiffness")[:-1],
        "rest_overlap_m": numbers(chain, "rest_overlap_m")[:-1],
        "manifest": manifest,
    }


def read_parquet(path):
    import pyarrow.parquet as parquet

    table = parquet.read_table(path)
    chain = parquet.read_table(path.replace(".parquet", ".chain.parquet")).to_pydict()

    def lists(name):
        return table[name].combine_chunks().flatten().to_numpy().reshape(table.num_rows, -1)

    return {
        "frame": np.array([-1 if frame is None else frame for frame in table["frame"].to_pylist()]),
        "step": table["step"].to_numpy(),
        "time_s": table["time_s"].to_numpy(),
        "displacement_m": lists("displacement_m"),
        "velocity_m_s": lists("velocity_m_s"),
        "bead": np.array(chain["bead"]),
        "mass_kg": numbers(chain, "mass_kg"),
        "stiffness": numbers(chain, "stiffness")[:-1],
        "rest_overlap_m": numbers(chain, "rest_overlap_m")[:-1],
        "manifest": json.loads(table.schema.metadata[b"beadline.manifest"]),
    }


def frame_at(step, manifest):
    """The number of the frame at a step, -1 if there is none."""
    every, last = manifest["provenance"]["publish_every_steps"], manifest["physics"]["step_count"]
    if step == last:
        return -(-last // every)
    return step // every if step % every == 0 else -1


def same(path, name, found, expected):
    found, expected = np.asarray(found), np.asarray(expected)
    if expected.dtype == np.float64:
        if found.dtype != np.float64:
            sys.exit(f"{path}: {name} is of type {found.dtype}")
        found, expected = found.view(np.uint64), expected.view(np.uint64)
    if found.shape != expected.shape:
        sys.exit(f"{path}: {name} has the shape {found.shape}, expected {expected.shape}")
    if not np.array_equal(found, expected):
        place = np.argwhere(found != expected)[0]
        sys.exit(f"{path}: {name} differs at {place}")


def check(path, steps, beads, truth):
    physics, chain, states = truth
    first, last, every = steps.split(":")
    first, last, stride = int(first), int(last), int(every.rstrip("+"))
    expected = [step for step in range(first, last + 1) if step % stride == 0]
    if every.endswith("+") and expected[-1] != last:
        expected.append(last)
    a, b = map(int, beads.split(":"))
    readers = {"npz": read_npz, "csv": read_csv, "parquet": read_parquet}
    found = readers[path.rsplit(".", 1)[-1]](path)
    if found["manifest"]["physics"] != physics:
        sys.exit(f"{path}: other physics")
    same(path, "step", found["step"], expected)
    same(path, "frame", found["frame"], [frame_at(step, found["manifest"]) for step in expected])
    same(path, "time_s", found["time_s"], np.array([states[step][0] for step in expected]))
    same(path, "displacement_m", found["displacement_m"], np.stack([states[step][1][a:b] for step in expected]))
    same(path, "velocity_m_s", found["velocity_m_s"], np.stack([states[step][2][a:b] for step in expected]))
    same(path, "bead", found["bead"], np.arange(a, b))
    same(path, "mass_kg", found["mass_kg"], np.array(chain.mass_kg[a:b]))
    same(path, "stiffness", found["stiffness"], np.array(chain.stiffness[a : b - 1]))
    same(path, "rest_overlap_m", found["rest_overlap_m"], np.array(chain.rest_overlap_m[a : b - 1]))
    print(f"{path}: {len(expected)} states of {b - a} beads are the same")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    truth = read_truth(sys.argv[1])
    for argument in sys.argv[2:]:
        check(*argument.split("="), truth)
