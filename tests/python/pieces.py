"""Pieces of a step, as docs/KERNEL.md has them: part of kernel.py."""

import math
from collections import namedtuple

from waveforms import two_product

APART = 2.0**-20

# the time s after step n, `since` seconds after its piece began at `start`; what jumps is looked at `beside` seconds later
Time = namedtuple("Time", "n start since s is_end beside")


class Piece(namedtuple("Piece", "n start stop is_last after before")):
    """From `start` to `stop` in step n; `after`, `before`: how far inside what jumps is looked at, at both ends."""

    @property
    def length(self):
        return self.stop - self.start

    def begin(self):
        return Time(self.n, self.start, 0.0, self.start, False, self.after)

    def within(self, since):
        return Time(self.n, self.start, since, self.start + since, False, 0.0)

    def end(self):
        return Time(self.n, self.start, self.length, self.stop, self.is_last, -self.before)


def knots(waveforms, dt):
    """Of all waveforms, with the number of the step and the time after it."""
    found, last = [], 0.0
    for knot in sorted(knot for waveform in waveforms for knot in waveform.knots()):
        if knot > APART * dt and knot - last > APART * dt:
            found.append(place(knot, dt))
            last = knot
    return found


def place(knot, dt):
    n = math.floor(knot / dt)
    p, e = two_product(float(n), dt)
    s = (knot - p) - e
    if s <= APART * dt:
        return n, 0.0
    return (n + 1, 0.0) if dt - s <= APART * dt else (n, s)


def pieces(all_knots, n, dt):
    """Those of step n, one after the other."""
    bounds = [0.0] + [s for step, s in all_knots if step == n and s] + [dt]
    at_knot = [True] * len(bounds)
    at_knot[0], at_knot[-1] = (n, 0.0) in all_knots, (n + 1, 0.0) in all_knots
    for i, (start, stop) in enumerate(zip(bounds, bounds[1:])):
        inside = min(0.25 * (stop - start), 2 * APART * dt)
        after, before = (inside if is_knot else 0.0 for is_knot in at_knot[i : i + 2])
        yield Piece(n, start, stop, stop == dt, after, before)
