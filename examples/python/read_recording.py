"""Reads a recording into numpy: `python read_recording.py run.mcap`, or in a program of your own

    from read_recording import read, states

    run = read("run.mcap")              # all states: run.u and run.v have the shape (states, beads)
    for state in states("run.mcap"):    # one after the other, for recordings larger than the memory
        print(state.step, state.v.max())
    chain("run.mcap").mass              # the chain as the dynamics was computed with
    read("run.mcap", from_s=0.02, until_s=0.03)     # some time: only this part of a finished file is read

Needs `pip install mcap numpy`. docs/python/7-without-the-package.md says how to use it; docs/FORMAT.md describes every byte. Copy this file
into a project of your own as it is.
"""

import hashlib
import io
import json
import math
import struct
import sys
import time
import zlib
from dataclasses import dataclass
from typing import NamedTuple, Optional, Tuple

import numpy as np
import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Chunk, ChunkIndex, Header, Metadata, MetadataIndex
from mcap.stream_reader import StreamReader

CHANNEL, MESSAGE = 0x04, 0x05
RECORD_HEAD, MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<HIQQ")
FOOTER, MAGIC = struct.Struct("<BQQQI8s"), b"\x89MCAP0\r\n"
CRC_AND_MAGIC = 12  # bytes at the end of a file that the summary's checksum does not cover
LARGEST_CHUNK = 1 << 30
FRAME, STEP, TIME, DISPLACEMENT, VELOCITY, EXTRA = range(1, 7)  # fields of beadline.v1.ChainState
MASS, STIFFNESS, REST_OVERLAP, _ALPHA, REST_FORCE, LEFT_WALL, RIGHT_WALL, DAMPING = range(1, 9)  # of beadline.v1.Chain
TERMS, ON_SITE, ON_SITE_CUBIC, DRAG, RESONATOR_MASS, RESONATOR_STIFFNESS, RING = range(10, 17)
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


class Wall(NamedTuple):
    """The contact of an end of the chain with its wall; all 0 at a free end."""

    stiffness: float
    rest_overlap: float
    rest_force: float
    damping: float


class Term(NamedTuple):
    """A further term of the force of each contact; docs/KERNEL.md has the kinds."""

    kind: str  # "power" of an exponent, "spring" of overlap, its square or cube, "toda"
    parameter: float
    stiffness: np.ndarray  # of each contact, N - 1; 0 of one without this term
    left_wall: float
    right_wall: float
    ring: float


class Chain(NamedTuple):
    """The resolved chain: what the dynamics is computed with. What most chains do not have is empty at its end."""

    mass: np.ndarray  # of each bead (kg), N
    stiffness: np.ndarray  # of each contact (N/m^alpha), N - 1, as all that follow
    rest_overlap: np.ndarray  # (m)
    rest_force: np.ndarray  # (N)
    damping: np.ndarray  # 0 without damping
    left_wall: Wall
    right_wall: Wall
    terms: Tuple[Term, ...] = ()
    ring: Optional[Wall] = None  # the contact of the last bead with bead 0
    on_site: np.ndarray = EMPTY  # springs of beads (N/m), N, as all that follow
    on_site_cubic: np.ndarray = EMPTY  # (N/m^3)
    drag: np.ndarray = EMPTY  # (N s/m)
    resonator_mass: np.ndarray = EMPTY  # (kg)
    resonator_stiffness: np.ndarray = EMPTY  # (N/m)


@dataclass(slots=True, eq=False)
class Recording:
    """All states of a recording, or those of some time; `len` says how many."""

    manifest: dict  # `physics` and `provenance`, see docs/FORMAT.md
    end: Optional[str]  # how it ended; None of a file that was not finished
    step: np.ndarray  # of each state
    time_s: np.ndarray
    u: np.ndarray  # displacements (m), (states, beads)
    v: np.ndarray  # velocities (m/s), (states, beads)
    chain: Optional[Chain]  # None of a file without one: a map of contacts, or one that was cut short before

    def __len__(self):
        return len(self.step)


