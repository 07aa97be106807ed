"""Sine, cosine, exponential and waveforms of docs/KERNEL.md: part of kernel.py, which imports it.

A time or an angle is a pair of doubles whose sum is meant. Waveforms are computed by Python's own doubles, whose + - * /
round once, too; `expm1` and `q2` take arrays as well.
"""

import math
import struct

import numpy as np


def doubles_of(text):
    """The doubles of their bits, sixteen hexadecimal digits each."""
    return [struct.unpack(">d", bytes.fromhex(word))[0] for word in text.split()]


SINE = doubles_of(
    "bfc5555555555555 3f81111111111111 bf2a01a01a01a01a 3ec71de3a556c734 "
    "be5ae64567f544e4 3de6124613a86d09 bd6ae7f3e733b81f 3ce952c77030ad4a"
)
COSINE = doubles_of(
    "3fa5555555555555 bf56c16c16c16c17 3efa01a01a01a01a be927e4fb7789f5c "
    "3e21eed8eff8d898 bda93974a8c07c9d 3d2ae7f3e733b81f bca6827863b97d97"
)
T1, T2, J1, J2, I, H, L = doubles_of(
    "401921fb54442d18 3cb1a62633145c07 3fc45f306dc9c883 bc66b01ec5417056 3ff71547652b82fe 3fe62e42fee00000 3dea39ef35793c76"
)
E = [1 / math.factorial(j) for j in range(16)]


# Exact sums and products


def two_sum(a, b):
    s = a + b
    p = s - a
    return s, (a - (s - p)) + (b - p)


def fast_two_sum(a, b):
    s = a + b
    return s, b - (s - a)


def halves(a):
    c = 134217729 * a
    high = c - (c - a)
    return high, a - high


def two_product(a, b):
    p, (a1, a2), (b1, b2) = a * b, halves(a), halves(b)
    return p, (((a1 * b1 - p) + a1 * b2) + a2 * b1) + a2 * b2


# Functions


def series(coefficients, x):
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total


def sincos(x, y):
    """Sine and cosine of x + y turns."""
    k = math.floor(4 * x + 0.5)
    a, b = two_sum(x - 0.25 * k, y)
    p, e = two_product(a, T1)
    l = e + (a * T2 + b * T1)
    z, f = two_product(p, p)
    h = 0.5 * z
    sin = p + ((p * z) * series(SINE, z) + (l - l * h))
    w = 1 - h
    cos = w + (((1 - w) - h) + ((z * z) * series(COSINE, z) - (0.5 * f + p * l)))
    return [(sin, cos), (cos, -sin), (-sin, -cos), (-cos, sin)][k % 4]


def q2(r):
    return series(E[2:], r)


def reduced(x):
    """2^n and expm1(r) of x = n·ln 2 + r."""
    n = np.floor(x * I + 0.5)
    r = (x - n * H) - n * L
    return np.ldexp(1.0, n.astype(int)), r + (r * r) * q2(r)


def exp(x):
    s, m = reduced(np.float64(x if abs(x) <= 700 else 0))
    return float(s * m + s) if abs(x) <= 700 else math.inf if x > 700 else 0.0


def expm1(x):
    inside = np.abs(x) <= 700
    s, m = reduced(np.where(inside, x, 0.0))
    return np.where(inside, s * m + (s - 1), np.where(x > 700, np.inf, -1.0))


# Times and angles


def moment(n, s, dt):
    a, b = two_product(float(n), dt)
    c, e = two_sum(a, s)
    return fast_two_sum(c, b + e)


def since(t, start):
    c, e = two_sum(t[0], -start)
    return fast_two_sum(c, t[1] + e)


def until(t, end):
    high, low = since(t, end)
    return -high, -low


def turns(t, f, phase):
    p, e = two_product(f, t[0])
    e += f * t[1]
    a, b = two_product(phase, J1)
    q, c = two_sum(p, a)
    y = (e + (b + phase * J2)) + c
    return two_sum(q - math.floor(q + 0.5), y)


def chirped(t, f, g):
    p, e = two_product(f, t[0])
    e += f * t[1]
    u, v = two_product(t[0], t[0])
    a, b = two_product(g, u)
    b += g * (v + 2 * (t[0] * t[1]))
    q, c = two_sum(p, a)
    y = (e + b) + c
    return two_sum(q - math.floor(q + 0.5), y)


# Waveforms: value and slope


def rise(tau, length):
    s, c = sincos(tau / (4 * length), 0.0)
    return s * s, (s * c) * ((0.5 * T1) / length)


def envelope(t, ramp, end, ramp_down):
    if end is not None:
        tau = until(t, end)[0]
        if tau <= 0:
            return 0.0, 0.0
        if tau < ramp_down:
            value, slope = rise(tau, ramp_down)
            return value, -slope
    return rise(t[0], ramp) if t[0] < ramp else (1.0, 0.0)


class Shape(dict):
    """The keys of a waveform; one that is absent is 0."""

    def __missing__(self, key):
        return 0.0


def constant(t, amplitude):
    return amplitude, 0.0


