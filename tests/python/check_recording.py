"""Reads a Beadline recording with packages that others wrote, and compares it with our CSV.

    pip install -r requirements.txt
    python check_recording.py [--unfinished] RUN.mcap [IMPURITY.csv]

Checks every CRC, the profile, the metadata and its checksum, the schemas, that the frames the manifest
promises are there in order, that log times are simulated times, and that /summary agrees with /state.
With a CSV, every double in its columns time_s, u_<bead>_m and v_<bead>_m_s must be that of the state of the
same frame, bit for bit, and so must be those of /impurity, if there is one. Of other results the frames must be in
order, and /energies must agree with /summary. With --unfinished the recording was not closed: it ends after any whole
record, and has every frame up to there. Exit code 0 if all is well, 1 with the differences if not.
"""

import csv
import hashlib
import json
import math
import re
import struct
import sys
from decimal import ROUND_HALF_UP, Decimal

from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Header, Metadata
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

SCHEMAS = {
    "/chain": "beadline.v1.Chain",
    "/state": "beadline.v1.ChainState",
    "/summary": "beadline.v1.Summary",
    "/energies": "beadline.v1.Energies",
    "/impurity": "beadline.v1.ImpurityMotion",
    "/contacts": "beadline.v1.ContactClasses",
    "/pulses": "beadline.v1.Pulses",
}


class Checks:
    """Collects what is wrong, and stops when it is a lot."""

    def __init__(self):
        self.failures = 0

    def expect(self, ok, what):
        if ok:
            return
        self.failures += 1
        print(f"WRONG: {what}", file=sys.stderr)
        if self.failures >= 20:
            sys.exit("and so on")


def bits(value):
    return struct.pack("<d", value)


def whole_records(records, unfinished):
    """The records of a file; where one was not closed they just end."""
    try:
        yield from records
    except EndOfFile:
        if not unfinished:
            raise


def read_raw(path, unfinished, checks):
    """All records in the order of the file, with every CRC of the data section checked."""
    with open(path, "rb") as stream:
        records = whole_records(StreamReader(stream, validate_crcs=True).records, unfinished)
        header, run = next(records), next(records)
        checks.expect(isinstance(header, Header) and header.profile == "beadline", f"header {header}")
        checks.expect(header.library.startswith("beadline "), f"library {header.library}")
        checks.expect(isinstance(run, Metadata) and run.name == "beadline.run", "the first record is no manifest")
        more = {record.name: record.metadata for record in records if isinstance(record, Metadata)}
    begin, end = more.get("beadline.begin", {}), more.get("beadline.end")
    if begin:
        parts = ["beadline.begin", begin["first_step"], begin["part"], begin["previous_state_hash"]]
        checksum = hashlib.sha256("".join(part + "\n" for part in parts).encode()).hexdigest()
        checks.expect(checksum == begin["checksum"], f"checksum of beadline.begin {begin['checksum']}")
    checks.expect((end is None) == unfinished, f"metadata beadline.end: {end}")
    checks.expect(not begin or not end or begin["part"] == end["part"], f"part {begin} and {end}")
    return run.metadata, begin, end or {}


def check_manifest(run, checks):
    parts = ["beadline.run", run["schema_version"], run["physics"], run["provenance"]]
    checksum = hashlib.sha256("".join(part + "\n" for part in parts).encode()).hexdigest()
    checks.expect(checksum == run["checksum"], f"checksum {checksum} instead of {run['checksum']}")
    return json.loads(run["physics"]), json.loads(run["provenance"])


