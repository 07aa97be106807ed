import math
import numpy as np

def q2(x):
    s = 1 / math.factorial(15)
    for k in range(14, 1, -1):
        s = 1 / math.factorial(k) + x * s
    return s

LN2_HIGH = math.ldexp(int(math.ldexp(math.log(2), 53)) >> 21 << 21, -53)
LN2_LOW = 0.0


def expm1(x):
    n = np.floor(x * (1 / math.log(2)) + 0.5)
    r = (x - n * LN2_HIGH) - n * LN2_LOW
    m = r + (r * r) * q2(r)
    inside = abs(x) <= 700
    s = np.ldexp(1.0, np.where(inside, n, 0).astype(int))
    return np.where(inside, s * m + (s - 1), np.where(x > 700, np.inf, -1.0))


class Waveform:
    pass
