"""The arithmetic of docs/KERNEL.md in NumPy: part of kernel.py, which imports it.

How it is made: `Power` is δ^α, `Law` a term of the force of contacts, `Chain` the forces, the methods, the start of gear5 and the
energies, in the order and with the symbols of the page. A state is an array with a row for each of u, v and what is in
`extra` (`Chain.names` has their names), and a column for each bead. NumPy's + - * / and sqrt round once, as the page wants it,
its sums do not: `np.sum` is not used. Walls are contacts number 0 and N, with a bead beyond that moves only where it is driven; an
end without a wall has one with a gap of infinite width. In a ring both are the same contact, of the last bead with bead 0.
"""

import math
import struct
from decimal import Decimal, localcontext

import numpy as np
from baths import Bath
from pieces import Piece, knots, pieces
from waveforms import Waveform, expm1, q2

np.seterr(all="ignore")


class Wrong(Exception):
    """What a file may not be."""


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


# The laws of a contact


class Law:
    """A term of every contact's force: `k` of each contact times P(δ), a power of δ, or expm1(b·δ)/b."""

    def __init__(self, kind, parameter, k):
        self.kind, self.parameter, self.k = kind, parameter, k
        if kind == "power":
            self.power = Power(parameter)
            self.e = [0.5 * parameter]
            for n in range(1, 8):
                self.e.append(self.e[n - 1] * (parameter - n) / (n + 2))
        elif kind not in ("spring", "toda") or kind == "spring" and parameter not in (1, 2, 3):
            raise Wrong(f"a term of the kind {kind}, {parameter}")

    def unit(self, d):
        """The force for k = 1."""
        if self.kind == "power":
            return self.power(d)
        if self.kind == "toda":
            return expm1(self.parameter * d) / self.parameter
        return {1: d, 2: d * d, 3: d * d * d}[self.parameter]

    def force(self, d):
        return np.where(self.k == 0, 0.0, self.k * self.unit(d))

    def energy(self, d):
        """U of a power."""
        return np.where(d > self.power.z, self.k * self.power(d) * d / (self.parameter + 1), 0.0)

    def excess(self, a, rho):
        """The energy beyond that at rest, less the work of the force at rest, of an approach a."""
        k, b = self.k, self.parameter
        if self.kind == "power":
            x, rest = a / rho, self.force(rho)
            series = 0.0
            for coefficient in reversed(self.e):
                series = series * x + coefficient
            beyond = (self.energy(a + rho) - self.energy(rho)) - rest * a
            return np.where(abs(x) <= 1 / (16 * (b + 1)), rest * a * x * series, beyond)
        if self.kind == "toda":
            x = b * a
            t = np.where(abs(x) <= 0.34, a * a * q2(x), (expm1(x) / b - a) / b)
            energy = k * (expm1(b * rho) + 1) * t
        elif b == 1:
            energy = 0.5 * k * (a * a)
        elif b == 2:
            energy = k * (a * a) * (rho + a / 3)
        else:
            energy = k * (a * a) * ((1.5 * (rho * rho) + rho * a) + 0.25 * (a * a))
        return np.where(k == 0, 0.0, energy)


# The chain


def net(force):
    return force[:-1] - force[1:]


def total(terms):
    """The sum of the page, in eight parts."""
    parts = np.zeros((-(-len(terms) // 8) + 1, 8))  # a row of zeros to begin with; those at the end change nothing
    parts.ravel()[8 : 8 + len(terms)] = terms
    s = np.cumsum(parts, axis=0)[-1]
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]))


KICKS = {"velocity-verlet": [0.5, 0.5]}
DRIFTS = {"velocity-verlet": [1.0]}
A = [double(x) for x in (0x3FCF65F4CB6CB771, 0x3FE35B1DEBAF2655, 0xBFD669363D14A862)]
B = [double(x) for x in (0x3FB53E774FA406BE, 0x3FD95D23C9214375, 0xBFA3FF3020B02CB4, 0x3FBE9923385E0390)]
KICKS["rkn4"], DRIFTS["rkn4"] = B + B[2::-1], A + A[::-1]

