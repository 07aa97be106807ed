"""Reads Beadline recordings with nothing but docs/FORMAT.md: no package for MCAP, none for protobuf.

    python read_from_the_page.py RUN.mcap [IMPURITY.csv]

Needs Python 3.9, and the package `zstandard` for chunks that are compressed. Checks what the page says can be
checked: the order of the records, the checksum of the manifest, every CRC, the order of the states and their schedule,
the hash of the last state. With a CSV of `beadline impurity`, every double in its columns time_s, u_<bead>_m and
v_<bead>_m_s must be that of the state of the same frame, bit for bit. Exit code 0 if all is well, 1 if not.
"""

import csv
import hashlib
import json
import re
import struct
import sys
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 1, 2, 3, 4, 5, 6, 7
ATTACHMENT, METADATA, DATA_END = 9, 12, 15
DRAG, RESONATORS = 13, 14  # fields of /chain


class Wrong(Exception):
    """What a file may not be."""


def expect(ok, what):
    if not ok:
        raise Wrong(what)


class Fields:
    """The fields of a record, one after the other."""

    def __init__(self, body):
        self.body, self.at = body, 0

    def take(self, count):
        expect(self.at + count <= len(self.body), "a field beyond the end of its record")
        self.at += count
        return self.body[self.at - count : self.at]

    def number(self, form):
        return struct.unpack("<" + form, self.take(struct.calcsize(form)))[0]

    def text(self):
        return self.take(self.number("I")).decode()

    def texts(self):
        inner, found = Fields(self.take(self.number("I"))), {}
        while inner.at < len(inner.body):
            key = inner.text()
            expect(key not in found, f"the key {key} twice")
            found[key] = inner.text()
        return found


def records(file, at, end):
    """Opcode, contents and offset of each whole record in file[at:end]."""
    while at + 9 <= end:
        opcode, length = struct.unpack_from("<BQ", file, at)
        if at + 9 + length > end:
            return
        yield opcode, file[at + 9 : at + 9 + length], at
        at += 9 + length


def check_crc(stored, covered, what):
    expect(stored in (0, zlib.crc32(covered)), f"the CRC of {what}")


def unpack_chunk(body):
    fields = Fields(body)
    fields.take(16)  # the times of its first and last message
    size, crc, compression = fields.number("Q"), fields.number("I"), fields.text()
    packed = fields.take(fields.number("Q"))
    if compression == "zstd":
        import zstandard

        packed = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    else:
        expect(compression == "", f"the compression {compression}")
    expect(len(packed) == size, "the size of a chunk")
    check_crc(crc, packed, "a chunk")
    return packed


