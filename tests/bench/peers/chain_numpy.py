"""A chain of beads with Hertz contacts and free ends, by velocity-Verlet with NumPy.

Reads chain.json, prints the time of the loop and the last velocities as JSON. With "every", each so many steps a
state is kept, and all are saved as states.npy within the time.
"""

import json
import time

import numpy as np


def run(u, v, mass, k, dt, steps, every):
    force = np.zeros(len(u) + 1)  # of the contact left of each bead, and of none beyond the last
    overlap = np.empty(len(u) - 1)
    root = np.empty(len(u) - 1)
    change = np.empty(len(u))
    half_dt_over_m = 0.5 * dt / mass

    def kick():
        np.subtract(force[:-1], force[1:], out=change)
        np.multiply(change, half_dt_over_m, out=change)
        np.add(v, change, out=v)

    def find_forces():
        np.subtract(u[:-1], u[1:], out=overlap)
        np.maximum(overlap, 0.0, out=overlap)
        np.sqrt(overlap, out=root)
        np.multiply(overlap, root, out=overlap)
        np.multiply(overlap, k, out=force[1:-1])

    states = np.empty((steps // every + 1, 2, len(u))) if every else None
    if every:
        states[0] = u, v
    find_forces()
    for step in range(1, steps + 1):
        kick()
        np.multiply(v, dt, out=change)
        np.add(u, change, out=u)
        find_forces()
        kick()
        if every and step % every == 0:
            states[step // every] = u, v
    return states


with open("chain.json") as file:
    chain = json.load(file)
u, v, mass = (np.array(chain[name]) for name in ("u_m", "v_m_s", "mass_kg"))
began = time.perf_counter()
states = run(u, v, mass, chain["stiffness"], chain["dt_s"], chain["steps"], chain["every"])
if chain["every"]:
    np.save("states.npy", states)
loop_s = time.perf_counter() - began
print(json.dumps({"loop_s": loop_s, "v_m_s": v.tolist()}))