def expected_steps(physics, provenance, begin, end):
    """The steps that the schedule says are recorded, from where the recording begins to where it ended."""
    first = int(begin.get("first_step", 0))
    last = physics["step_count"] if end["reason"] == "complete" else int(end["last_step"])
    every = provenance["record_every_steps"]
    return sorted({first, last, *range(-(-first // every) * every, last + 1, every)})


def check_message(channel, message, decoded, checks):
    checks.expect(message.log_time == message.publish_time, f"{channel.topic}: two times")
    if channel.topic == "/chain":
        return
    log_time = Decimal(decoded.time_s * 1e9).to_integral_value(ROUND_HALF_UP)
    what = f"{channel.topic} {decoded.step}: log time {message.log_time} for {decoded.time_s} s"
    checks.expect(message.log_time == log_time, what)


def extra_count(physics, chain):
    """How many further values a state has for each bead."""
    terms = 4 if physics["method"] == "gear5" else 0
    # the schemas of older recordings do not have these
    resonators = 2 if len(getattr(chain, "resonator_mass_kg", ())) else 0
    is_damped = "damping" in physics or len(getattr(chain, "drag", ())) > 0
    return terms + resonators + is_damped + bool(physics.get("drives"))


def check_state(state, physics, chain, provenance, checks):
    where = f"/state of step {state.step}"
    checks.expect(state.HasField("frame"), f"{where}: no frame")
    every, beads = provenance["publish_every_steps"], physics["beads"]
    step = min(state.frame * every, physics["step_count"])
    checks.expect(state.step == step, f"{where}: frame {state.frame}")
    checks.expect(bits(state.time_s) == bits(state.step * physics["dt_s"]), f"{where}: time {state.time_s}")
    lengths = (len(state.displacement_m), len(state.velocity_m_s))
    checks.expect(lengths == (beads, beads), f"{where}: {lengths} values, {beads} beads")
    extra = beads * extra_count(physics, chain)
    checks.expect(len(state.extra) == extra, f"{where}: {len(state.extra)} further values instead of {extra}")


def check_summary(summary, state, physics, checks):
    where = f"/summary of step {summary.step}"
    checks.expect((summary.frame, summary.step) == (state.frame, state.step), f"{where} after {state.step}")
    beads = [impurity["bead"] for impurity in physics["impurities"]]
    checks.expect([impurity.bead for impurity in summary.impurity] == beads, f"{where}: other impurities")
    for impurity in summary.impurity:
        # the generated encoder leaves out -0 in single numbers, so these are compared as numbers
        same = impurity.displacement_m == state.displacement_m[impurity.bead]
        same &= impurity.velocity_m_s == state.velocity_m_s[impurity.bead]
        checks.expect(same, f"{where}: bead {impurity.bead} differs from /state")
    checks.expect(summary.total_j == summary.kinetic_j + summary.potential_j, f"{where}: total energy")


class Results:
    """Rows of results, each kind in the order of frames."""

    def __init__(self):
        self.last_step = {}
        self.totals = {}

    def check(self, topic, row, table, checks):
        checks.expect(row.step > self.last_step.get(topic, -1), f"{topic}: step {row.step} is out of order")
        self.last_step[topic] = row.step
        if topic == "/summary":
            self.totals[row.step] = row.total_j
        elif topic == "/energies":
            present = [field.name for field, _ in row.ListFields()]
            checks.expect(len(present) >= 10, f"{topic}: only {present} of step {row.step}")
            total = self.totals.pop(row.step, row.total_j)
            # another order of the sum
            same = math.isclose(total, row.total_j, rel_tol=1e-12)
            checks.expect(same, f"{topic}: total energy of step {row.step}")
        elif topic == "/contacts":
            checks.expect(len(row.classes) == -(-row.contact_count // 4), f"{topic}: {len(row.classes)} bytes")
        elif topic == "/impurity" and table:
            return table.compare_motion(row, checks)
        return 0


class Table:
    """The columns of our CSV that /state has, too."""

    def __init__(self, path):
        with open(path, newline="") as lines:
            rows = list(csv.reader(line for line in lines if not line.startswith("#")))
        self.header = rows[0]
        self.rows = {int(row[self.header.index("frame")]): row for row in rows[1:]}
        columns = [(i, re.fullmatch(r"([uv])_(\d+)_(?:m|m_s)", name)) for i, name in enumerate(self.header)]
        self.columns = [(i, match[1], int(match[2])) for i, match in columns if match]
        self.all_rows = dict(self.rows)

    def compare_motion(self, motion, checks):
        """Every column of the table that the row of /impurity has, too."""
        row, compared = self.all_rows.get(motion.frame), 0
        if row is None:
            checks.expect(False, f"the table has no frame {motion.frame}, /impurity has")
            return 0
        arrays = {
            "u_{}_m": motion.displacement_m,
            "v_{}_m_s": motion.velocity_m_s,
            "overlap_left_{}_m": motion.overlap_left_m,
            "overlap_right_{}_m": motion.overlap_right_m,
        }
        for at, bead in enumerate(motion.bead):
            for name, values in arrays.items():
                if (column := name.format(bead)) in self.header:
                    text = row[self.header.index(column)]
                    # an empty field is a NaN
                    same = bits(float(text)) == bits(values[at]) if text else values[at] != values[at]
                    checks.expect(same, f"frame {motion.frame}: {column} is {text}, {values[at]!r} in /impurity")
                    compared += 1
        return compared

    def compare(self, state, checks):
        row = self.rows.pop(state.frame, None)
        if row is None:
            checks.expect(False, f"the table has no frame {state.frame}")
            return 0
        values = {"u": state.displacement_m, "v": state.velocity_m_s}
        pairs = [(self.header.index("time_s"), state.time_s)]
        pairs += [(i, values[which][bead]) for i, which, bead in self.columns]
        for i, value in pairs:
            what = f"frame {state.frame}: {self.header[i]} is {row[i]} in the table, {value!r} in the recording"
            checks.expect(bits(float(row[i])) == bits(value), what)
        step = row[self.header.index("step")]
        checks.expect(int(step) == state.step, f"frame {state.frame}: step {step} in the table")
        return len(pairs)


def read_decoded(stream, unfinished):
    """Every message in the order of the file, and the count in the statistics of one that was closed."""
    if unfinished:
        reader = NonSeekingReader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return whole_records(reader.iter_decoded_messages(log_time_order=False), unfinished), None
    reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
    count = reader.get_summary().statistics.message_count
    return reader.iter_decoded_messages(log_time_order=False), count


def main(path, table_path=None, unfinished=False):
    checks = Checks()
    run, begin, end = read_raw(path, unfinished, checks)
    physics, provenance = check_manifest(run, checks)
    table = Table(table_path) if table_path else None
    if table:
        checks.expect(table.columns, f"{table_path} has no column u_<bead>_m or v_<bead>_m_s")
    steps, compared, state, chain, topics, results = [], 0, None, None, {}, Results()
    with open(path, "rb") as stream:
        messages, message_count = read_decoded(stream, unfinished)
        for schema, channel, message, decoded in messages:
            topics[channel.topic] = topics.get(channel.topic, 0) + 1
            checks.expect(SCHEMAS.get(channel.topic) == schema.name, f"{channel.topic}: {schema.name}")
            check_message(channel, message, decoded, checks)
            if channel.topic == "/chain":
                chain = decoded
                arrays = [decoded.mass_kg, decoded.stiffness, decoded.rest_overlap_m, decoded.rest_force_n]
                beads = physics["beads"]
                lengths = [len(array) for array in arrays]
                checks.expect(lengths == [beads] + 3 * [beads - 1], f"/chain: {lengths} values")
            elif channel.topic == "/state":
                state = decoded
                steps.append(state.step)
                check_state(state, physics, chain, provenance, checks)
                compared += table.compare(state, checks) if table else 0
            elif channel.topic == "/summary":
                check_summary(decoded, state, physics, checks)
            if channel.topic not in ("/chain", "/state"):
                compared += results.check(channel.topic, decoded, table, checks)
    checks.expect(message_count in (None, sum(topics.values())), "the statistics count other messages")
    checks.expect(topics.get("/chain") == 1, "/chain is not there once")
    checks.expect(topics.get("/summary") == len(steps), "/summary and /state differ in number")
    end = {"reason": "unfinished", "last_step": steps[-1]} if unfinished else end
    checks.expect(steps == expected_steps(physics, provenance, begin, end), "steps are missing or too many")
    if table:
        checks.expect(not table.rows, f"frames {list(table.rows)[:5]} are in the table only")
        checks.expect(compared, "nothing was compared")
    print(f"{path}: {len(steps)} states, {compared} doubles compared, {checks.failures} failures")
    return 1 if checks.failures else 0


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--unfinished"]
    if len(words) not in (1, 2):
        sys.exit(__doc__)
    sys.exit(main(*words, unfinished="--unfinished" in sys.argv))