class Reader:
    """The states of a file, one after the other; `manifest` is known at once, `chain` with the first state, `end` after the
    last one."""

    def __init__(self, file, from_s=0.0, until_s=math.inf):
        self._records = records_of(file)
        self._from_s, self._until_s = from_s, until_s
        self.chain = self.end = None
        try:
            header, run = next(self._records), next(self._records)
        except (McapError, StopIteration) as error:
            why = str(error) or "it ends before its manifest"
            raise ValueError(f"this is no recording of Beadline: {why}") from None
        if not isinstance(header, Header) or header.profile != "beadline" or not isinstance(run, Metadata):
            raise ValueError("this is no recording of Beadline")
        version, *texts = (run.metadata.get(key, "") for key in ("schema_version", "physics", "provenance"))
        if version.split(".")[0] != "1":
            raise ValueError(f"the recording has schema version {version}, this program reads 1.x")
        told = "\n".join(("beadline.run", version, *texts, ""))
        if hashlib.sha256(told.encode()).hexdigest() != run.metadata.get("checksum"):
            raise ValueError("the recording is damaged: the checksum of its manifest is wrong")
        self.manifest = dict(zip(("physics", "provenance"), map(json.loads, texts)))
        if from_s > 0 or until_s < math.inf:
            place = file.tell()
            if summary := summary_of(file):
                self._records = records_between(file, summary, from_s, until_s)
            else:
                file.seek(place)

    def __iter__(self):
        topics = {}  # of the channels, by their numbers
        try:
            for record in self._records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic.encode()
                elif isinstance(record, Chunk):
                    for topic, message in messages_in(unpack(record), topics):
                        if topic == b"/chain":
                            self.chain = chain_of(message, self.manifest["physics"]["beads"])
                        elif topic == b"/state":
                            state = state_of(message)
                            if self._from_s <= state.time_s <= self._until_s:
                                yield state
                elif isinstance(record, Metadata) and record.name == "beadline.end":
                    self.end = record.metadata["reason"]
        except EndOfFile:
            self.end = None  # it is being written, or was cut short
        except McapError as error:
            raise ValueError(f"the recording is damaged: {error}; see `beadline recover`") from error


def records_of(file, skip_magic=False):
    """The records of a file from where it is; one that was cut short ends with `EndOfFile` wherever that is."""
    try:
        yield from StreamReader(file, skip_magic, emit_chunks=True, record_size_limit=LARGEST_CHUNK).records
    except struct.error:
        raise EndOfFile from None


def summary_of(file):
    """The records of the summary section, which say where chunks are; none if it is not there, or damaged."""
    size = file.seek(0, io.SEEK_END)
    file.seek(max(size - FOOTER.size, 0))
    footer = file.read()
    if len(footer) < FOOTER.size or not footer.endswith(MAGIC):
        return []
    _opcode, _length, start, _offsets, crc, _magic = FOOTER.unpack(footer)
    if not 0 < start < size:
        return []
    file.seek(start)
    section = file.read()
    if zlib.crc32(section[:-CRC_AND_MAGIC]) != crc:
        return []
    return list(records_of(io.BytesIO(section), skip_magic=True))


def records_between(file, summary, from_s, until_s):
    """The records that matter for a time: the channels, the chunks with the chain and with states, the end."""
    channels = [record for record in summary if isinstance(record, Channel)]
    yield from channels
    chains = {channel.id for channel in channels if channel.topic == "/chain"}
    chunks = [record for record in summary if isinstance(record, ChunkIndex)]
    for chunk in sorted(chunks, key=lambda chunk: chunk.chunk_start_offset):
        # times in files are whole nanoseconds
        is_between = chunk.message_end_time >= from_s * 1e9 - 1 and chunk.message_start_time <= until_s * 1e9 + 1
        if is_between or chains & chunk.message_index_offsets.keys():
            yield record_at(file, chunk.chunk_start_offset, Chunk)
    for metadata in summary:
        if isinstance(metadata, MetadataIndex) and metadata.name == "beadline.end":
            yield record_at(file, metadata.offset, Metadata)


def record_at(file, place, kind):
    """The record of this kind at a place that the summary section names."""
    file.seek(place)
    try:
        if isinstance(record := next(records_of(file, skip_magic=True)), kind):
            return record
    except McapError:
        pass
    raise ValueError(f"the recording is damaged at byte {place}; see `beadline recover`")


