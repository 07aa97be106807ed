"""Recomputes Beadline recordings with nothing but docs/KERNEL.md (the arithmetic of a step) and docs/FORMAT.md.

    python kernel.py RUN.mcap ...               every recorded state from the one before, and its energies, bit for bit
    python kernel.py --page docs/KERNEL.md      the test vectors of that page
    python kernel.py --hash ALPHA               FNV-1a (64 bits) of the whole table of an exponent, H and L in turn

Needs Python 3.9 and the packages `numpy` and `mcap`. Prints `FILE: N states, equal`; or the first number that differs,
by step, bead and quantity, the file's and ours. Exit code 0 if all bits agree, 1 if one differs, 2 if a file is
damaged or no recording, 3 if it is of another kernel version.

How it is made: `Power` is δ^α, `Chain` the forces, the three methods, the start of gear5 and the energies, in the order and with
the symbols of the page. A state is an array with a row for each of u, v, (q2, q3, q4, q5, (W)) and a column for each
bead. NumPy's + - * / and sqrt round once, as the page wants it, its sums do not: `np.sum` is not used. Walls are contacts
number 0 and N, with a bead beyond that never moves; an end without a wall has one with a gap of infinite width.
"""

import hashlib
import json
import math
import re
import struct
import sys
from decimal import Decimal, localcontext

import numpy as np

VERSION = 2
ROWS = ["u", "v", "q2", "q3", "q4", "q5", "W"]
np.seterr(all="ignore")


class Wrong(Exception):
    """What a file may not be."""


class OtherKernel(Exception):
    """A recording that is not of this kernel."""


class Differs(Exception):
    """A number that is not ours."""


# The force law


def line(x):
    return math.ldexp(1 + (x - math.floor(x)), math.floor(x))


def bits(x):
    return struct.unpack("<Q", struct.pack("<d", x))[0]


def double(number):
    return struct.unpack("<d", struct.pack("<Q", number))[0]


class Power:
    """P(x), x^α for an array x, and +0 where x is not larger than z."""

    FORMULA = {1: lambda x: x, 1.5: lambda x: x * np.sqrt(x), 2: lambda x: x * x, 3: lambda x: x * x * x}
    FORMULA[5] = lambda x: (x * x) * (x * x) * x

    def __init__(self, alpha):
        self.alpha, self.formula = alpha, self.FORMULA.get(alpha)
        w = 900 / (alpha + 1)
        self.z = line(-w)
        if self.formula:
            return
        self.b = 7 if alpha <= 5 else next(b for b in range(9, 99) if alpha <= 2.0 ** (b - 6))
        self.s = 52 - self.b
        self.z = double(bits(self.z) | (1 << self.s) - 1)
        self.top = line(w)
        self.first = (bits(self.z) >> self.s) + 1
        self.last = bits(self.top) >> self.s
        # H and L of the intervals from `first` to `last`; NaN until an interval is needed
        self.high, self.low = np.full((2, self.last - self.first + 1), np.nan)
        self.roots = {}, {}
        g = [0, alpha]
        for j in range(2, 6):
            g.append(g[j - 1] * (alpha - (j - 1)) / j)
        e = g[5] * (alpha - 5) / 6
        q = 2.0 ** (-2 * (self.b + 1))
        g[4] += 1.5 * q * e
        g[2] -= 0.5625 * (q * q) * e
        self.g = g

    def __call__(self, x):
        beyond = x > self.z
        if self.formula:
            return np.where(beyond, self.formula(x), 0.0)
        power = np.where(beyond, np.inf, 0.0)
        inside = np.flatnonzero(beyond & (x < self.top))
        x = x[inside].view(np.uint64)
        interval = (x >> np.uint64(self.s)).astype(np.int64) - self.first
        self.fill(interval)
        one, fraction = np.uint64(0x3FF << 52), np.uint64((1 << 52) - 1)
        mantissa = x & fraction | one
        centre = mantissa >> np.uint64(self.s) << np.uint64(self.s) | np.uint64(1 << self.s - 1)
        mantissa, centre = mantissa.view(np.float64), centre.view(np.float64)
        r = (mantissa - centre) / centre
        g = self.g
        series = (((g[5] * r + g[4]) * r + g[3]) * r + g[2]) * r + g[1]
        high, low = self.high[interval], self.low[interval]
        power[inside] = high + (high * (series * r) + low)
        return power

    def fill(self, interval):
        for i in np.unique(interval[np.isnan(self.high[interval])]):
            self.high[i], self.low[i] = self.entry(self.first + int(i))

    def entry(self, number):
        """H and L of an interval: c^α to 90 binary digits, as C^α·2^(α·exponent) in integers."""
        exponent, digits = divmod(number, 1 << self.b)
        over, under = self.alpha.as_integer_ratio()
        whole, rest = divmod(over * (exponent - 1023), under)
        roots, twos = self.roots
        with localcontext() as context:
            context.prec = 80
            if digits not in roots:
                c = 1 + Decimal(2 * digits + 1) / (2 << self.b)
                roots[digits] = int((Decimal(self.alpha) * c.ln()).exp() * (1 << 200))
            if rest not in twos:
                twos[rest] = int((Decimal(rest) / under * Decimal(2).ln()).exp() * (1 << 200))
        product = roots[digits] * twos[rest]
        surplus = product.bit_length() - 90
        product = (product + (1 << surplus - 1)) >> surplus
        high = float(product)  # Python rounds integers to the nearest double, ties to even
        scale = surplus + whole - 400
        return math.ldexp(high, scale), math.ldexp(float(product - int(high)), scale)

    def hash(self):
        self.fill(np.arange(len(self.high)))
        value = 0xCBF29CE484222325
        for number in np.stack([self.high, self.low], axis=1).ravel().view(np.uint64).tolist():
            value = (value ^ number) * 0x100000001B3 & (1 << 64) - 1
        return f"{value:016x}"


