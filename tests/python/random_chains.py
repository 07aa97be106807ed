"""Random numbers, orders, disorder and thermal velocities of docs/CONFIGURATION.md, with the functions of docs/KERNEL.md.

    python random_chains.py docs/CONFIGURATION.md      the values that the page gives, compared bit for bit
"""

import json
import math
import re
import struct
import sys

from waveforms import doubles_of, exp, series, sincos

MASK = 0xFFFFFFFF
THERMAL = MASK
LOGARITHM = [2 / (2 * j + 1) for j in range(1, 12)]
ROOT_2, H, L = doubles_of("3ff6a09e667f3bcd 3fe62e42fee00000 3dea39ef35793c76")


def words(seed, stream, index, second=0):
    k0, k1 = seed & MASK, seed >> 32
    c0, c1, c2, c3 = index & MASK, index >> 32, stream, second
    for _ in range(10):
        p, q = 0xD2511F53 * c0, 0xCD9E8D57 * c2
        c0, c1, c2, c3 = q >> 32 ^ c1 ^ k0, q & MASK, p >> 32 ^ c3 ^ k1, p & MASK
        k0, k1 = k0 + 0x9E3779B9 & MASK, k1 + 0xBB67AE85 & MASK
    return [c0, c1, c2, c3]


def bits(high, low):
    return (high >> 5 << 26) + (low >> 6)


def uniform(seed, stream, index):
    w = words(seed, stream, index)
    return bits(w[0], w[1]) / 2**53


def ln(x):
    m, n = math.frexp(x)
    m, n = 2 * m, n - 1
    if m > ROOT_2:
        m, n = 0.5 * m, n + 1
    f = m - 1
    s = f / (2 + f)
    z, h = s * s, (0.5 * f) * f
    r = s * (h + z * series(LOGARITHM, z)) + n * L
    return n * H - ((h - r) - f)


def normals(w):
    """The normal number of four words, and the one with the sine in place of the cosine."""
    a, b = (bits(w[0], w[1]) + 1) / 2**53, bits(w[2], w[3]) / 2**53
    sin, cos = sincos(b, 0.0)
    root = math.sqrt(0.0 - 2 * ln(a))
    return root * cos, root * sin


def normal(seed, stream, index):
    return normals(words(seed, stream, index))[0]


def order(seed, stream, count):
    o = list(range(count))
    for i in range(count - 1, 0, -1):
        j = math.floor((i + 1) * uniform(seed, stream, i))
        o[i], o[j] = o[j], o[i]
    return o


def disordered(seed, stream, values, entry):
    """The values that an entry of [[disorder]] makes of these."""
    if entry.get("permuted"):
        return [values[j] for j in order(seed, stream, len(values))]

    def factor(i):
        if "uniform" in entry:
            return 1 + entry["uniform"] * (2 * uniform(seed, stream, i) - 1)
        if "normal" in entry:
            return 1 + entry["normal"] * normal(seed, stream, i)
        if "log_normal" in entry:
            return exp(entry["log_normal"] * normal(seed, stream, i))
        two = entry["two_valued"]
        return two["factor"] if uniform(seed, stream, i) < two["fraction"] else 1.0

    return [value * factor(i) for i, value in enumerate(values)]


def thermal(seed, masses, mean_j):
    v = [normal(seed, THERMAL, i) * math.sqrt(2 * mean_j / m) for i, m in enumerate(masses)]
    momentum = mass = 0.0
    for m, speed in zip(masses, v):
        momentum, mass = momentum + speed * m, mass + m
    return [speed - momentum / mass for speed in v]


def shown(x):
    return struct.pack(">d", x).hex()


def found(row):
    """What a row of the page says, computed anew."""
    kind, seed, stream, at = row["of"], row["seed"], row.get("stream"), row.get("index")
    if kind == "words":
        return [f"{w:08x}" for w in words(seed, stream, at)]
    if kind in ("uniform", "normal"):
        return shown({"uniform": uniform, "normal": normal}[kind](seed, stream, at))
    if kind == "order":
        return order(seed, stream, row["count"])
    masses = [row["bead_mass_kg"]] * row["beads"]
    for stream, entry in enumerate(row.get("disorder", [])):
        masses = disordered(seed, stream, masses, entry)
    if kind == "masses":
        return [shown(m) for m in masses]
    return [shown(v) for v in thermal(seed, masses, row["energy_j"])]


def main(page):
    with open(page, encoding="utf-8") as file:
        rows = json.loads(re.search(r"```json random\n(.*?)```", file.read(), re.S)[1])
    wrong = [f"{row}: found {found(row)}" for row in rows if found(row) != row["value"]]
    print("\n".join(wrong) or f"{len(rows)} values, equal")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
