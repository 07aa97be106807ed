"""Final states of small chains of every kind, driven and at rest, from a solver that shares nothing with Beadline.

Reads driven-state-cases.json and writes driven-state-errors.csv, driven-states.csv and driven-works.csv beside itself (see
README.md there), in minutes:

    python3 -m venv VENV && VENV/bin/pip install numpy scipy && VENV/bin/python driven_states.py [CASE ...]

As in final_states.py the equations of motion are integrated in units of a length and a time of the case by DOP853, and twice more,
with looser tolerances and by LSODA. Integration starts anew where a waveform has a corner. What drives do and what is dissipated is
integrated beside the motion, and closes the balance of energies.

A case is a JSON object. Numbers of beads and contacts are one number, or a list that is repeated along the chain.

    toml                        the configuration of the same run, without its [integrator]
    length_m, time_s, end_s     units of the errors, end of the run
    beads, mass, alpha, stiffness, load_n | gap_m
    left, right, ring           stiffness of a wall's contact, or of that from the last bead to the first
    terms                       further forces of every contact: {"power": a | "spring": n | "toda": b, "stiffness": ...}
    on_site, on_site_cubic, drag, resonator_mass, resonator_stiffness
    damping                     {"eta": ..., "exponent": p}; "bonds": true: never cut
    drives                      as in a configuration
    u, v                        {bead: value} at the beginning, or lists of N
    max_step                    longest step of the first integration, in time_s
"""

import csv
import json
import multiprocessing
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

HERE = Path(__file__).parent


class Waveform:
    """Values, slopes and corners of a waveform."""

    def __init__(self, written):
        if not isinstance(written, dict):
            written = {"constant": written}
        ((self.kind, self.p),) = written.items()
        if self.kind == "table" and self.p.get("interpolation") == "cubic":
            x, y = np.array(self.p["times_s"]), np.array(self.p["values"])
            # the parabola through three neighbours
            slopes = []
            for j in range(len(x)):
                first = min(max(j - 1, 0), len(x) - 3)
                line = np.polyfit(x[first : first + 3] - x[j], y[first : first + 3], 2)
                slopes.append(line[1])
            self.cubic = CubicHermiteSpline(x, y, slopes)

    def get(self, key):
        return self.p.get(key, 0.0)

    def end(self):
        return self.p.get("until_s", self.p.get("duration_s", np.inf))

    def corners(self):
        p, get = self.p, self.get
        if self.kind in ("sine", "chirp"):
            return [get("ramp_s"), self.end() - get("ramp_down_s"), self.end()]
        if self.kind == "step":
            return [get("at_s"), get("at_s") + get("rise_s")]
        if self.kind == "ramp":
            return [get("from_s"), p["to_s"]]
        if self.kind == "half_sine":
            return [get("at_s"), get("at_s") + p["duration_s"]]
        return p["times_s"] if self.kind == "table" else []

    def envelope(self, t):
        def grown(since, ramp):
            return (1.0, 0.0) if since >= ramp else (
                np.sin(np.pi * since / (2 * ramp)) ** 2,
                np.pi / (2 * ramp) * np.sin(np.pi * since / ramp),
            )

        if t >= self.end():
            return 0.0, 0.0
        left = self.end() - t
        if left < self.get("ramp_down_s"):
            value, slope = grown(left, self.get("ramp_down_s"))
            return value, -slope
        return grown(t, self.get("ramp_s"))

    def __call__(self, t):
        """Value and slope."""
        kind, p, get = self.kind, self.p, self.get
        if kind == "constant":
            return p, 0.0
        if kind in ("sine", "chirp"):
            if kind == "sine":
                hz, angle = p["frequency_hz"], 2 * np.pi * p["frequency_hz"] * t + get("phase_rad")
            else:
                rate = (p["to_hz"] - p["from_hz"]) / p["duration_s"]
                hz, angle = p["from_hz"] + rate * t, 2 * np.pi * (p["from_hz"] + rate * t / 2) * t
            value, slope = self.envelope(t)
            change = value * 2 * np.pi * hz * np.cos(angle) + slope * np.sin(angle)
            return p["amplitude"] * value * np.sin(angle), p["amplitude"] * change
        if kind == "table":
            x, y = p["times_s"], p["values"]
            if t < x[0]:
                return y[0], 0.0
            t = min(t, x[-1])
            if p.get("interpolation") == "cubic":
                return float(self.cubic(t)), float(self.cubic(t, 1))
            i = min(np.searchsorted(x, t, "right"), len(x) - 1) - 1
            slope = (y[i + 1] - y[i]) / (x[i + 1] - x[i])
            return y[i] + slope * (t - x[i]), slope
        a = p["amplitude"]
        since = t - get("from_s" if kind == "ramp" else "at_s")
        if kind == "gaussian":
            bell, angle = a * np.exp(-((since / p["width_s"]) ** 2) / 2), 2 * np.pi * get("frequency_hz") * since
            slope = -since / p["width_s"] ** 2 * np.cos(angle) - 2 * np.pi * get("frequency_hz") * np.sin(angle)
            return bell * np.cos(angle), bell * slope
        if since < 0:
            return 0.0, 0.0
        length = {"step": get("rise_s"), "ramp": get("to_s") - get("from_s"), "half_sine": get("duration_s")}[kind]
        if since >= length:
            return (0.0 if kind == "half_sine" else a), 0.0
        if kind == "ramp":
            return a * since / length, a / length
        if kind == "half_sine":
            return a * np.sin(np.pi * since / length), a * np.pi / length * np.cos(np.pi * since / length)
        return a * np.sin(np.pi * since / (2 * length)) ** 2, a * np.pi / (2 * length) * np.sin(np.pi * since / length)


