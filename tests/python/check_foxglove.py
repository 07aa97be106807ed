"""Reads what `beadline export --to foxglove` makes, and compares it with the recording.

    python check_foxglove.py RUN.mcap SHOWN.mcap EVENTS.csv CLOUDS [--beads A..B] [--from S] [--until S]

RUN.mcap holds every state that is in SHOWN.mcap, and no others that lie within what was asked for; EVENTS.csv is what
`beadline impurity --events` writes of the same part. Every summary is that of the recording; the beads move as in it; each
event of the table is a log message; there are CLOUDS clouds, the points of each have the doubles of its state, and the
fastest are among them; and each cell of the map has the velocity that is largest in magnitude of its beads and times. Exit
code 0 if all is well, 1 if not.
"""

import argparse
import csv

import numpy
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

KINDS = {5: "u4", 7: "f4", 8: "f8", 1: "u1"}


def read(path):
    """The messages by their topics, each with its log time (ns), and the schemas' names."""
    messages, schemas = {}, {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((message.log_time, decoded))
            schemas[channel.topic] = schema.name
    return messages, schemas


def encoded(messages):
    return [(log_time, message.SerializeToString()) for log_time, message in messages]


def nanoseconds(timestamp):
    return timestamp.seconds * 10**9 + timestamp.nanos


def check_scalars(shown, recorded):
    assert encoded(shown["/summary"]) == encoded(recorded["/summary"]), "/summary differs"
    topics = [topic for topic in shown if topic.startswith("/bead/")]
    assert topics, "no bead is followed"
    for topic in topics:
        bead = int(topic.removeprefix("/bead/"))
        assert len(shown[topic]) == len(recorded["/state"])
        for (_, motion), (_, state) in zip(shown[topic], recorded["/state"]):
            same = motion.step == state.step and motion.bead == bead
            same &= motion.displacement_m == state.displacement_m[bead]
            same &= motion.velocity_m_s == state.velocity_m_s[bead]
            assert same, f"{topic} of step {motion.step}"


def check_events(logs, path):
    with open(path, newline="") as lines:
        events = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert logs[0][1].message.startswith("run "), logs[0][1].message
    assert len(logs) == len(events) + 1, f"{len(logs)} log messages, {len(events)} events"
    assert events, "no events to compare"
    for (log_time, log), event in zip(logs[1:], events):
        assert nanoseconds(log.timestamp) == log_time == round(float(event["time_s"]) * 1e9), event
        assert log.name == f"bead {event['bead']}", event
        assert all(word.rstrip("s") in log.message for word in event["event"].split("-")), (log.message, event)


def points(cloud):
    types = [(field.name, KINDS[field.type], field.offset) for field in cloud.fields]
    names, formats, offsets = zip(*types)
    layout = {"names": names, "formats": formats, "offsets": offsets, "itemsize": cloud.point_stride}
    return numpy.frombuffer(cloud.data, dtype=layout)


def check_clouds(clouds, states, count, beads):
    assert len(clouds) == count, f"{len(clouds)} clouds"
    by_time = {}
    for log_time, state in states:
        by_time.setdefault(log_time, state)
    assert clouds[-1][0] == states[-1][0], "the last state has no cloud"
    for log_time, cloud in clouds:
        state, found = by_time[log_time], points(cloud)
        assert nanoseconds(cloud.timestamp) == log_time
        u, v = numpy.array(state.displacement_m), numpy.array(state.velocity_m_s)
        assert set(found["bead"]) <= set(range(len(v))[beads])
        assert 0 < len(found) <= 2000 and (numpy.diff(found["bead"].astype(int)) > 0).all()
        assert (found["displacement_m"] == u[found["bead"]]).all()
        assert (found["velocity_m_s"] == v[found["bead"]]).all()
        fastest = v[beads].min(), v[beads].max()
        assert (found["velocity_m_s"].min(), found["velocity_m_s"].max()) == fastest
        assert numpy.isfinite(found["x"]).all() and (numpy.diff(found["x"]) > 0).all()


def check_map(images, pictures, states, beads):
    [(log_time, image)], [(_, picture)] = images, pictures
    assert log_time == states[0][0], "the map is not there from the beginning"
    assert (image.encoding, picture.encoding) == ("32FC1", "rgb8")
    assert (picture.height, picture.width) == (image.height, image.width)
    assert len(picture.data) == picture.step * picture.height and picture.step == 3 * picture.width
    found = numpy.frombuffer(image.data, dtype="<f4").reshape(image.height, image.step // 4)
    first, last = states[0][1].step, states[-1][1].step
    rows = [(state.step - first) * image.height // (last - first + 1) for _, state in states]
    v = numpy.array([state.velocity_m_s[beads] for _, state in states]).astype("f4")
    edges = -(-numpy.arange(image.width) * v.shape[1] // image.width)  # the first bead of each column
    largest, least = numpy.maximum.reduceat(v, edges, axis=1), numpy.minimum.reduceat(v, edges, axis=1)
    cells = numpy.where(largest >= -least, largest, least)
    expected = numpy.full_like(found, numpy.nan)
    for row, line in zip(rows, cells):
        before = numpy.nan_to_num(expected[row])
        expected[row] = numpy.where(numpy.abs(line) > numpy.abs(before), line, before)
    for row in range(rows[0], rows[-1]):
        if row not in rows:
            expected[row] = expected[row - 1]
    # where two are equally fast either may be shown
    assert numpy.array_equal(numpy.abs(found), numpy.abs(expected), equal_nan=True), "cells of the map differ"
    assert numpy.nanmax(numpy.abs(found)) == numpy.abs(v).max()
    colours = numpy.frombuffer(picture.data, dtype="u1").reshape(image.height, image.width, 3)
    assert (colours[found == 0] == 255).all() and (colours[numpy.isnan(found)] == 192).all()
    assert len(numpy.unique(colours)) > 10, "no colours"


def arguments():
    parser = argparse.ArgumentParser()
    for name in ["run", "shown", "events"]:
        parser.add_argument(name)
    parser.add_argument("clouds", type=int)
    parser.add_argument("--beads", type=lambda text: slice(*map(int, text.split(".."))), default=slice(0, None))
    parser.add_argument("--from", dest="begin", type=float, default=0.0)
    parser.add_argument("--until", type=float, default=float("inf"))
    return parser.parse_args()


def main(asked):
    (recorded, _), (shown, schemas) = read(asked.run), read(asked.shown)
    expected = {
        "/cloud": "foxglove.PointCloud",
        "/events": "foxglove.Log",
        "/velocity_map": "foxglove.RawImage",
        "/velocity_picture": "foxglove.RawImage",
    }
    assert expected.items() <= schemas.items(), schemas
    for topic in ["/state", "/summary"]:
        recorded[topic] = [(t, m) for t, m in recorded[topic] if asked.begin <= m.time_s <= asked.until]
    states = recorded["/state"]
    check_scalars(shown, recorded)
    check_events(shown["/events"], asked.events)
    check_clouds(shown["/cloud"], states, asked.clouds, asked.beads)
    check_map(shown["/velocity_map"], shown["/velocity_picture"], states, asked.beads)
    print(f"{asked.shown}: {', '.join(f'{len(found)} of {topic}' for topic, found in shown.items())}")


if __name__ == "__main__":
    main(arguments())