# The chain


def approach(x):
    """By how much more each bead, and the left wall, has moved than the next one."""
    x = np.concatenate(([0.0], x, [0.0]))
    return x[:-1] - x[1:]


def net(force):
    return force[:-1] - force[1:]


def total(terms):
    """The sum of the page, in eight parts."""
    parts = np.zeros((-(-len(terms) // 8) + 1, 8))  # a row of zeros to begin with; those at the end change nothing
    parts.ravel()[8 : 8 + len(terms)] = terms
    s = np.cumsum(parts, axis=0)[-1]
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]))


class Chain:
    """`physics` and the numbers of `/chain`: m, and k, rho, R, eta between beads and of either wall (or None)."""

    def __init__(self, physics, m, between, left, right):
        self.alpha, self.dt, self.method = float(physics["alpha"]), float(physics["dt_s"]), physics["method"]
        self.restitution = "restitution" in (physics.get("damping") or ())
        self.damped = bool(physics.get("damping"))
        self.striker = physics["striker"]["bead"], float(physics["striker"]["velocity_m_s"])
        self.power, self.m, self.loaded = Power(self.alpha), m, bool(np.any(between[1]))
        none = [0.0, -np.inf, 0.0, 0.0]
        ends = [[none if wall is None else wall] for wall in (left, right)]
        self.k, self.rho, self.R, self.eta = np.concatenate((np.transpose(ends[0]), between, np.transpose(ends[1])), axis=1)
        self.walls = [wall is not None for wall in (left, right)]
        self.rows = (6 if self.method == "gear5" else 2) + self.damped
        self.kicks, self.drifts = [0.5, 0.5], [1.0]
        if self.method == "rkn4":
            a = [double(x) for x in (0x3FCF65F4CB6CB771, 0x3FE35B1DEBAF2655, 0xBFD669363D14A862)]
            b = [double(x) for x in (0x3FB53E774FA406BE, 0x3FD95D23C9214375, 0xBFA3FF3020B02CB4, 0x3FBE9923385E0390)]
            self.kicks, self.drifts = b + b[2::-1], a + a[::-1]

    def step(self, state):
        return self.gear5(state) if self.method == "gear5" else self.kick_and_drift(state)

    def kick_and_drift(self, state):
        u, v = state
        for i, b in enumerate(self.kicks):
            if i:
                u = u + self.drifts[i - 1] * self.dt * v
            v = v + (b * self.dt * (1 / self.m)) * net(self.k * self.power(approach(u) + self.rho) - self.R)
        return np.array([u, v])

    def contacts(self, u, rate):
        """E, f, D and where the contacts are closed."""
        d = approach(u) + self.rho
        p = self.power(d)
        elastic = self.k * p
        closed = d > self.power.z
        f = np.sqrt(p / d) if self.restitution else np.ones_like(d)
        force = elastic
        if self.damped:
            force = elastic + self.eta * f * rate
            force = np.where(closed & (force > 0), force, 0.0)
        return p, elastic, f, force, closed

    def gear5(self, state):
        u, v, q2, q3, q4, q5 = state[:6]
        dt = self.dt
        u_p = u + (dt * v + (((q5 + q4) + q3) + q2))
        v_p = v + (1 / dt) * (2 * q2 + (3 * q3 + (4 * q4 + 5 * q5)))
        force = self.contacts(u_p, approach(v_p))[3]
        x = (0.5 * (dt * dt) * (1 / self.m)) * net(force - self.R)
        y = x - ((3 * q3 + (6 * q4 + 10 * q5)) + q2)
        u = u_p + 3 / 20 * y
        v = v_p + (251 / 360 / dt) * y
        q3, q4, q5 = ((4 * q4 + 10 * q5) + q3) + 11 / 18 * y, (5 * q5 + q4) + 1 / 6 * y, q5 + 1 / 60 * y
        q3, q4, q5 = (np.where(abs(q) <= 2.0**-900, 0.0, q) for q in (q3, q4, q5))
        q2 = x
        if not self.damped:
            return np.array([u, v, q2, q3, q4, q5])
        work = state[6].copy()
        for s in double(0xBFE93CD3A2C8198E), double(0xBFCB0CB174DF99C7):
            u_s = (s * s) * (((q5 * s + q4) * s + q3) * s + q2) + (s * dt * v + u)
            v_s = (s / dt) * (((5 * q5 * s + 4 * q4) * s + 3 * q3) * s + 2 * q2) + v
            rate = approach(v_s)
            _, elastic, _, force, closed = self.contacts(u_s, rate)
            power = np.where(closed, (force - elastic) * rate, 0.0)
            work[:-1] += 0.5 * dt * power[1:-1]
            work[-1] += 0.5 * dt * (power[0] + power[-1])
        return np.array([u, v, q2, q3, q4, q5, work])

    def start(self):
        """The state at step 0."""
        state = np.zeros((self.rows, len(self.m)))
        state[1, self.striker[0]] = self.striker[1]
        if self.method != "gear5":
            return state
        q = [state[0], state[1] * self.dt]
        d = [approach(q[0]) + self.rho, approach(q[1])]
        p0, elastic, f, force, _ = self.contacts(q[0], d[1] / self.dt)
        force0 = np.where(elastic > 0, force, 0.0)
        P, G = [p0], [f]
        slope = 0.5 * (self.alpha - 1) if self.restitution else 0.0

        def following(a, A, j):
            s = 0.0
            for i in range(1, j + 1):
                s = s + (i * a - (j - i)) * d[i] * A[j - i]
            return s / (j * d[0])

        for j in range(4):
            if j == 0:
                force = force0 - self.R
            else:
                P.append(following(self.alpha, P, j))
                G.append(following(slope, G, j))
                force = self.k * P[j]
                for i in range(j + 1):
                    force = force + self.eta * G[i] * ((j - i + 1) * d[j - i + 1] / self.dt)
                force = np.where((force0 == 0) | (abs(d[1]) >= d[0]), 0.0, force)
            q.append((self.dt * self.dt / ((j + 1) * (j + 2)) / self.m) * net(force))
            d.append(approach(q[-1]))
        state[2:6] = q[2:]
        return state

    def energies(self, state):
        """Kinetic and potential energy, and dissipated work."""
        u, v = state[:2]
        alpha, a = self.alpha, approach(u)

        def elastic(d):
            return np.where(d > self.power.z, self.k * self.power(d) * d / (alpha + 1), 0.0)

        at = elastic(a + self.rho)
        x = a / self.rho
        e = [0.5 * alpha]
        for n in range(1, 8):
            e.append(e[n - 1] * (alpha - n) / (n + 2))
        series = 0.0
        for coefficient in reversed(e):
            series = series * x + coefficient
        near = abs(x) <= 1 / (16 * (alpha + 1))
        excess = np.where(near, self.R * a * x * series, (at - elastic(self.rho)) - self.R * a)
        left, right = (excess[end] if wall else 0.0 for end, wall in zip((0, -1), self.walls))
        potential = total((excess if self.loaded else at)[1:-1]) + (left + right)
        work = total(state[6]) if self.damped else 0.0
        return total(0.5 * self.m * (v * v)), potential, work


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