STAGES = [  # of rk5: c, and what each derivative before counts
    (0, []),
    (1 / 5, [1 / 5]),
    (3 / 10, [3 / 40, 9 / 40]),
    (4 / 5, [44 / 45, -56 / 15, 32 / 9]),
    (8 / 9, [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]),
    (1, [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]),
]
GAUSS = double(0x3FBCDA042F0236E1), 0.5, double(0x3FEC64BF7A1FB924)  # ½ ∓ √15/10
WEIGHTS = [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]


class Drive:
    """What moves a wall ("left", "right") or a bead (its number), or pulls at a bead with a force."""

    def __init__(self, entry, dt):
        self.at, self.dt = entry["wall"] if "wall" in entry else entry["bead"], dt
        (self.kind,) = {"force_n", "displacement_m", "velocity_m_s"} & set(entry)
        self.wave = Waveform(entry[self.kind], dt)
        self.moves = self.kind != "force_n"
        self.moves_bead = self.moves and "bead" in entry

    def at_time(self, when):
        """The end of a step is the beginning of the next one."""
        return (when.n + 1, 0.0) if when.is_end else (when.n, when.s)

    def beside(self, when):
        return (when.n, when.s + when.beside) if when.beside else self.at_time(when)

    def force(self, when):
        value = self.wave.value(*self.beside(when))
        return value - self.wave.slope(*self.beside(when)) * when.beside if when.beside else value

    def velocity(self, when):
        return self.force(when) if self.kind == "velocity_m_s" else self.wave.slope(*self.beside(when))

    def displacement(self, when, before):
        """`before` is the displacement at the beginning of the piece."""
        if self.kind == "displacement_m":
            return self.wave.value(*self.at_time(when))
        v = [self.wave.value(when.n, when.start + when.since * g) for g in GAUSS]
        return before + when.since * (5 / 18 * v[0] + 8 / 18 * v[1] + 5 / 18 * v[2])


