"""Reads what `beadline export --to ros2` makes with `rosbags`, and compares it with the recording.

    python check_ros2.py RUN.mcap BAG.mcap [--beads A..B] [--from S] [--until S] [--every-steps K]

RUN.mcap holds every step that may be in the bag. Each state of it that lies within what was asked for must be in the bag,
in this order and no other, with the same doubles, bit for bit; so must the masses, and the scalars of /summary. Exit code 0
if all is well, 1 if not.
"""

import argparse
import json
from pathlib import Path

import numpy
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader


def arguments():
    parser = argparse.ArgumentParser()
    parser.add_argument("run")
    parser.add_argument("bag")
    parser.add_argument("--beads", type=lambda text: slice(*map(int, text.split(".."))), default=slice(0, None))
    parser.add_argument("--from", dest="begin", type=float, default=0.0)
    parser.add_argument("--until", type=float, default=float("inf"))
    parser.add_argument("--every-steps", type=int, default=1)
    return parser.parse_args()


def recording(path):
    """The chain, the states and the summaries, by their steps, and the manifest."""
    chain, states, summaries = None, {}, {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, decoded in reader.iter_decoded_messages():
            if channel.topic == "/chain":
                chain = decoded
            elif channel.topic == "/state":
                states[decoded.step] = decoded
            elif channel.topic == "/summary":
                summaries[decoded.step] = decoded
        manifest = {record.name: record.metadata for record in reader.iter_metadata()}["beadline.run"]
    return chain, states, summaries, manifest


def bag(path):
    """The messages by their topics: log time (ns) and message."""
    found = {}
    with AnyReader([Path(path)]) as reader:
        for connection, time_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((time_ns, message))
    with Reader(Path(path)) as reader:
        assert reader.message_count == sum(map(len, found.values()))
    return found


def bits(values):
    return numpy.asarray(values, dtype=numpy.float64).tobytes()


def check_header(time_ns, message, time_s=None):
    stamp = message.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == time_ns, f"stamp {stamp}, log time {time_ns} ns"
    if time_s is not None:
        assert abs(time_ns - time_s * 1e9) <= 0.5, f"{time_ns} ns, {time_s} s"
        assert bits(message.time_s) == bits(time_s)


def check_chain(topic, chain, beads):
    [(time_ns, found)] = topic
    check_header(time_ns, found)
    contacts = slice(beads.start, None if beads.stop is None else beads.stop - 1)
    assert found.first_bead == beads.start and found.alpha == chain.alpha
    assert bits(found.mass_kg) == bits(chain.mass_kg[beads])
    assert bits(found.stiffness) == bits(chain.stiffness[contacts])
    assert bits(found.rest_overlap_m) == bits(chain.rest_overlap_m[contacts])


def check_state(time_ns, found, state, beads):
    check_header(time_ns, found, state.time_s)
    where = f"/state of step {found.step}"
    assert found.frame == (state.frame if state.HasField("frame") else -1), f"{where}: frame {found.frame}"
    assert found.first_bead == beads.start
    assert bits(found.displacement_m) == bits(state.displacement_m[beads]), f"{where}: displacements differ"
    assert bits(found.velocity_m_s) == bits(state.velocity_m_s[beads]), f"{where}: velocities differ"
    return len(found.displacement_m) + len(found.velocity_m_s)


def check_summary(time_ns, found, summary):
    check_header(time_ns, found, summary.time_s)
    for name in ["kinetic_j", "potential_j", "total_j", "dissipated_j", "relative_drift", "front_bead"]:
        assert getattr(found, name) == getattr(summary, name), f"{name} of step {found.step}"
    assert list(found.impurity_bead) == [impurity.bead for impurity in summary.impurity]
    assert list(found.impurity_displacement_m) == [impurity.displacement_m for impurity in summary.impurity]
    assert list(found.impurity_velocity_m_s) == [impurity.velocity_m_s for impurity in summary.impurity]


def main(asked):
    chain, states, summaries, run = recording(asked.run)
    found = bag(asked.bag)
    due = [
        step
        for step, state in sorted(states.items())
        if asked.begin <= state.time_s <= asked.until and step % asked.every_steps == 0
    ]
    assert due, "nothing was asked for"
    assert [message.step for _, message in found["/state"]] == due, "other states than those asked for"
    assert [message.step for _, message in found["/summary"]] == due
    [(_, manifest)] = found["/manifest"]
    assert json.loads(manifest.data)["physics"] == json.loads(run["physics"])
    check_chain(found["/chain"], chain, asked.beads)
    compared = 0
    for (time_ns, state), (summary_ns, summary) in zip(found["/state"], found["/summary"]):
        compared += check_state(time_ns, state, states[state.step], asked.beads)
        check_summary(summary_ns, summary, summaries[summary.step])
    print(f"{asked.bag}: {len(due)} states, {compared} doubles compared, no difference")


if __name__ == "__main__":
    main(arguments())