class Chain:
    """The chain of a case, in units of its length and time and of 1 kg."""

    def __init__(self, case):
        n = self.n = case["beads"]
        self.length, self.time = case["length_m"], case["time_s"]
        force = self.length / self.time**2
        spread = lambda value, count: np.resize(np.array(value, dtype=float), count)
        self.mass = spread(case["mass"], n)
        # contacts: N − 1 between beads, then left, right, ring; those that are not there have no stiffness
        ends = ["left", "right", "ring"]
        self.there = np.array([True] * (n - 1) + [end in case for end in ends])

        def contacts(value, unit, at_ends):
            between = spread(value, n - 1)
            last = [at_ends(end, between) if end in case else 0.0 for end in ends]
            return np.concatenate([between, last]) * unit

        usual = lambda end, between: between[0] if end == "left" else between[-1]
        alpha = case.get("alpha", 1.5)
        # exponents of contacts may differ: a power for each
        laws = [("power", spread(alpha, n - 1), contacts(case.get("stiffness", 0.0), 1.0, lambda end, _: case[end]))]
        for term in case.get("terms", []):
            stiffness = contacts(term["stiffness"], 1.0, lambda end, between: term.get(end, usual(end, between)))
            ((kind, parameter),) = [(k, v) for k, v in term.items() if k in ("power", "spring", "toda")]
            laws.append((kind, np.full(n - 1, float(parameter)), stiffness))
        self.laws = []
        for kind, parameter, stiffness in laws:
            parameter = np.concatenate([parameter, np.full(3, parameter[0])])
            if kind == "toda":
                parameter, stiffness = parameter * self.length, stiffness * self.length / force
            else:
                stiffness = stiffness * self.length**parameter / force
            self.laws.append((kind, parameter, stiffness))
        self.rest = np.zeros(n + 2)
        if "gap_m" in case:
            self.rest[: n - 1] = -spread(case["gap_m"], n - 1) / self.length
        if "load_n" in case:
            self.rest = np.where(self.there, self.balance(case["load_n"] / force), 0.0)
        self.rest_force = self.elastic(self.rest)
        if "gap_m" in case:
            self.rest_force[:] = 0.0
        per = force / self.length
        self.springs = spread(case.get("on_site", 0.0), n) / per
        self.cubic = spread(case.get("on_site_cubic", 0.0), n) * self.length**3 / force
        self.drag = spread(case.get("drag", 0.0), n) * self.length / self.time / force
        self.resonator_mass = spread(case.get("resonator_mass", 0.0), n)
        self.resonator_stiffness = spread(case.get("resonator_stiffness", 0.0), n) / per * (self.resonator_mass > 0)
        damping = case.get("damping")
        self.is_bonded = bool(damping and damping.get("bonds"))
        self.exponent = damping["exponent"] if damping else 0.0
        unit = self.length ** (1 + self.exponent) / self.time / force
        self.eta = contacts(damping["eta"], unit, usual) if damping else np.zeros(n + 2)
        self.drives = []
        for drive in case.get("drives", []):
            ((quantity, written),) = [(k, v) for k, v in drive.items() if k not in ("wall", "bead")]
            at = drive.get("wall", drive.get("bead"))
            self.drives.append((at, quantity, Waveform(written)))
        self.force_unit = force

    def balance(self, load):
        """Overlaps that carry the load, by bisection."""
        low, high = np.zeros(self.n + 2), np.full(self.n + 2, 1e3)
        for _ in range(200):
            middle = 0.5 * (low + high)
            less = self.elastic(middle) < load
            low, high = np.where(less, middle, low), np.where(less, high, middle)
        return 0.5 * (low + high)

    def elastic(self, overlap):
        force = np.zeros(self.n + 2)
        for kind, parameter, stiffness in self.laws:
            if kind == "power":
                force += stiffness * np.maximum(overlap, 0.0) ** parameter
            elif kind == "spring":
                force += stiffness * overlap**parameter
            else:
                force += stiffness * np.expm1(parameter * overlap) / parameter
        return np.where(self.there, force, 0.0)

    def energy(self, overlap):
        """Potential energy of each contact."""
        energy = np.zeros(self.n + 2)
        for kind, parameter, stiffness in self.laws:
            if kind == "power":
                energy += stiffness * np.maximum(overlap, 0.0) ** (parameter + 1) / (parameter + 1)
            elif kind == "spring":
                energy += stiffness * overlap ** (parameter + 1) / (parameter + 1)
            else:
                energy += stiffness * (np.expm1(parameter * overlap) / parameter - overlap) / parameter
        return np.where(self.there, energy, 0.0)

    def moved(self, t, travelled):
        """Where walls and moved beads are, and how fast: {place: (X, V)}; `travelled` of velocity drives."""
        places = {}
        for (at, quantity, waveform), way in zip(self.drives, travelled):
            if quantity == "force_n":
                continue
            value, slope = waveform(t * self.time)
            if quantity == "displacement_m":
                places[at] = value / self.length, slope * self.time / self.length
            else:
                places[at] = way, value * self.time / self.length
        return places

    def split(self, y):
        """u, v, w, w', dissipated work, works of drives, ways of velocity drives."""
        n, d = self.n, len(self.drives)
        return y[:n], y[n : 2 * n], y[2 * n : 3 * n], y[3 * n : 4 * n], y[4 * n], y[4 * n + 1 : 4 * n + 1 + d], y[4 * n + 1 + d :]

    def overlaps(self, u, v, places):
        left, right = places.get("left", (0.0, 0.0)), places.get("right", (0.0, 0.0))
        approach = np.concatenate([u[:-1] - u[1:], [left[0] - u[0], u[-1] - right[0], u[-1] - u[0]]])
        rate = np.concatenate([v[:-1] - v[1:], [left[1] - v[0], v[-1] - right[1], v[-1] - v[0]]])
        return approach, rate

    def rhs(self, t, y):
        n = self.n
        u, v, w, wv, _, _, travelled = self.split(y.copy())
        places = self.moved(t, travelled)
        for at, (x, speed) in places.items():
            if isinstance(at, int):
                u[at], v[at] = x, speed
        approach, rate = self.overlaps(u, v, places)
        overlap = approach + self.rest
        elastic = self.elastic(overlap)
        if self.is_bonded:
            whole = elastic + self.eta * rate
        else:
            closed = overlap > 0.0
            shape = np.where(closed, np.where(closed, overlap, 1.0) ** self.exponent, 0.0)
            whole = np.where(self.eta > 0.0, np.where(closed, np.maximum(elastic + self.eta * shape * rate, 0.0), 0.0), elastic)
        force = np.where(self.there, whole - self.rest_force, 0.0)
        net = np.zeros(n)
        net[1:] += force[: n - 1]
        net[:-1] -= force[: n - 1]
        net[0] += force[n - 1] + force[n + 1]
        net[-1] -= force[n] + force[n + 1]
        net -= self.springs * u + self.cubic * u**3
        pull = self.resonator_stiffness * (w - u)
        net += pull - self.drag * v
        out = np.zeros_like(y)
        out[:n], out[2 * n : 3 * n] = v, wv
        out[3 * n : 4 * n] = np.where(self.resonator_mass > 0, -pull / np.where(self.resonator_mass > 0, self.resonator_mass, 1.0), 0.0)
        out[4 * n] = ((whole - elastic) * rate)[self.there].sum() + (self.drag * v * v).sum()
        pushed = net.copy()
        d = len(self.drives)
        for i, (at, quantity, waveform) in enumerate(self.drives):
            if quantity == "force_n":
                pushing = waveform(t * self.time)[0] / self.force_unit
                pushed[at] += pushing
                power = pushing * v[at]
            else:
                speed = places[at][1]
                power = {"left": force[n - 1], "right": -force[n]}.get(at, 0.0) * speed
                if isinstance(at, int):
                    power = -net[at] * speed
                if quantity == "velocity_m_s":
                    out[4 * n + 1 + d + i] = speed
            out[4 * n + 1 + i] = power
        out[n : 2 * n] = pushed / self.mass
        for at in places:
            if isinstance(at, int):
                out[at] = out[n + at] = 0.0
        return out

    def start(self, case):
        n, d = self.n, len(self.drives)
        y = np.zeros(4 * n + 1 + 2 * d)
        for key, first, unit in [("u", 0, self.length), ("v", n, self.length / self.time)]:
            given = case.get(key, {})
            for bead, value in given.items() if isinstance(given, dict) else enumerate(given):
                y[first + int(bead)] = value / unit
        # resonators begin where their beads are, with their beads' displacement but no velocity of their own
        return y

    def put(self, t, y):
        """The state with moved beads at their places; kinetic energy that they gained is work of their drives."""
        y = y.copy()
        places = self.moved(t, self.split(y)[6])
        at_first = self.moved(0.0, np.zeros(len(self.drives)))
        for i, (at, quantity, _) in enumerate(self.drives):
            if isinstance(at, int) and quantity != "force_n":
                y[at], y[self.n + at] = places[at]
                y[4 * self.n + 1 + i] += 0.5 * self.mass[at] * (places[at][1] ** 2 - at_first[at][1] ** 2)
        return y

    def total(self, t, y):
        u, v, w, wv, dissipated, works, travelled = self.split(y)
        approach, _ = self.overlaps(u, v, self.moved(t, travelled))
        energy = self.energy(approach + self.rest) - self.energy(self.rest) - self.rest_force * approach
        kinetic = 0.5 * (self.mass * v * v).sum() + 0.5 * (self.resonator_mass * wv * wv).sum()
        on_site = 0.5 * (self.springs * u * u).sum() + 0.25 * (self.cubic * u**4).sum()
        inside = 0.5 * (self.resonator_stiffness * (w - u) ** 2).sum()
        potential = energy[self.there].sum() + on_site + inside
        return kinetic, potential, dissipated, works.sum()


