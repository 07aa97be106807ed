"""Recomputes Beadline recordings with nothing but docs/KERNEL.md (the arithmetic of a step) and docs/FORMAT.md.

    python kernel.py RUN.mcap ...               every recorded state from the one before, and its energies, bit for bit
    python kernel.py --page docs/KERNEL.md      the test vectors of that page
    python kernel.py --hash ALPHA               FNV-1a (64 bits) of the whole table of an exponent, H and L in turn

Needs Python 3.9 and the packages `numpy` and `mcap`. Prints `FILE: N states, equal`; or the first number that differs,
by step, bead and quantity, the file's and ours. The first state of a later part, and an initial state that was given, are believed,
which is said. Exit code 0 if all bits agree, 1 if one differs, 2 if a file is damaged or no recording, 3 if it is of another
kernel version.

Here is what reads files and compares; the arithmetic is in chain.py, and that of drives in waveforms.py, beside this file.
"""

import hashlib
import json
import re
import struct
import sys

import numpy as np
from chain import Chain, Power, Wrong, bits

VERSIONS = 2, 3
DRIVEN = 11  # the field of /summary


class OtherKernel(Exception):
    """A recording that is not of this kernel."""


class Differs(Exception):
    """A number that is not ours."""


# Recordings


def fields(body):
    """The fields of a protobuf message: number and value, an integer or bytes."""

    def varint(at):
        value = shift = 0
        while True:
            value |= (body[at] & 0x7F) << shift
            at, shift = at + 1, shift + 7
            if body[at - 1] < 0x80:
                return value, at

    at = 0
    while at < len(body):
        tag, at = varint(at)
        value, length = None, {1: 8, 5: 4}.get(tag & 7)
        if tag & 7 == 0:
            value, at = varint(at)
        elif tag & 7 == 2:
            length, at = varint(at)
        elif length is None:
            raise Wrong(f"the wire type {tag & 7}")
        if value is None:
            value, at = body[at : at + length], at + length
            if at > len(body):
                raise Wrong("a message that is cut off")
        yield tag >> 3, value


def doubles(body, *numbers):
    """Arrays of doubles of a message, by the numbers of their fields (packed, or one by one)."""
    found = dict.fromkeys(numbers, b"")
    for number, value in fields(body):
        if number in found:
            found[number] += value
    return [np.frombuffer(found[number], "<f8") for number in numbers]


def one_double(body, number):
    return float(doubles(body, number)[0][-1]) if any(n == number for n, _ in fields(body)) else 0.0


def records(path):
    """The records of an MCAP file, CRCs checked, those of chunks one by one; None at the end if the file is unfinished."""
    from mcap.exceptions import EndOfFile
    from mcap.records import Chunk, DataEnd
    from mcap.stream_reader import StreamReader, breakup_chunk

    with open(path, "rb") as file:
        if file.read(8) != b"\x89MCAP0\r\n":
            raise Wrong("no MCAP file")
        file.seek(0)
        reader = iter(StreamReader(file, emit_chunks=True, validate_crcs=True).records)
        while True:
            try:
                record = next(reader)
            except (EndOfFile, struct.error):
                yield None
                return
            if isinstance(record, DataEnd):
                return
            yield from breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]


# further arrays of /chain, N numbers each or none
MORE = {11: "on_site", 12: "on_site_cubic", 13: "drag", 14: "resonator_mass", 15: "resonator_stiffness"}


def read_chain(physics, body):
    m, k, rho, rest, eta = doubles(body, 1, 2, 3, 5, 8)
    walls = {n: [one_double(value, i) for i in (1, 2, 3, 4)] for n, value in fields(body) if n in (6, 7, 16)}
    eta = eta if len(eta) else np.zeros(len(k))
    terms = [read_term(value) for number, value in fields(body) if number == 10]
    more = {name: array for name, array in zip(MORE.values(), doubles(body, *MORE)) if len(array)}
    wrong = any(len(x) != len(m) - 1 for x in (k, rho, rest, eta)) or any(len(x) != len(m) + 1 for _, _, x in terms)
    if len(m) != physics["beads"] or wrong or any(len(x) != len(m) for x in more.values()):
        raise Wrong("the length of an array of /chain")
    more["q"] = one_double(body, 17)
    return Chain(physics, m, np.array([k, rho, rest, eta]), walls.get(6), walls.get(7), walls.get(16), terms, more)


def read_term(body):
    """Kind, parameter, and the stiffness of every contact, both ends among them."""
    kind = next((bytes(value).decode() for number, value in fields(body) if number == 1), "")
    left, right, ring = (one_double(body, number) for number in (4, 5, 6))
    ends = (ring, ring) if ring else (left, right)
    return kind, one_double(body, 2), np.concatenate(([ends[0]], doubles(body, 3)[0], [ends[1]]))


