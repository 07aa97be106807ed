"""Writes functions.csv: sines, cosines, exponentials and logarithms, exact to far beyond a double (pip install mpmath).

Columns: the function, the bits of its arguments, the bits of the double next to its value, and the distance of the value from
that double in units in its last place. Arguments:

    sine, cosine    step n, dt (s), time after it s (s), frequency f (Hz), phase p (rad): of 2 pi f (n dt + s) + p
    turns_sine, turns_cosine    x, y: of 2 pi (x + y)
    exp, expm1, ln  x
"""

import random
import struct
import sys

import mpmath

mpmath.mp.prec = 500
mpf = mpmath.mpf


def bits(x):
    return struct.unpack("<Q", struct.pack("<d", x))[0]


def double(b):
    return struct.unpack("<d", struct.pack("<Q", b))[0]


def waves(rng):
    steps = [0, 1, 2, 1000, 10**6, 10**9, 10**9 + 7, 10**12 + 1, 2**40 + 3, 2**52 - 1, 2**52]
    for step in steps:
        for _ in range(18):
            dt = rng.choice([1e-7, 0.1, 1.4495593273553903e-6, 10.0 ** rng.uniform(-9, -2)])
            # awkward ones: no period has a whole number of steps
            f = rng.choice([1 / 3, 0.1, 6300.0, 44100.1, 10.0 ** rng.uniform(-3, 6)])
            f = min(f, 0.05 / dt)
            after = rng.choice([0.0, dt * rng.random()])
            phase = rng.choice([0.0, 1.0, -3.0, rng.uniform(-7, 7)])
            yield float(step), dt, after, f, phase


def turns(rng):
    for eighths in range(-8, 9):
        yield eighths / 8, 0.0
        for _ in range(6):
            # near zeros and where the reduction changes
            yield eighths / 8 + rng.uniform(-1, 1) * 10.0 ** rng.uniform(-17, -3), rng.uniform(-1, 1) * 2.0**-55
    for _ in range(150):
        yield rng.uniform(-0.5, 0.5), rng.uniform(-1, 1) * 2.0**-55
    for _ in range(40):
        yield rng.choice([-1, 1]) * 10.0 ** rng.uniform(-200, -3), 0.0


def exponents(rng):
    for _ in range(120):
        yield rng.uniform(-700, 700)
        yield rng.uniform(-2, 2)
        yield rng.choice([-1, 1]) * 10.0 ** rng.uniform(-200, 0)


def positives(rng):
    for _ in range(120):
        yield 10.0 ** rng.uniform(-307, 308)
        yield rng.uniform(0.5, 2.0)
        yield 1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-15.5, -0.5)


def rows():
    rng = random.Random(1)
    for arguments in waves(rng):
        n, dt, s, f, p = map(mpf, arguments)
        angle = 2 * mpmath.pi * f * (n * dt + s) + p
        yield "sine", arguments, mpmath.sin(angle)
        yield "cosine", arguments, mpmath.cos(angle)
    for x, y in turns(rng):
        angle = 2 * mpmath.pi * (mpf(x) + mpf(y))
        yield "turns_sine", (x, y), mpmath.sin(angle)
        yield "turns_cosine", (x, y), mpmath.cos(angle)
    for x in exponents(rng):
        yield "exp", (x,), mpmath.exp(mpf(x))
        yield "expm1", (x,), mpmath.expm1(mpf(x))
    for x in positives(rng):
        yield "ln", (x,), mpmath.log(mpf(x))


def main():
    out = sys.stdout
    out.write("function,arguments,value_bits,remainder_ulp\n")
    for function, arguments, exact in rows():
        nearest = float(exact)
        # exact zeros, of sines of whole quarters, come out as noise far below any double's rounding
        if abs(nearest) < 1e-100 and (nearest == 0.0 or function in ("sine", "cosine") or arguments[-1:] == (0.0,)):
            if abs(arguments[0]) * 8 == int(abs(arguments[0]) * 8):
                nearest, exact = 0.0, mpf(0)
        ulp = double(bits(abs(nearest)) + 1) - abs(nearest)
        remainder = float((exact - mpf(nearest)) / mpf(ulp))
        written = " ".join(f"{bits(x):016x}" for x in arguments)
        out.write(f"{function},{written},{bits(nearest):016x},{remainder:.4f}\n")


main()
