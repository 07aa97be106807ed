"""Final states of small damped chains from a solver that shares nothing with Beadline.

Writes damped-state-cases.csv and damped-states.csv beside itself (see README.md there), in minutes:

    python3 -m venv VENV && VENV/bin/pip install numpy scipy && VENV/bin/python damped_states.py

As in final_states.py the equations are integrated in units of L, v0 and T by DOP853, and twice more, with looser
tolerances and by LSODA. The force of a damped contact jumps (dashpots) or begins as a fractional power where it
closes: there the error estimate of an adaptive solver makes its steps as short as they have to be. The
work that contacts dissipate is integrated beside the motion, and closes the balance of energies.
"""

import csv
import multiprocessing
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

HERE = Path(__file__).parent
MASS, STIFFNESS, V0 = 1e-3, 1e7, 5.0  # bead mass kg, stiffness N/m^alpha, v0 m/s
PERIODS = 30  # T

CASES = [
    # name, alpha, beads, impurities {bead: mass in bead masses}, (kind, N s/m or coefficient of restitution)
    ("dashpots", 1.5, 12, {}, ("viscous", 0.5)),
    ("strong-dashpots", 1.5, 12, {}, ("viscous", 5.0)),
    ("dashpots-light", 1.5, 12, {5: 0.3}, ("viscous", 0.5)),
    ("dashpots-cubic", 3.0, 12, {5: 3.0}, ("viscous", 1.0)),
    ("restitution", 1.5, 12, {}, ("restitution", 0.9)),
    ("low-restitution", 1.5, 12, {5: 0.3}, ("restitution", 0.5)),
]


def damping_ratio(coefficient):
    """The damping ratio of the oscillator whose force ends with this coefficient of restitution (Schwager and
    Poeschel 2007)."""

    def excess(ratio):
        return np.exp(-2.0 * ratio / np.sqrt(1.0 - ratio * ratio) * np.arccos(ratio)) - coefficient

    return brentq(excess, 1e-12, 1.0 - 1e-9, xtol=1e-15)


def integrate(alpha, mass, eta, exponent, method, rtol, atol, max_step):
    """u (in L), v (in v0) and the dissipated work (in m v0^2) at the end."""
    n = len(mass)

    def rhs(_, y):
        overlap = y[: n - 1] - y[1:n]
        rate = y[n : 2 * n - 1] - y[n + 1 : 2 * n]
        closed = overlap > 0.0
        depth = np.where(closed, overlap, 0.0)
        elastic = depth**alpha
        force = np.where(closed, np.maximum(elastic + eta * depth**exponent * rate, 0.0), 0.0)
        out = np.empty_like(y)
        out[:n] = y[n : 2 * n]
        out[n : 2 * n] = 0.0
        out[n + 1 : 2 * n] += force
        out[n : 2 * n - 1] -= force
        out[n : 2 * n] /= mass
        out[2 * n] = ((force - elastic) * rate).sum()
        return out

    y0 = np.zeros(2 * n + 1)
    y0[n] = 1.0
    solution = solve_ivp(rhs, (0.0, PERIODS), y0, method=method, rtol=rtol, atol=atol, max_step=max_step)
    assert solution.success, solution.message
    y = solution.y[:, -1]
    return y[:n], y[n : 2 * n], y[2 * n]


def solve(case):
    name, alpha, beads, impurities, (kind, value) = case
    length = (MASS * V0 * V0 / STIFFNESS) ** (1.0 / (alpha + 1.0))
    time = length / V0
    mass = np.ones(beads)
    for bead, ratio in impurities.items():
        mass[bead] = ratio
    if kind == "viscous":
        eta, exponent = np.full(beads - 1, value * time / MASS), 0.0
    else:
        reduced = mass[:-1] * mass[1:] / (mass[:-1] + mass[1:])
        eta, exponent = damping_ratio(value) * np.sqrt(2.0 * (alpha + 1.0) * reduced), 0.5 * (alpha - 1.0)
    arguments = (alpha, mass, eta, exponent)
    u, v, work = integrate(*arguments, "DOP853", 1e-12, 1e-13, 0.01)
    u_loose, v_loose, _ = integrate(*arguments, "DOP853", 1e-10, 1e-11, 0.02)
    u_other, v_other, _ = integrate(*arguments, "LSODA", 1e-11, 1e-12, 0.01)
    overlap = np.maximum(u[:-1] - u[1:], 0.0)
    energy = 0.5 * (mass * v * v).sum() + (overlap ** (alpha + 1.0)).sum() / (alpha + 1.0) + work
    balance = abs(energy / (0.5 * mass[0]) - 1.0)
    tolerances = max(abs(u - u_loose).max(), abs(v - v_loose).max())
    methods = max(abs(u - u_other).max(), abs(v - v_other).max())
    # 1e-4 is to be decided
    assert methods < 1e-6 and balance < 1e-8, (case, tolerances, methods, balance)
    masses = " ".join(f"{bead}={ratio * MASS!r}" for bead, ratio in sorted(impurities.items()))
    row = [name, repr(alpha), beads, masses, kind, repr(value), PERIODS]
    row += [f"{error:.0e}" for error in (tolerances, methods, balance)]
    states = [[name, i, f"{a * length:.16e}", f"{b * V0:.16e}"] for i, (a, b) in enumerate(zip(u, v))]
    print(*row, flush=True)
    return row, states


def main():
    with multiprocessing.Pool(2) as pool:
        results = pool.map(solve, CASES, chunksize=1)
    with open(HERE / "damped-state-cases.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            "case,alpha,beads,impurities_kg,damping,value,periods,between_tolerances,between_methods,"
            "energy_error".split(",")
        )
        writer.writerows(row for row, _ in results)
    with open(HERE / "damped-states.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow("case,bead,u_m,v_m_s".split(","))
        writer.writerows(row for _, states in results for row in states)


if __name__ == "__main__":
    main()