def compare(step, found, ours, names):
    """The first bead and quantity that differ."""
    wrong = np.argwhere((found.view(np.uint64) != ours.view(np.uint64)).T)
    if len(wrong):
        bead, row = wrong[0]
        differ(f"step {step}, bead {bead}, {names[row]}", found[row, bead], ours[row, bead])


def differ(where, found, ours):
    raise Differs(f"{where}: {float(found)!r} ({bits(found):016x}), but we get {float(ours)!r} ({bits(ours):016x})")


def check(path):
    """Checks a recording and says what was found."""
    topics, physics, chain, state, step, first, count = {}, None, None, None, None, None, 0
    believed = unfinished = False
    for record in records(path):
        kind = type(record).__name__
        if record is None:
            unfinished = True
        elif kind == "Metadata" and record.name == "beadline.run":
            run = record.metadata
            parts = ["beadline.run", run["schema_version"], run["physics"], run["provenance"]]
            if hashlib.sha256("".join(part + "\n" for part in parts).encode()).hexdigest() != run["checksum"]:
                raise Wrong("the checksum of the manifest")
            physics = json.loads(run["physics"])
            if physics["kernel_version"] not in VERSIONS:
                raise OtherKernel(f"of kernel version {physics['kernel_version']}, this recomputes 2 and 3")
            if physics["method"] == "gear5" and physics.get("damping"):
                raise OtherKernel("of gear5 with damping, which no kernel computes any more")
        elif kind == "Channel":
            topics[record.id] = record.topic
        elif kind == "Message" and topics[record.channel_id] == "/chain":
            chain = read_chain(physics, record.data)
        elif kind == "Message" and topics[record.channel_id] == "/state":
            number = dict(fields(record.data)).get(2, 0)
            found = np.concatenate(doubles(record.data, 4, 5, 6))
            if len(found) != len(chain.names) * len(chain.m):
                raise Wrong(f"the length of the state at step {number}")
            found = found.reshape(len(chain.names), -1)
            if step is None:
                first, believed = number, bool(number) or chain.given
                ours = found if believed else chain.start()
            elif number <= step:
                raise Wrong(f"step {number} after step {step}")
            else:
                ours = state
                for n in range(step, number):
                    ours = chain.step(ours, n)
            compare(number, found, ours, chain.names)
            state, step, count = ours, number, count + 1
        elif kind == "Message" and topics[record.channel_id] == "/summary":
            if dict(fields(record.data)).get(2, 0) != step:
                continue  # of a state that is not there
            names = {"kinetic_j": 4, "potential_j": 5, "dissipated_j": 10, "driven_j": DRIVEN}
            for (name, field), ours in zip(names.items(), chain.energies(state)):
                found = one_double(record.data, field)
                if bits(found) != bits(ours):
                    differ(f"step {step}, {name}", found, ours)
    if physics is None:
        raise Wrong("no recording of Beadline")
    begins = f", from step {first} on, which is believed" if believed else ""
    return (f"{count} states, equal" if count else "no states") + begins + (", unfinished" if unfinished else "")


def check_page(path):
    """Checks the test vectors of the page: every number in them is the bits of a double."""
    with open(path, encoding="utf-8") as file:
        block = re.search(r"<!-- vectors -->\s*```json\n(.*?)```", file.read(), re.DOTALL)
    if not block:
        raise Wrong("no test vectors")

    def array(texts):
        return np.array([int(text, 16) for text in texts], dtype=np.uint64).view(np.float64)

    count = 0
    for vector in json.loads(block[1]):
        between = np.array([array(vector[name] or ["0"] * len(vector["k"])) for name in ("k", "rho", "R", "eta")])
        ends = [array(vector[name]) if vector.get(name) else None for name in ("left_wall", "right_wall", "ring")]
        terms = [(term["kind"], term["parameter"], array(term["k"])) for term in vector.get("terms", ())]
        more = {name: array(vector[name]) for name in MORE.values() if name in vector}
        more["q"] = vector.get("q")
        chain = Chain(vector, array(vector["m"]), between, *ends, terms, more)
        for step, state in enumerate(vector["states"]):
            ours = chain.step(ours, step - 1) if step else chain.start()
            compare(step, np.array([array(row) for row in state]), ours, chain.names)
            count += 1
    return f"{count} states, equal"


def main(arguments):
    if len(arguments) == 2 and arguments[0] == "--hash":
        power = Power(float(arguments[1]))
        print("no table" if power.formula else power.hash())
        return 0
    of_a_page, codes = arguments[0] == "--page", set()
    for path in arguments[of_a_page:]:
        try:
            print(f"{path}: {check_page(path) if of_a_page else check(path)}")
        except Differs as differs:
            print(f"{path}: DIFFERS at {differs}")
            codes.add(1)
        except OtherKernel as other:
            print(f"{path}: {other}")
            codes.add(3)
        except Exception as wrong:  # whatever the bytes of a file lead to
            print(f"{path}: WRONG: {wrong or type(wrong).__name__}", file=sys.stderr)
            codes.add(2)
    return min(codes, default=0)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1:]))