def integrate(chain, case, method, rtol, atol, max_step):
    end = case["end_s"] / chain.time
    corners = [corner / chain.time for _, _, waveform in chain.drives for corner in waveform.corners()]
    stops = [0.0, *sorted({corner for corner in corners if 0.0 < corner < end}), end]
    y = chain.start(case)
    largest = 0.0
    for first, last in zip(stops, stops[1:]):
        options = dict(method=method, rtol=rtol, atol=atol, max_step=max_step)
        solution = solve_ivp(chain.rhs, (first, last), y, **options)
        assert solution.success, solution.message
        y = solution.y[:, -1]
        largest = max(largest, abs(solution.y[chain.n : 2 * chain.n]).max())
    return y, largest


def solve(case):
    chain = Chain(case)
    end = case["end_s"] / chain.time
    first = chain.put(0.0, chain.start(case))
    y, largest = integrate(chain, case, "DOP853", 1e-12, 1e-15, case.get("max_step", 0.01))
    loose, _ = integrate(chain, case, "DOP853", 1e-10, 1e-12, 0.02)
    other, _ = integrate(chain, case, "LSODA", 1e-11, 1e-13, 0.01)
    states = 2 * chain.n
    tolerances, methods = (abs(y - another)[:states].max() for another in (loose, other))
    y = chain.put(end, y)
    kinetic, potential, dissipated, driven = chain.total(end, y)
    size = max(kinetic + potential, dissipated, abs(driven))
    balance = abs(kinetic + potential + dissipated - driven - sum(chain.total(0.0, first)[:2])) / size
    assert tolerances < 1e-5 and methods < 1e-5 and balance < 1e-8, (case["name"], tolerances, methods, balance)
    name, n = case["name"], chain.n
    speed, joule = chain.length / chain.time, (chain.length / chain.time) ** 2
    u, v, w, wv, _, works, _ = chain.split(y)
    rows = []
    for i in range(n):
        row = [u[i] * chain.length, v[i] * speed]
        row += [w[i] * chain.length, wv[i] * speed] if chain.resonator_mass.any() else []
        rows.append([name, i, *(f"{value:.16e}" for value in row), *[""] * (4 - len(row))])
    energies = [("kinetic", kinetic), ("potential", potential), ("dissipated", dissipated)]
    energies += [(f"drive {i}", work) for i, work in enumerate(works)]
    errors = [name, f"{largest * speed:.3e}", *(f"{error:.0e}" for error in (tolerances, methods, balance))]
    print(*errors, flush=True)
    return errors, rows, [[name, what, f"{value * joule:.16e}"] for what, value in energies]


def write(file, header, rows):
    with open(HERE / file, "w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(header.split(","))
        writer.writerows(rows)


def main():
    cases = json.loads((HERE / "driven-state-cases.json").read_text())
    wanted = sys.argv[1:]
    with multiprocessing.Pool(2) as pool:
        results = pool.map(solve, [case for case in cases if not wanted or case["name"] in wanted], chunksize=1)
    if not wanted:
        write("driven-state-errors.csv", "case,fastest_m_s,between_tolerances,between_methods,energy_error", [r[0] for r in results])
        write("driven-states.csv", "case,bead,u_m,v_m_s,w_m,w_m_s", [row for r in results for row in r[1]])
        write("driven-works.csv", "case,what,energy_j", [row for r in results for row in r[2]])


if __name__ == "__main__":
    main()