def varint(body, at):
    value = shift = 0
    while True:
        value |= (body[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if body[at - 1] < 0x80:
            return value, at


def message_fields(body):
    """The fields of a protobuf message: number, wire type, value."""
    at = 0
    while at < len(body):
        tag, at = varint(body, at)
        if tag & 7 == 0:
            value, at = varint(body, at)
        elif tag & 7 == 1:
            value, at = body[at : at + 8], at + 8
        elif tag & 7 == 2:
            length, at = varint(body, at)
            value, at = body[at : at + length], at + length
        else:
            raise Wrong(f"the wire type {tag & 7}")
        yield tag >> 3, tag & 7, value


def chain_state(body):
    """A beadline.v1.ChainState: frame, step, time and the bytes of u, v and extra."""
    state = {"frame": None, "step": 0, "time_s": bytes(8), 4: b"", 5: b"", 6: b""}
    for number, _, value in message_fields(body):
        if number in (1, 2):
            state["frame" if number == 1 else "step"] = value
        elif number == 3:
            state["time_s"] = value
        elif number in (4, 5, 6):
            state[number] += value  # packed, or one by one
    return state


class Recording:
    """A recording, read and checked from its first byte to its last."""

    def __init__(self, path):
        with open(path, "rb") as file:
            self.file = file.read()
        expect(self.file.startswith(MAGIC), "no MCAP file")
        self.closed = len(self.file) > 16 and self.file.endswith(MAGIC)
        self.channels, self.counts, self.states = {}, {}, []
        self.end, self.finished, self.manifest, self.of_chain = None, False, None, set()
        data_end = None
        stop = len(self.file) - (8 if self.closed else 0)
        for number, (opcode, body, offset) in enumerate(records(self.file, 8, stop)):
            if number == 0:
                self.read_header(opcode, body)
            elif number == 1:
                self.read_manifest(opcode, body)
            elif opcode == FOOTER:
                self.check_footer(body, offset, data_end)
            elif data_end is not None:
                continue  # the summary section says again what was said
            elif opcode == DATA_END:
                data_end = offset
                check_crc(Fields(body).number("I"), self.file[:offset], "the data section")
            elif opcode == CHUNK:
                packed = unpack_chunk(body)
                for inner in records(packed, 0, len(packed)):
                    self.read_record(*inner[:2])
            else:
                self.read_record(opcode, body)
        expect(self.manifest, "no manifest")
        expect(not self.closed or self.finished, "a closed file without a footer")

    def read_header(self, opcode, body):
        fields = Fields(body)
        expect(opcode == HEADER and fields.text() == "beadline", "no header of ours")
        expect(fields.text().startswith("beadline "), "no library of ours")

    def read_manifest(self, opcode, body):
        fields = Fields(body)
        expect(opcode == METADATA and fields.text() == "beadline.run", "the second record is no manifest")
        run = fields.texts()
        parts = ["beadline.run", run["schema_version"], run["physics"], run["provenance"]]
        expect(run["schema_version"].split(".")[0] == "1", "another major version")
        checksum = hashlib.sha256("".join(part + "\n" for part in parts).encode()).hexdigest()
        expect(checksum == run["checksum"], "the checksum of the manifest")
        self.manifest = {"physics": json.loads(run["physics"]), "provenance": json.loads(run["provenance"])}

    def read_record(self, opcode, body):
        fields = Fields(body)
        if opcode == CHANNEL:
            number, _schema = fields.number("H"), fields.number("H")
            self.channels[number] = fields.text()
        elif opcode == MESSAGE:
            number = fields.number("H")
            fields.take(4 + 8 + 8)  # sequence, log time, publish time
            topic = self.channels[number]
            self.counts[topic] = self.counts.get(topic, 0) + 1
            if topic == "/chain":
                self.of_chain = {number for number, _, value in message_fields(body[fields.at :]) if value}
            if topic == "/state":
                self.read_state(body[fields.at :])
        elif opcode == ATTACHMENT:
            (crc,) = struct.unpack("<I", body[-4:])
            check_crc(crc, body[:-4], "an attachment")
        elif opcode == METADATA and fields.text() == "beadline.end":
            self.end = fields.texts()

    def read_state(self, body):
        state, physics = chain_state(body), self.manifest["physics"]
        step, beads = state["step"], physics["beads"]
        expect(step <= physics["step_count"], f"the step {step}")
        expect(not self.states or self.states[-1]["step"] < step, f"the order of step {step}")
        expect(state["time_s"] == struct.pack("<d", step * physics["dt_s"]), f"the time of step {step}")
        expect(len(state[4]) == len(state[5]) == 8 * beads, f"the length of step {step}")
        extra = 4 if physics["method"] == "gear5" else 0
        extra += 2 if RESONATORS in self.of_chain else 0
        extra += 1 if physics.get("damping") or DRAG in self.of_chain else 0
        extra += 1 if physics.get("drives") else 0
        expect(len(state[6]) == 8 * beads * extra, f"the further values of step {step}")
        every = self.manifest["provenance"]["publish_every_steps"]
        if state["frame"] is not None:
            expect(step == min(state["frame"] * every, physics["step_count"]), f"the frame of step {step}")
        self.states.append(state)

    def check_footer(self, body, offset, data_end):
        fields = Fields(body)
        fields.take(16)  # where the summary and its offsets begin
        expect(offset + 9 + 20 + 8 == len(self.file), "something after the footer")
        summary = data_end + 9 + 4  # the record Data End, of 4 bytes
        check_crc(fields.number("I"), self.file[summary : offset + 9 + 16], "the summary section")
        self.finished = self.end is not None

    def check_schedule(self):
        """The steps that should be there, up to where the recording ended."""
        if "/state" not in self.channels.values():
            return
        physics, provenance = self.manifest["physics"], self.manifest["provenance"]
        found = [state["step"] for state in self.states]
        if self.finished:
            last = physics["step_count"] if self.end["reason"] == "complete" else int(self.end["last_step"])
            expect(self.end["first_step"] == str(found[0]), "the first step")
            expect(self.end["last_step"] == str(found[-1]), "the last step")
            hashed = self.states[-1]
            state = struct.pack("<Q", hashed["step"]) + hashed[4] + hashed[5] + hashed[6]
            expect(hashlib.sha256(state).hexdigest() == self.end["last_state_hash"], "the last state's hash")
        else:
            last = found[-1]
        due = {step for step in range(0, last + 1, provenance["record_every_steps"]) if step >= found[0]} | {last}
        expect(due <= set(found), f"steps are missing: {sorted(due - set(found))[:5]}")

    def compare(self, path):
        """The doubles that our table has, too."""
        with open(path, newline="") as lines:
            rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        states, compared = {state["frame"]: state for state in self.states}, 0
        expect(len(rows) == len(states), "the number of frames in the table")
        for row in rows:
            state = states[int(row["frame"])]
            expect(struct.pack("<d", float(row["time_s"])) == state["time_s"], f"time_s of {row['frame']}")
            for name, text in row.items():
                column = re.fullmatch(r"([uv])_(\d+)_(?:m|m_s)", name)
                if column:
                    at = 8 * int(column[2])
                    double = state[4 if column[1] == "u" else 5][at : at + 8]
                    expect(struct.pack("<d", float(text)) == double, f"{name} of frame {row['frame']}")
                    compared += 1
        expect(compared, "the table has no column u_<bead>_m or v_<bead>_m_s")
        return compared


def main(path, table=None):
    try:
        recording = Recording(path)
        recording.check_schedule()
        compared = recording.compare(table) if table else 0
    except Wrong as wrong:
        print(f"{path}: WRONG: {wrong}", file=sys.stderr)
        return 1
    state = "finished" if recording.finished else "unfinished"
    print(f"{path}: {state}, {recording.counts}, {compared} doubles compared")
    return 0


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