def messages_in(chunk, topics):
    """Topic and bytes of each message in the records of a chunk; `topics` collects those of the channels."""
    at = 0
    while at < len(chunk):
        opcode, length = RECORD_HEAD.unpack_from(chunk, at)
        at += RECORD_HEAD.size
        if opcode == CHANNEL:
            channel, _schema, letters = struct.unpack_from("<HHI", chunk, at)
            topics[channel] = bytes(chunk[at + 8 : at + 8 + letters])
        elif opcode == MESSAGE:
            yield topics.get(MESSAGE_HEAD.unpack_from(chunk, at)[0]), chunk[at + MESSAGE_HEAD.size : at + length]
        at += length


def unpack(chunk):
    """The records of a chunk, after their checksum."""
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
    return memoryview(data)


def varint(data, at):
    """A number of protobuf at `at`, and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at


def fields_of(data, many=None):
    """The fields of a message by their numbers: numbers, doubles, or the bytes of anything longer; of field `many` a list."""
    fields, at, end = {many: []}, 0, len(data)
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
            if tag >> 3 == many:
                fields[many].append(data[at : at + length])
            else:
                fields[tag >> 3] = data[at : at + length]
            at += length
        else:
            raise ValueError(f"a field of kind {kind} in a message")
    return fields


def doubles(fields, number):
    """The doubles of a field lie in one piece, so that an array can point to them."""
    return np.frombuffer(fields[number], "<f8") if number in fields else EMPTY


def state_of(message):
    """The `ChainState` of a message."""
    fields = fields_of(message)
    return State(
        fields.get(FRAME), fields.get(STEP, 0), fields.get(TIME, 0.0),
        doubles(fields, DISPLACEMENT), doubles(fields, VELOCITY), doubles(fields, EXTRA),
    )  # fmt: skip


def chain_of(message, beads):
    """The `Chain` of a message."""
    fields = fields_of(message, many=TERMS)
    arrays = (doubles(fields, number) for number in (MASS, STIFFNESS, REST_OVERLAP, REST_FORCE))
    damping = doubles(fields, DAMPING) if DAMPING in fields else np.zeros(beads - 1)
    walls = [fields_of(fields.get(number, b"")) for number in (LEFT_WALL, RIGHT_WALL, RING)]
    left, right, ring = (Wall(*(wall.get(number, 0.0) for number in range(1, 5))) for wall in walls)
    terms = tuple(map(term_of, fields[TERMS]))
    of_beads = (doubles(fields, number) for number in (ON_SITE, ON_SITE_CUBIC, DRAG, RESONATOR_MASS, RESONATOR_STIFFNESS))
    return Chain(*arrays, damping, left, right, terms, ring if RING in fields else None, *of_beads)


def term_of(message):
    """The `Term` of a message."""
    fields = fields_of(message)
    left, right, ring = (fields.get(number, 0.0) for number in (4, 5, 6))
    return Term(bytes(fields.get(1, b"")).decode(), fields.get(2, 0.0), doubles(fields, 3), left, right, ring)


def states(path, from_s=0.0, until_s=math.inf):
    """The states of the recording `path`, one after the other, in memory of one chunk; from one time (s) to another."""
    with open(path, "rb") as file:
        yield from Reader(file, from_s, until_s)


def chain(path):
    """The chain of the recording `path`."""
    with open(path, "rb") as file:
        reader = Reader(file)
        next(iter(reader), None)  # it is before the first state
        if reader.chain is None:
            raise ValueError("the recording has no chain")
        return reader.chain


def read(path, beads=slice(None), from_s=0.0, until_s=math.inf):
    """The recording `path`, or some of its beads (a number, a slice, a list), or some of its time (s). An unfinished one,
    too."""
    with open(path, "rb") as file:
        reader = Reader(file, from_s, until_s)
        physics, provenance = reader.manifest["physics"], reader.manifest["provenance"]
        # as many as there should be; memory that is not written to costs nothing
        steps = min(physics["step_count"], until_s / physics["dt_s"]) - max(0.0, from_s / physics["dt_s"])
        room = int(max(0.0, steps) / provenance["record_every_steps"]) + 2
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
        arrays = np.array(steps, int), np.array(times, float), u[:count], v[:count]
        return Recording(reader.manifest, reader.end, *arrays, reader.chain)


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