def sine(t, w):
    s, c = sincos(*turns(t, w["frequency_hz"], w["phase_rad"]))
    return modulated(w, s, (T1 * w["frequency_hz"]) * c, envelope(t, w["ramp_s"], w.get("until_s"), w["ramp_down_s"]))


def chirp(t, w):
    g = (0.5 * (w["to_hz"] - w["from_hz"])) / w["duration_s"]
    s, c = sincos(*chirped(t, w["from_hz"], g))
    f = w["from_hz"] + (2 * g) * t[0]
    return modulated(w, s, (T1 * f) * c, envelope(t, w["ramp_s"], w["duration_s"], w["ramp_down_s"]))


def modulated(w, s, slope, of_envelope):
    value, change = of_envelope
    return w["amplitude"] * (value * s), w["amplitude"] * (value * slope + change * s)


def step(t, w):
    a, tau = w["amplitude"], since(t, w["at_s"])[0]
    if tau < 0:
        return a * 0, a * 0
    value, slope = rise(tau, w["rise_s"]) if tau < w["rise_s"] else (1.0, 0.0)
    return a * value, a * slope


def ramp(t, w):
    a, tau, length = w["amplitude"], since(t, w["from_s"])[0], w["to_s"] - w["from_s"]
    if tau < 0:
        return 0.0, 0.0
    return (a * (tau / length), a / length) if tau < length else (a, 0.0)


def half_sine(t, w):
    tau, length = since(t, w["at_s"])[0], w["duration_s"]
    if tau < 0 or tau >= length:
        return 0.0, 0.0
    s, c = sincos(tau / (2 * length), 0.0)
    return w["amplitude"] * s, w["amplitude"] * (((0.5 * T1) / length) * c)


def gaussian(t, w):
    late, f = since(t, w["at_s"]), w["frequency_hz"]
    z = late[0] / w["width_s"]
    b = w["amplitude"] * exp(-0.5 * (z * z))
    s, c = sincos(*turns(late, f, 0.0))
    return b * c, b * -((z / w["width_s"]) * c + (T1 * f) * s)


def table(t, w):
    times, values, tau = w["times_s"], w["values"], t[0]
    if tau < times[0]:
        return values[0], 0.0
    last = len(times) - 1
    tau = tau if tau < times[last] else times[last]
    i = sum(time <= tau for time in times[1:last])
    h, y = times[i + 1] - times[i], values[i + 1] - values[i]
    x = (tau - times[i]) / h
    if w["interpolation"] == "linear":
        return values[i] + x * y, y / h
    d0, d1 = h * tangent(times, values, i), h * tangent(times, values, i + 1)
    a, b = 3 * y - (2 * d0 + d1), (d0 + d1) - 2 * y
    return values[i] + x * (d0 + x * (a + x * b)), (d0 + x * (2 * a + x * (3 * b))) / h


def tangent(times, values, j):
    """The slope of a cubic table at its time number j."""
    last = len(times) - 1

    def length(i):
        return times[i + 1] - times[i]

    def secant(i):
        return (values[i + 1] - values[i]) / length(i)

    if last == 1:
        return secant(0)
    if 0 < j < last:
        return (length(j) * secant(j - 1) + length(j - 1) * secant(j)) / (length(j - 1) + length(j))
    near, far = (0, 1) if j == 0 else (last - 1, last - 2)
    return secant(near) + ((secant(near) - secant(far)) * length(near)) / (length(near) + length(far))


def as_doubles(shape):
    """JSON may write a double as an integer, and Python's integers do not round."""
    if isinstance(shape, dict):
        return Shape((key, as_doubles(value)) for key, value in shape.items())
    if isinstance(shape, list):
        return [float(value) for value in shape]
    return shape if isinstance(shape, str) else float(shape)


KINDS = (constant, sine, chirp, step, ramp, half_sine, gaussian, table)
KINDS = {kind.__name__: kind for kind in KINDS}


class Waveform:
    """What a manifest says of one: `{"sine": {…}}`."""

    def __init__(self, entry, dt):
        ((name, shape),) = entry.items()
        self.kind, self.shape, self.dt = KINDS[name], as_doubles(shape), dt

    def value(self, n, s):
        return self.kind(moment(n, s, self.dt), self.shape)[0]

    def knots(self):
        """Where it jumps, has a kink, or goes over into another formula."""
        w = self.shape
        if self.kind in (sine, chirp):
            end = w["duration_s"] if self.kind is chirp else w.get("until_s")
            found = [w["ramp_s"]] if w["ramp_s"] > 0 else []
            found += [end - w["ramp_down_s"]] if end is not None and w["ramp_down_s"] > 0 else []
            return found + ([] if end is None else [end])
        if self.kind is step:
            return [w["at_s"], w["at_s"] + w["rise_s"]]
        if self.kind is ramp:
            return [w["from_s"], w["to_s"]]
        if self.kind is half_sine:
            return [w["at_s"], w["at_s"] + w["duration_s"]]
        return list(w["times_s"]) if self.kind is table else []

    def slope(self, n, s):
        return self.kind(moment(n, s, self.dt), self.shape)[1]
