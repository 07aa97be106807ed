"""Reads a recording into numpy: `python read_recording.py run.mcap`, or in a program of your own

    from read_recording import read, states

    run = read("run.mcap")              # all states: run.u and run.v have the shape (states, beads)
    for state in states("run.mcap"):    # one after the other, for recordings larger than the memory
        print(state.step, state.v.max())

Needs `pip install mcap numpy`. docs/PYTHON.md says how to use it; docs/FORMAT.md describes every byte. Copy this file
into a project of your own as it is.
"""

import json
import struct
import sys
import time
import zlib
from dataclasses import dataclass
from typing import Optional

import numpy as np
import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Chunk, Header, Metadata
from mcap.stream_reader import StreamReader

CHANNEL, MESSAGE = 0x04, 0x05
RECORD_HEAD, MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<HIQQ")
LARGEST_CHUNK = 1 << 30
FRAME, STEP, TIME, DISPLACEMENT, VELOCITY, EXTRA = range(1, 7)  # fields of beadline.v1.ChainState
EMPTY = np.empty(0)


@dataclass(slots=True, eq=False)
class State:
    """One recorded state. The arrays lie in the chunk that was read and cannot be written to."""

    frame: Optional[int]  # None of a step that was recomputed between two frames
    step: int
    time_s: float
    u: np.ndarray  # displacement of each bead (m)
    v: np.ndarray  # velocity of each bead (m/s)
    extra: np.ndarray  # what else the method needs, see docs/FORMAT.md


@dataclass(slots=True, eq=False)
class Recording:
    """All states of a recording; `len` says how many."""

    manifest: dict  # `physics` and `provenance`, see docs/FORMAT.md
    end: Optional[str]  # how it ended; None of a file that was not finished
    step: np.ndarray  # of each state
    time_s: np.ndarray
    u: np.ndarray  # displacements (m), (states, beads)
    v: np.ndarray  # velocities (m/s), (states, beads)

    def __len__(self):
        return len(self.step)


class Reader:
    """The states of a file, one after the other; `manifest` is known at once, `end` after the last one."""

    def __init__(self, file):
        self._records = StreamReader(file, emit_chunks=True, record_size_limit=LARGEST_CHUNK).records
        self.end = None
        try:
            header, run = next(self._records), next(self._records)
        except (McapError, StopIteration) as error:
            why = str(error) or "it ends before its manifest"
            raise ValueError(f"this is no recording of Beadline: {why}") from None
        if not isinstance(header, Header) or header.profile != "beadline" or not isinstance(run, Metadata):
            raise ValueError("this is no recording of Beadline")
        version = run.metadata["schema_version"]
        if version.split(".")[0] != "1":
            raise ValueError(f"the recording has schema version {version}, this program reads 1.x")
        self.manifest = {part: json.loads(run.metadata[part]) for part in ("physics", "provenance")}

    def __iter__(self):
        channels = set()  # those of /state
        try:
            for record in self._records:
                if isinstance(record, Chunk):
                    yield from states_in(unpack(record), channels)
                elif isinstance(record, Metadata) and record.name == "beadline.end":
                    self.end = record.metadata["reason"]
        except EndOfFile:
            self.end = None  # it is being written, or was cut short
        except McapError as error:
            raise ValueError(f"the recording is damaged: {error}; see `beadline recover`") from error


def states_in(chunk, channels):
    """The states in the records of a chunk; `channels` collects the numbers of the channels of states."""
    at = 0
    while at < len(chunk):
        opcode, length = RECORD_HEAD.unpack_from(chunk, at)
        at += RECORD_HEAD.size
        if opcode == CHANNEL:
            channel, _schema, letters = struct.unpack_from("<HHI", chunk, at)
            if chunk[at + 8 : at + 8 + letters] == b"/state":
                channels.add(channel)
        elif opcode == MESSAGE and MESSAGE_HEAD.unpack_from(chunk, at)[0] in channels:
            yield state_of(chunk, at + MESSAGE_HEAD.size, at + length)
        at += length


def unpack(chunk):
    """The records of a chunk, as bytes, after their checksum."""
    data = chunk.data
    if chunk.compression:
        if chunk.compression != "zstd" or chunk.uncompressed_size > LARGEST_CHUNK:
            raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes, compressed with {chunk.compression}")
        try:
            data = zstandard.decompress(data, chunk.uncompressed_size)
        except zstandard.ZstdError as error:
            raise ValueError(f"a chunk is damaged: {error}; see `beadline recover`") from error
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a chunk is damaged: its checksum is wrong; see `beadline recover`")
    return data


def varint(data, at):
    """A number of protobuf at `at`, and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at


def state_of(data, at, end):
    """The `ChainState` between `at` and `end`. Its doubles lie in one piece, so that an array can point to them."""
    fields = {}
    while at < end:
        tag = data[at]
        tag, at = (tag, at + 1) if tag < 0x80 else varint(data, at)
        kind = tag & 7
        if kind == 0:
            fields[tag >> 3], at = varint(data, at)
        elif kind == 1:
            (fields[tag >> 3],) = struct.unpack_from("<d", data, at)
            at += 8
        elif kind == 2:
            length, at = varint(data, at)
            fields[tag >> 3] = np.frombuffer(data, "<f8", length // 8, at)
            at += length
        else:
            raise ValueError(f"a field of kind {kind} in a state")
    return State(
        fields.get(FRAME), fields.get(STEP, 0), fields.get(TIME, 0.0),
        fields.get(DISPLACEMENT, EMPTY), fields.get(VELOCITY, EMPTY), fields.get(EXTRA, EMPTY),
    )  # fmt: skip


def states(path):
    """The states of the recording `path`, one after the other, in memory of one chunk."""
    with open(path, "rb") as file:
        yield from Reader(file)


def read(path, beads=slice(None)):
    """The recording `path`, or some of its beads (a number, a slice, a list). An unfinished one, too."""
    with open(path, "rb") as file:
        reader = Reader(file)
        physics, provenance = reader.manifest["physics"], reader.manifest["provenance"]
        # as many as there should be; memory that is not written to costs nothing
        room = physics["step_count"] // provenance["record_every_steps"] + 2
        width = np.empty(physics["beads"])[beads].size
        u, v = np.empty((room, width)), np.empty((room, width))
        steps, times = [], []
        for row, state in enumerate(reader):
            if row == len(u):  # states between frames
                u, v = (np.concatenate((array, np.empty_like(array))) for array in (u, v))
            u[row], v[row] = state.u[beads], state.v[beads]
            steps.append(state.step)
            times.append(state.time_s)
        count = len(steps)
        return Recording(reader.manifest, reader.end, np.array(steps), np.array(times), u[:count], v[:count])


def main(path):
    start = time.perf_counter()
    run = read(path)
    seconds = time.perf_counter() - start
    megabytes = (run.u.nbytes + run.v.nbytes) / 1e6
    name = run.manifest["provenance"]["name"]
    print(f"{name}: {run.u.shape[0]} states of {run.u.shape[1]} beads, {run.end or 'unfinished'}")
    print(f"{megabytes:.0f} MB in {seconds:.2f} s: {megabytes / seconds:.0f} MB/s")


if __name__ == "__main__":
    main(*sys.argv[1:])
