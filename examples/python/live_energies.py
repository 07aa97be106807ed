"""Energies of a run while it goes: `python live_energies.py [RUN] > energies.csv`."""

import sys

import numpy as np
from beadline_live import Lost, NoRun, Run

# keys of `physics` of chains that have more energies than those of one power law
MORE = {"alphas", "second", "gaps_m", "bonds", "on_site", "resonators", "drives"}


def potential_energy(run):
    """A function of the displacements: the energy (J) of all contacts and walls beyond that at rest."""
    chain, physics = run.chain, run.manifest["physics"]
    power = physics["alpha"] + 1
    if MORE & set(physics) or "periodic" in physics.get("ends", {}).values():
        sys.exit("this program has the energies of contacts of one power law only: see `beadline energies`")
    # a wall is a contact with a neighbour that stays at 0
    k, rest, force = (
        np.concatenate(([left], inner, [right]))
        for left, inner, right in zip(chain.left_wall, chain[1:4], chain.right_wall)
    )

    def potential(u):
        overlap = np.concatenate(([0], u)) - np.concatenate((u, [0])) + rest
        squeezed = np.maximum(overlap, 0)
        return np.sum(k / power * (squeezed**power - rest**power) - force * (overlap - rest))

    return potential


def main(name=None):
    print("waiting for the run", name or "", file=sys.stderr)
    with Run(name, label="energies-py") as run:
        potential_of, mass = potential_energy(run), run.chain.mass
        print("frame,step,time_s,kinetic_j,potential_j,total_j")
        frame = None
        for frame in run:
            kinetic, potential = np.sum(mass * frame.v**2) / 2, potential_of(frame.u)
            print(frame.frame, frame.step, frame.time_s, kinetic, potential, kinetic + potential, sep=",")
    frames = f"frames {run.first_frame} to {frame.frame}" if frame else "no frames"
    print(f"{run.name}: {run.end}, {frames}", file=sys.stderr)


try:
    main(*sys.argv[1:])
except (NoRun, Lost) as error:
    sys.exit(str(error))
except KeyboardInterrupt:
    sys.exit("stopped; the run goes on")