def read_chain(physics, body):
    m, k, rho, rest, eta = doubles(body, 1, 2, 3, 5, 8)
    walls = {number: [one_double(value, i) for i in (1, 2, 3, 4)] for number, value in fields(body) if number in (6, 7)}
    eta = eta if len(eta) else np.zeros(len(k))
    if len(m) != physics["beads"] or any(len(x) != len(m) - 1 for x in (k, rho, rest, eta)):
        raise Wrong("the length of an array of /chain")
    return Chain(physics, m, np.array([k, rho, rest, eta]), walls.get(6), walls.get(7))


def compare(step, found, ours):
    """The first bead and quantity that differ."""
    wrong = np.argwhere((found.view(np.uint64) != ours.view(np.uint64)).T)
    if len(wrong):
        bead, row = wrong[0]
        name = ROWS[row] if found.shape[0] != 3 else "uvW"[row]
        differ(f"step {step}, bead {bead}, {name}", found[row, bead], ours[row, bead])


def differ(where, found, ours):
    raise Differs(f"{where}: {float(found)!r} ({bits(found):016x}), but we get {float(ours)!r} ({bits(ours):016x})")


def check(path):
    """Checks a recording and says what was found."""
    topics, physics, chain, state, step, first, count, unfinished = {}, None, None, None, None, None, 0, False
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
            if physics["kernel_version"] != VERSION:
                raise OtherKernel(f"of kernel version {physics['kernel_version']}, this is {VERSION}")
        elif kind == "Channel":
            topics[record.id] = record.topic
        elif kind == "Message" and topics[record.channel_id] == "/chain":
            chain = read_chain(physics, record.data)
        elif kind == "Message" and topics[record.channel_id] == "/state":
            number = dict(fields(record.data)).get(2, 0)
            found = np.concatenate(doubles(record.data, 4, 5, 6))
            if len(found) != chain.rows * len(chain.m):
                raise Wrong(f"the length of the state at step {number}")
            found = found.reshape(chain.rows, -1)
            if step is None:
                first, ours = number, found if number else chain.start()
            elif number <= step:
                raise Wrong(f"step {number} after step {step}")
            else:
                ours = state
                for _ in range(number - step):
                    ours = chain.step(ours)
            compare(number, found, ours)
            state, step, count = ours, number, count + 1
        elif kind == "Message" and topics[record.channel_id] == "/summary":
            if dict(fields(record.data)).get(2, 0) != step:
                continue  # of a state that is not there
            names = {"kinetic_j": 4, "potential_j": 5, "dissipated_j": 10}
            for (name, field), ours in zip(names.items(), chain.energies(state)):
                found = one_double(record.data, field)
                if bits(found) != bits(ours):
                    differ(f"step {step}, {name}", found, ours)
    if physics is None:
        raise Wrong("no recording of Beadline")
    begins = f", from step {first} on, which is believed" if first else ""
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
        walls = [array(vector[name]) if vector[name] else None for name in ("left_wall", "right_wall")]
        chain = Chain(vector, array(vector["m"]), between, *walls)
        for step, state in enumerate(vector["states"]):
            ours = chain.step(ours) if step else chain.start()
            compare(step, np.array([array(row) for row in state]), ours)
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
