"""A chain of beads with Hertz contacts and free ends, by velocity-Verlet in loops that Numba compiles.

    chain_numba.py fused     one loop over the beads for each step
    chain_numba.py apart     three loops for each step, each of which a compiler can vectorise

Reads chain.json, prints the time of the loop and the last velocities as JSON. With "every", each so many steps a
state is kept, and all are saved as states.npy within the time. Compiling is not in it.
"""

import json
import sys
import time
from math import sqrt

import numpy as np
from numba import njit


@njit
def fused(u, v, force, mass, k, dt, steps, every, states):
    n = len(u)
    half = 0.5 * dt
    per_mass = 1.0 / mass
    a = (force[:-1] - force[1:]) * per_mass
    for step in range(1, steps + 1):
        from_left = 0.0
        v_i = v[0] + half * a[0]
        u_i = u[0] + dt * v_i
        for i in range(n - 1):
            v_next = v[i + 1] + half * a[i + 1]
            u_next = u[i + 1] + dt * v_next
            overlap = u_i - u_next
            to_right = k * overlap * sqrt(overlap) if overlap > 0.0 else 0.0
            a_i = (from_left - to_right) * per_mass[i]
            u[i], v[i], a[i] = u_i, v_i + half * a_i, a_i
            u_i, v_i, from_left = u_next, v_next, to_right
        a[n - 1] = from_left * per_mass[n - 1]
        u[n - 1], v[n - 1] = u_i, v_i + half * a[n - 1]
        if every > 0 and step % every == 0:
            states[step // every, 0] = u
            states[step // every, 1] = v


@njit
def apart(u, v, force, mass, k, dt, steps, every, states):
    n = len(u)
    half = 0.5 * dt
    per_mass = 1.0 / mass
    a = (force[:-1] - force[1:]) * per_mass
    for step in range(1, steps + 1):
        for i in range(n):
            v[i] += half * a[i]
            u[i] += dt * v[i]
        for i in range(n - 1):
            overlap = max(u[i] - u[i + 1], 0.0)
            force[i + 1] = k * overlap * sqrt(overlap)
        for i in range(n):
            a[i] = (force[i] - force[i + 1]) * per_mass[i]
            v[i] += half * a[i]
        if every > 0 and step % every == 0:
            states[step // every, 0] = u
            states[step // every, 1] = v


def forces(u, k):
    """Of the contact left of each bead, and of none beyond the last."""
    overlap = np.maximum(u[:-1] - u[1:], 0.0)
    return np.concatenate(([0.0], k * overlap * np.sqrt(overlap), [0.0]))


with open("chain.json") as file:
    chain = json.load(file)
u, v, mass = (np.array(chain[name]) for name in ("u_m", "v_m_s", "mass_kg"))
k, dt, steps, every = (chain[name] for name in ("stiffness", "dt_s", "steps", "every"))
run = {"fused": fused, "apart": apart}[sys.argv[1]]
run(u.copy(), v.copy(), forces(u, k), mass, k, dt, 1, 0, np.empty((0, 2, len(u))))

began = time.perf_counter()
states = np.empty((steps // every + 1 if every else 0, 2, len(u)))
if every:
    states[0] = u, v
run(u, v, forces(u, k), mass, k, dt, steps, every, states)
if every:
    np.save("states.npy", states)
loop_s = time.perf_counter() - began
print(json.dumps({"loop_s": loop_s, "v_m_s": v.tolist()}))
