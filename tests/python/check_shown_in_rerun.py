"""Reads what `rerun mcap convert` makes of `beadline export --to foxglove`: what its viewer shows without being told how.

    python check_shown_in_rerun.py SHOWN.mcap SHOWN.rrd

The clouds are points with our positions and colours, the maps are images with our cells, the events are lines of a log, and the
scalars have our values. Exit code 0 if all is well, 1 if not.
"""

import sys

import numpy
from check_foxglove import points, read
from rerun.chunk import RrdReader


def components(path):
    """The values of each component of each entity, in the order of time."""
    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if ":" in name]
        if "message_log_time" not in batch.schema.names:
            continue
        times = batch.column("message_log_time").cast("int64").to_pylist()
        for name in names:
            rows = zip(times, batch.column(name).to_pylist())
            found.setdefault((chunk.entity_path, name), []).extend(rows)
    return {key: [value for _, value in sorted(rows, key=lambda row: row[0])] for key, rows in found.items()}


def check_clouds(clouds, positions, colours):
    assert len(clouds) == len(positions) == len(colours) > 0
    for (_, cloud), found, shown in zip(clouds, positions, colours):
        expected = points(cloud)
        places = numpy.stack([expected[name] for name in "xyz"], axis=1)
        assert (numpy.array(found, dtype="f4") == places).all(), "points are elsewhere"
        rgba = [expected[name].astype("u4") for name in ["red", "green", "blue", "alpha"]]
        assert (numpy.array(shown, dtype="u4") == rgba[0] << 24 | rgba[1] << 16 | rgba[2] << 8 | rgba[3]).all()


def main(mcap, rrd):
    (messages, _), found = read(mcap), components(rrd)
    check_clouds(messages["/cloud"], found["/cloud", "Points3D:positions"], found["/cloud", "Points3D:colors"])
    # the one frame that its 3D view shows without transforms
    assert set(map(tuple, found["/cloud", "CoordinateFrame:frame"])) == {("tf#/",)}
    for topic in ["/velocity_map", "/velocity_picture"]:
        [(_, image)] = messages[topic]
        [buffer], [form] = found[topic, "Image:buffer"], found[topic, "Image:format"]
        assert bytes(buffer[0]) == image.data, f"{topic}: other cells"
        assert (form[0]["width"], form[0]["height"]) == (image.width, image.height), form
    texts = [text for [text] in found["/events", "TextLog:text"]]
    assert sorted(texts) == sorted(log.message for _, log in messages["/events"]), texts
    totals = [summary["total_j"] for [summary] in found["/summary", "beadline.v1.Summary:message"]]
    assert sorted(totals) == sorted(summary.total_j for _, summary in messages["/summary"])
    print(f"{rrd}: {len(messages['/cloud'])} clouds, 2 images, {len(texts)} events, {len(totals)} summaries")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