class Chain:
    """`physics` and the numbers of `/chain`.

    m; k, rho, R, eta between beads, and of each wall or of the ring's contact (or None); `terms`, each kind, parameter, and k of
    the contacts between beads and of the two ends; `more`: on_site, on_site_cubic, drag, resonator_mass, resonator_stiffness (N
    numbers each, or none), and q of a damping of any exponent.
    """

    def __init__(self, physics, m, between, left, right, ring=None, terms=(), more=None):
        self.dt, self.method = float(physics["dt_s"]), physics["method"]
        more = more or {}
        self.m, self.ring, self.loaded = m, ring is not None, bool(np.any(between[1]))
        self.walls = [wall is not None for wall in (left, right)]
        if self.ring:
            left = right = ring
            self.loaded = self.loaded or ring[1] != 0
        none = [0.0, -np.inf, 0.0, 0.0]
        ends = [[none if end is None else end] for end in (left, right)]
        k, self.rho, self.R, self.eta = np.concatenate((np.transpose(ends[0]), between, np.transpose(ends[1])), axis=1)
        alpha = float(physics["alpha"])
        self.laws = [Law("power", alpha, k)] + [Law(*term) for term in terms]
        self.alpha, self.power = alpha, self.laws[0].power
        self.bonds = "bonds" in physics
        self.on_site, self.on_site_cubic, self.drag, self.m_r, self.k_r = (
            more.get(name) for name in ("on_site", "on_site_cubic", "drag", "resonator_mass", "resonator_stiffness")
        )
        self.drives = [Drive(entry, self.dt) for entry in physics.get("drives", ())]
        self.knots = knots([drive.wave for drive in self.drives], self.dt) if physics.get("kernel_version", 2) > 2 else []
        seed = physics.get("seed", 0)
        self.baths = [Bath(entry, m, self.ring, self.dt, seed) for entry in physics.get("baths", ())]
        damping = physics.get("damping") or ()
        self.damped, self.restitution = bool(damping), "restitution" in damping
        self.damping = Power(more["q"]) if more.get("q") else None
        self.strikers = [physics["striker"], *physics.get("strikers", ())]
        self.given = "initial" in physics  # then the state of step 0 is not ours to make
        names = ["u", "v"]
        if self.method == "gear5":
            names += ["q2", "q3", "q4", "q5"]
        elif self.method not in KICKS and self.method != "rk5":
            raise Wrong(f"the method {self.method}")
        names += ["w", "w_v"] * (self.m_r is not None) + ["W"] * (self.damped or self.drag is not None)
        self.names = names + ["drives"] * bool(self.drives) + ["heat"] * bool(self.baths)
        if self.baths and self.method not in KICKS:
            raise Wrong(f"baths with {self.method}")
        if self.method != "rk5" and (self.drag is not None or self.damped):
            raise Wrong(f"damping or drag with {self.method}")
        beyond = (self.on_site, self.on_site_cubic, self.m_r)
        if self.method == "gear5" and (self.ring or terms or self.drives or any(x is not None for x in beyond)):
            raise Wrong("gear5 with what gear5 does not take")

    def step(self, state, n):
        """The state of step n + 1 from that of step n."""
        if self.method == "gear5":
            return self.gear5(state)
        state = self.bathed(state, n, 0)
        for piece in pieces(self.knots, n, self.dt):
            state = self.piece(state, piece)
        return self.bathed(state, n, 1)

    def bathed(self, state, n, half):
        """What baths make of a state before (0) or after (1) step n."""
        if self.baths:
            state = state.copy()
        for bath in reversed(self.baths) if half else self.baths:
            bath.act(state[1], self.part(state, "heat"), n, half)
        return state

    def piece(self, state, piece):
        """The state at the end of a piece of a step."""
        after = self.rk5(state, piece) if self.method == "rk5" else self.kick_and_drift(state, piece)
        if not self.drives:
            return after
        row, before, end = self.part(after, "drives"), self.part(state, "drives"), piece.end()
        for i, drive in enumerate(self.drives):
            if not drive.moves:
                continue
            at, m, x = drive.at, self.m, drive.displacement(end, before[2 * i + 1])
            row[2 * i + 1] = x
            if drive.moves_bead:
                old, new = state[1, at], drive.velocity(end)
                after[0, at], after[1, at] = x, new
                row[2 * i] += 0.5 * m[at] * (new * new) - 0.5 * m[at] * (old * old)
        return after

    def part(self, state, name):
        """A row of a state, to be changed in place; None if this chain has none of that name."""
        return state[self.names.index(name)] if name in self.names else None

    def moved(self, when, row):
        """Displacement and velocity of all that is moved at a time of a step: of "left", "right" and of beads."""
        found = {"left": (0.0, 0.0), "right": (0.0, 0.0)}
        for i, drive in enumerate(self.drives):
            if drive.moves:
                found[drive.at] = drive.displacement(when, row[2 * i + 1]), drive.velocity(when)
        return found

    def approach(self, x, left=0.0, right=0.0):
        """By how much more each bead, and the left wall, has moved than the next one; in a ring the last bead and bead 0."""
        x = np.concatenate(([x[-1] if self.ring else left], x, [x[0] if self.ring else right]))
        return x[:-1] - x[1:]

    def elastic(self, d):
        """P of the first law, and E."""
        p = self.power(d)
        force = self.laws[0].k * p
        for law in self.laws[1:]:
            force = force + law.force(d)
        return p, force

    def contacts(self, d, rate):
        """P, E, f, D and where the contacts are closed."""
        p, elastic = self.elastic(d)
        closed = np.ones(len(d), bool) if self.bonds else d > self.power.z
        f = np.ones_like(d)
        if self.restitution:
            f = np.sqrt(p / d)
        elif self.damping:
            f = self.damping(d) / d
        force = elastic
        if self.damped:
            force = elastic + self.eta * f * rate
            if not self.bonds:
                force = np.where(closed & (force > 0), force, 0.0)
        return p, elastic, f, force, closed

    def on_bead(self, force, u, w):
        """G of each bead, and r."""
        G, r = net(force), None
        if self.on_site is not None:
            pull = self.on_site * u
            if self.on_site_cubic is not None:
                pull = pull + self.on_site_cubic * ((u * u) * u)
            G = G - pull
        if w is not None:
            r = self.k_r * (w - u)
            G = G + r
        return G, r

    def kick_and_drift(self, state, piece):
        state = state.copy()
        u, v = state[:2]
        w, w_v, row = (self.part(state, name) for name in ("w", "w_v", "drives"))
        start = None if row is None else row.copy()
        kicks, drifts, passed, when = KICKS[self.method], DRIFTS[self.method], 0.0, piece.begin()
        at = self.moved(when, start)
        for i, b in enumerate(kicks):
            if i:
                d = drifts[i - 1] * piece.length
                passed += drifts[i - 1]
                u += d * v
                if w is not None:
                    w += d * w_v
                when = piece.end() if i == len(drifts) else piece.within(passed * piece.length)
                at = self.moved(when, start)
                for drive in self.drives:
                    if drive.moves_bead:
                        u[drive.at] = at[drive.at][0]
            h = b * piece.length
            F = self.elastic(self.approach(u, at["left"][0], at["right"][0]) + self.rho)[1] - self.R
            G, r = self.on_bead(F, u, w)
            before = v.copy()
            v += h * (1 / self.m) * G
            if w is not None:
                w_v += np.where(self.m_r == 0, 0.0, h * (1 / self.m_r) * -r)
            for i, drive in enumerate(self.drives):
                j = drive.at
                if not drive.moves:
                    f = drive.force(when)
                    v[j] += h * (1 / self.m[j]) * f
                    row[2 * i] += h * f * (0.5 * (before[j] + v[j]))
                elif j == "left":
                    row[2 * i] += h * (F[0] * at[j][1])
                elif j == "right":
                    row[2 * i] -= h * (F[-1] * at[j][1])
                else:
                    v[j] = before[j]
                    row[2 * i] -= h * (G[j] * at[j][1])
        return state

    def rk5(self, state, piece):
        slopes = []

        def advanced(weights):
            if not weights:
                return state.copy()
            change = weights[0] * slopes[0]
            for weight, slope in zip(weights[1:], slopes[1:]):
                if weight:
                    change = change + weight * slope
            return state + piece.length * change

        for c, weights in STAGES:
            when = piece.end() if c == 1 else piece.within(c * piece.length) if c else piece.begin()
            slopes.append(self.rates(advanced(weights), when, self.part(state, "drives")))
        return advanced(WEIGHTS)

    def rates(self, state, when, start):
        """The derivatives of all rows of a state at a time of a step; moved beads in it are put where they are then."""
        rates = np.zeros_like(state)
        u, v = state[:2]
        w, w_v, row = self.part(state, "w"), self.part(state, "w_v"), self.part(rates, "drives")
        at = self.moved(when, start)
        for drive in self.drives:
            if drive.moves_bead:
                u[drive.at], v[drive.at] = at[drive.at]
        (x_left, v_left), (x_right, v_right) = at["left"], at["right"]
        rate = self.approach(v, v_left, v_right)
        _, elastic, _, force, closed = self.contacts(self.approach(u, x_left, x_right) + self.rho, rate)
        F = force - self.R
        G, r = self.on_bead(F, u, w)
        if self.drag is not None:
            G = G - self.drag * v
        rates[0], rates[1] = v, 1 / self.m * G
        if w is not None:
            self.part(rates, "w")[:] = w_v
            self.part(rates, "w_v")[:] = np.where(self.m_r == 0, 0.0, 1 / self.m_r * -r)
        work = self.part(rates, "W")
        if self.damped:
            power = np.where(closed, (force - elastic) * rate, 0.0)
            work[:-1] = power[1:-1]
            work[-1] = power[0] if self.ring else power[0] + power[-1]
        if self.drag is not None:
            work += self.drag * (v * v)
        for i, drive in enumerate(self.drives):
            j = drive.at
            if not drive.moves:
                f = drive.force(when)
                rates[1, j] += 1 / self.m[j] * f
                row[2 * i] = f * v[j]
            elif j == "left":
                row[2 * i] = F[0] * v_left
            elif j == "right":
                row[2 * i] = 0 - F[-1] * v_right
            else:
                row[2 * i] = 0 - G[j] * v[j]
                rates[0, j] = rates[1, j] = 0.0
        return rates

    def gear5(self, state):
        u, v, q2, q3, q4, q5 = state[:6]
        dt = self.dt
        u_p = u + (dt * v + (((q5 + q4) + q3) + q2))
        v_p = v + (1 / dt) * (2 * q2 + (3 * q3 + (4 * q4 + 5 * q5)))
        force = self.elastic(self.approach(u_p) + self.rho)[1]
        x = (0.5 * (dt * dt) * (1 / self.m)) * net(force - self.R)
        y = x - ((3 * q3 + (6 * q4 + 10 * q5)) + q2)
        u = u_p + 3 / 20 * y
        v = v_p + (251 / 360 / dt) * y
        q3, q4, q5 = ((4 * q4 + 10 * q5) + q3) + 11 / 18 * y, (5 * q5 + q4) + 1 / 6 * y, q5 + 1 / 60 * y
        q3, q4, q5 = (np.where(abs(q) <= 2.0**-900, 0.0, q) for q in (q3, q4, q5))
        return np.array([u, v, x, q3, q4, q5])

    def start(self):
        """The state at step 0."""
        state = np.zeros((len(self.names), len(self.m)))
        for striker in self.strikers:
            if striker["velocity_m_s"]:
                state[1, striker["bead"]] = striker["velocity_m_s"]
        beginning = Piece(0, 0.0, self.dt, True, 0.0, 0.0).begin()
        for i, drive in enumerate(self.drives):
            if drive.moves:
                x = drive.displacement(beginning, 0.0) + 0.0  # never -0
                self.part(state, "drives")[2 * i + 1] = x
                if drive.moves_bead:
                    state[:2, drive.at] = x, drive.velocity(beginning) + 0.0
        if self.m_r is not None:
            self.part(state, "w")[:] = state[0]
        if self.method != "gear5":
            return state
        q = [state[0], state[1] * self.dt]
        d = [self.approach(q[0]) + self.rho, self.approach(q[1])]
        p0, force0 = self.elastic(d[0])
        P = [p0]

        def following(j):
            s = 0.0
            for i in range(1, j + 1):
                s = s + (i * self.alpha - (j - i)) * d[i] * P[j - i]
            return s / (j * d[0])

        for j in range(4):
            if j == 0:
                force = force0 - self.R
            else:
                P.append(following(j))
                force = self.laws[0].k * P[j]
                force = np.where((force0 == 0) | (abs(d[1]) >= d[0]), 0.0, force)
            q.append((self.dt * self.dt / ((j + 1) * (j + 2)) / self.m) * net(force))
            d.append(self.approach(q[-1]))
        state[2:6] = q[2:]
        return state

    def energies(self, state):
        """Kinetic and potential energy, and dissipated and driven work."""
        u, v = state[:2]
        w, w_v, work, row = (self.part(state, name) for name in ("w", "w_v", "W", "drives"))
        x, driven = {}, 0.0
        for i, drive in enumerate(self.drives):
            x[drive.at] = row[2 * i + 1]
            driven = driven + row[2 * i]
        for heat in self.part(state, "heat") if self.baths else ():
            driven = driven + heat
        a = self.approach(u, x.get("left", 0.0), x.get("right", 0.0))
        contact = excess = 0.0
        for law in self.laws:
            beyond = law.excess(a, self.rho)
            excess = excess + beyond
            contact = contact + (law.energy(a + self.rho) if law.kind == "power" else beyond)
        if not self.loaded:
            excess[1:-1] = contact[1:-1]
        left, right = (excess[end] if wall else 0.0 for end, wall in zip((0, -1), self.walls))
        potential = total(excess[1:-1]) + ((excess if self.loaded else contact)[0] if self.ring else left + right)
        kinetic = total(0.5 * self.m * (v * v))
        if self.on_site is not None:
            held = 0.5 * self.on_site * (u * u)
            if self.on_site_cubic is not None:
                held = held + 0.25 * self.on_site_cubic * ((u * u) * (u * u))
            potential = potential + total(held)
        if w is not None:
            kinetic = kinetic + total(0.5 * self.m_r * (w_v * w_v))
            potential = potential + total(0.5 * self.k_r * ((w - u) * (w - u)))
        return kinetic, potential, 0.0 if work is None else total(work), driven
