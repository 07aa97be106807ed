"""Heat baths of docs/KERNEL.md in NumPy: part of kernel.py, which chain.py imports it for."""

import math

from random_chains import normals, words
from waveforms import Waveform, exp, expm1

BOLTZMANN = 1.380649e-23


class Bath:
    """An entry of `baths`, for a chain of the masses m."""

    def __init__(self, entry, m, ring, dt, seed):
        self.m, self.seed = m, entry.get("seed", seed)
        self.first, self.end = (int(number) for number in entry["beads"].split(".."))
        self.pairs, friction = entry.get("pairs", False), float(entry["friction_per_s"])
        whole = ring and self.end - self.first == len(m)
        self.places = range(self.first, self.end - (self.pairs and not whole))
        self.unit = 1.0 if "temperature_j" in entry else BOLTZMANN
        self.wave = Waveform(entry.get("temperature_j") or entry["temperature_k"], dt)
        self.e, self.q = exp(-(friction * (0.5 * dt))), math.sqrt(0.0 - float(expm1(-(friction * dt))))

    def act(self, v, heat, n, half):
        """B (0) or B' (1) of step n, on velocities and heat in place."""
        T = self.wave.value(n + half, 0.0)
        T = max(T if self.unit == 1.0 else self.unit * T, 0.0)
        for place in reversed(self.places) if half else self.places:
            xi = normals(words(self.seed, place, n, 2 if self.pairs else 1))[half]
            i, j = place, (place + 1) % len(self.m)
            g = 1 / self.m[i] + (1 / self.m[j] if self.pairs else 0.0)
            kick = (self.q * math.sqrt(T * g)) * xi
            if not self.pairs:
                heat[place] += self.put(v, i, (self.e * v[i] + kick) + 0)
                continue
            s = v[i] - v[j]
            y = (self.e * s + kick) - s
            to_i, to_j = v[i] + ((1 / self.m[i]) / g) * y, v[j] - ((1 / self.m[j]) / g) * y
            heat[place] += self.put(v, i, to_i) + self.put(v, j, to_j)

    def put(self, v, i, new):
        """Gives a bead another velocity; the energy that this takes."""
        old, v[i] = v[i], new
        return (0.5 * self.m[i]) * ((new - old) * (new + old))
