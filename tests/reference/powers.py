"""Writes powers.csv: x^alpha for doubles x and alpha, exact to far beyond a double (pip install mpmath).

Columns: the bits of x and of alpha, the bits of the double next to x^alpha, and the distance of x^alpha from that
double in units in its last place (between -0.5 and 0.5). Results are normal doubles.
"""

import random
import struct
import sys

import mpmath

mpmath.mp.prec = 400
ALPHAS = [1.0, 1.004, 1.01, 1.1, 1.2, 1.3, 1.5, 1.7, 2.0, 2.5, 3.0, 5.0, 10.0, 37.5, 150.0]


def bits(x):
    return struct.unpack("<Q", struct.pack("<d", x))[0]


def double(b):
    return struct.unpack("<d", struct.pack("<Q", b))[0]


def samples(rng):
    for alpha in ALPHAS:
        # overlaps from far below an atom to a metre, beyond what any run needs at either end
        smallest = max(-300.0, -290.0 / alpha)
        for _ in range(90):
            yield 10.0 ** rng.uniform(smallest, min(2.0, 290.0 / alpha)), alpha
        # around 1 the logarithm cancels
        for _ in range(30):
            yield 1.0 + rng.uniform(-1, 1) * 10.0 ** rng.uniform(-15, -0.5), alpha


def main():
    rng = random.Random(1)
    out = sys.stdout
    out.write("x_bits,alpha_bits,power_bits,remainder_ulp\n")
    for x, alpha in samples(rng):
        exact = mpmath.power(mpmath.mpf(x), mpmath.mpf(alpha))
        nearest = float(exact)
        if not 1e-300 < nearest < 1e300:
            continue
        ulp = double(bits(nearest) + 1) - nearest
        remainder = float((exact - mpmath.mpf(nearest)) / mpmath.mpf(ulp))
        out.write(f"{bits(x):016x},{bits(alpha):016x},{bits(nearest):016x},{remainder:.4f}\n")


main()
