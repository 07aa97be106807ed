"""Chains of every kind: what moves them, what holds them, what they lose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import beadline as bl

BEADS = bl.Chain(20, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
BEADS_AT_REST = (np.zeros(20), np.zeros(20))
SPRINGS = bl.Chain(9, mass_kg=1e-3, bonds={"linear": 1e4}, left="fixed", right="fixed")


def total_j(rec: bl.Recording) -> float:
    energy_j: float = rec.energies()["total_j"][-1]
    return energy_j


def test_several_beads_strike() -> None:
    rec = bl.Run(BEADS, strikers={0: 5.0, 19: -5.0}, duration_s=5e-4).simulate()
    assert np.flatnonzero(rec[0].velocity_m_s).tolist() == [0, 19]
    # a mirror: so many velocities of some m/s sum up to rounding
    assert np.abs(rec[-1].velocity_m_s + rec[-1].velocity_m_s[::-1]).max() < 1e-10
    with pytest.raises(bl.ConfigError, match="striker"):
        bl.Run(BEADS, strikers={0: 5.0, 99: -5.0}, duration_s=1e-3)
    with pytest.raises(bl.ConfigError):
        bl.Run(BEADS, duration_s=1e-3)


@pytest.mark.parametrize("initial", [([], []), {"velocities_m_s": []}, {"displacements_m": np.array([])}])
def test_an_empty_list_is_no_state_at_rest(initial: Any) -> None:
    with pytest.raises(bl.ConfigError, match=r"initial\.\w+: found \[\]; allowed: a value for each bead"):
        bl.Run(BEADS, strikers={0: 5.0}, initial=initial, duration_s=1e-4)
    with pytest.raises(bl.ConfigError, match="gaps_m: found 0 values; allowed: 19"):
        bl.Run(bl.Chain(20, mass_kg=1e-3, alpha=1.5, stiffness=1e7, gaps_m=[]), strikers={0: 5.0}, duration_s=1e-4)


def test_a_run_begins_from_a_state_of_another_to_the_bit() -> None:
    run = bl.Run(BEADS, strikers={0: 5.0}, duration_s=5e-4, dt_s=5e-7)
    rec = run.simulate()
    again = run.starting_from(rec[300]).replace({"time.duration_s": 1e-4}).simulate()
    assert np.array_equal(again[0].velocity_m_s, rec[300].velocity_m_s)
    assert np.array_equal(again[200].displacement_m, rec[500].displacement_m)
    u_m, v_m_s = np.linspace(0.0, -1e-6, 20), rec[300].velocity_m_s.copy()
    v_m_s[7] *= 2.0
    changed = bl.Run(BEADS, initial=(u_m, v_m_s), duration_s=1e-4).simulate()
    assert changed[0].displacement_m.tolist() == u_m.tolist()
    assert changed[0].velocity_m_s.tolist() == v_m_s.tolist()
    with pytest.raises(bl.ConfigError, match="displacements_m"):
        run.starting_from(([0.0], [0.0]))


@pytest.mark.parametrize(
    "law", [{"alpha": 1.5, "stiffness": 1e7}, {"alpha": 1.5, "stiffness": 1e7, "precompression_n": 10.0}, {"bonds": {"linear": 1e7}}]
)
def test_a_run_that_goes_on_from_a_state_has_the_drag_of_its_ends(law: dict[str, Any]) -> None:
    chain = bl.Chain(30, mass_kg=1e-3, **law, right="absorbing")
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=2e-3, dt_s=5e-7)
    rec = run.simulate()
    again = run.starting_from(rec[2500]).simulate()
    assert all(np.array_equal(again[step].velocity_m_s, rec[2500 + step].velocity_m_s) for step in (1, 700, 1500))


def test_a_mode_of_springs_swings_with_its_frequency() -> None:
    initial = {"mode": {"number": 2, "displacement_m": 1e-3}}
    rec = bl.Run(SPRINGS, initial=initial, duration_s=5e-3, dt_s=2e-6, method="rkn4").simulate()
    omega = 2.0 * np.sqrt(1e4 / 1e-3) * np.sin(np.pi * 2 / 20)
    expected = rec[0].displacement_m * np.cos(omega * rec[-1].time_s)
    # fourth order: (ω·Δ)⁴ of ω·t = 10
    assert np.abs(rec[-1].displacement_m - expected).max() < 1e-3 * 1e-8


def test_a_piston_works_as_much_as_the_chain_gains() -> None:
    chain = bl.Chain(20, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed")
    rec = bl.Run(chain, drives=[{"wall": "left", "velocity_m_s": 2.0}], duration_s=5e-4).simulate()
    state = rec[-1]
    assert state.drive_displacement_m == pytest.approx([2.0 * state.time_s], rel=1e-12)
    # the error of the method
    assert state.drive_work_j == pytest.approx([total_j(rec)], rel=1e-6)
    left_n, right_n = rec[100].wall_force_n
    assert left_n > 0.0 and right_n == 0.0
    assert rec.rest_force_n.max() == 0.0 and state.dissipated_j.size == 0


def test_resonators_take_part_in_the_momentum() -> None:
    chain = bl.Chain(
        12, mass_kg=1e-3, alpha=1.5, stiffness=1e7, resonators={"mass_kg": [5e-4] * 12, "stiffness_n_per_m": 1e6}
    )
    rec = bl.Run(chain, strikers={0: 1.0}, duration_s=5e-4).simulate()
    state = rec[-1]
    momentum = state.velocity_m_s.sum() * 1e-3 + state.resonator_velocity_m_s.sum() * 5e-4
    assert momentum == pytest.approx(1e-3, rel=1e-12)
    assert rec.resonator_velocity[-1, 3] == state.resonator_velocity_m_s[3]
    block = np.asarray(rec.resonator_displacement[100:200:50, 2:5])
    assert block[1].tolist() == rec[150].resonator_displacement_m[2:5].tolist()
    plain = bl.Run(BEADS, strikers={0: 1.0}, duration_s=1e-4).simulate()
    assert plain[0].resonator_displacement_m.size == 0
    with pytest.raises(AttributeError, match="no resonators"):
        plain.resonator_velocity  # noqa: B018


def test_what_is_lost_is_dissipated() -> None:
    chain = bl.Chain(
        10,
        mass_kg=1e-3,
        alpha=1.5,
        stiffness=1e7,
        on_site={"linear_n_per_m": 1e3, "drag_n_s_per_m": 0.1},
        kuwabara_kono_s=1e-6,
    )
    rec = bl.Run(chain, strikers={0: 1.0}, duration_s=1e-3).simulate()
    assert rec.manifest["physics"]["method"] == "rk5"
    energies_j = rec.energies()["total_j"]
    # the error of the method
    assert rec[-1].dissipated_j.sum() == pytest.approx(energies_j[0] - energies_j[-1], rel=1e-6)
    force_n = rec[-1].force_n
    assert force_n.shape == (9,) and force_n.min() >= 0.0


def test_disorder_follows_from_the_seed() -> None:
    chain = bl.Chain(50, mass_kg=1e-3, alpha=1.5, stiffness=1e7, disorder=[{"of": "masses", "uniform": 0.2}])

    def masses(seed: int) -> list[float]:
        found: list[float] = bl.Run(chain, strikers={0: 1.0}, seed=seed, duration_s=1e-4).simulate().mass_kg.tolist()
        return found

    assert masses(1) == masses(1) != masses(2)
    assert 0.8e-3 <= min(masses(1)) < 0.9e-3 and 1.1e-3 < max(masses(1)) <= 1.2e-3


def test_spheres_and_every_other_contact_can_be_said() -> None:
    steel = {"density_kg_m3": 7800.0, "young_pa": 193e9, "poisson": 0.3, "radius_m": 5e-3}
    spheres = bl.Chain(4, spheres=steel, odd_spheres=[{"bead": 2, "material": "brass", "radius_m": 5e-3}])
    rec = bl.Run(spheres, strikers={0: 0.1}, duration_s=1e-4).simulate()
    assert rec.mass_kg[0] == pytest.approx(4 / 3 * np.pi * 5e-3**3 * 7800.0)
    # two equal spheres: E·√(2·R)/(3·(1 − ν²))
    assert rec.stiffness[0] == pytest.approx(193e9 * np.sqrt(2 * 5e-3) / (3 * (1 - 0.3**2)))
    ring = bl.Chain(
        6, mass_kg=1.0, bonds={"toda": {"stiffness": 1.0, "steepness_per_m": 1.0}}, left="periodic", right="periodic"
    )
    rec = bl.Run(ring, initial=(np.zeros(6), [1.0, 0, 0, 0, 0, 0]), duration_s=3.0, dt_s=0.01).simulate()
    assert total_j(rec) == pytest.approx(0.5, rel=1e-6)
    # the momentum goes round, and the ring is closed: bead 5 feels bead 0 at once
    assert rec[-1].velocity_m_s.sum() == pytest.approx(1.0, rel=1e-12)
    assert abs(rec[10].velocity_m_s[5]) > 1e-3
    # the last contact closes it
    state = rec[-1]
    overlap_m = state.displacement_m - np.roll(state.displacement_m, -1)
    assert np.array_equal(state.overlap_m, overlap_m) and np.array_equal(rec.overlap[-1], overlap_m)
    assert state.force_n == pytest.approx(np.expm1(overlap_m), rel=1e-12)
    assert rec.force.shape == (len(rec.steps), 6) and rec.stiffness.size == rec.rest_force_n.size == 6
    of_each = bl.Chain(
        4, mass_kg=1e-3, alpha=1.5, stiffness=1e7, alphas=[1.5, 2.0, 1.5], gaps_m=np.array([0.0, 1e-6, 0.0])
    )
    assert bl.Run(of_each, strikers={0: 1.0}, duration_s=1e-4).simulate().rest_overlap_m.tolist() == [0.0, -1e-6, 0.0]
    two = bl.Chain(4, mass_kg=1e-3, alpha=1.5, stiffness=1e7, second={"alpha": 3.0, "stiffness": 1e12})
    state = bl.Run(two, strikers={0: 1.0}, duration_s=1e-4).simulate()[40]
    overlap_m = np.maximum(state.overlap_m, 0.0)
    assert state.force_n == pytest.approx(1e7 * overlap_m**1.5 + 1e12 * overlap_m**3, rel=1e-12)


def test_files_that_a_configuration_names_are_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "push.csv").write_text("time_s,value\n0,0\n1e-4,1\n2e-4,0\n3e-4,0\n")
    config = {
        "chain": {"beads": 5, "bead_mass_kg": 1e-3, "alpha": 1.5, "stiffness": 1e7},
        "drive": [{"bead": 0, "force_n": {"csv": "push.csv", "interpolation": "linear"}}],
        "time": {"duration_s": np.float64(3e-4)},
        "name": None,
    }
    with pytest.raises(bl.ConfigError, match="push.csv"):
        bl.Run.from_config(config)
    monkeypatch.chdir(tmp_path)
    run = bl.Run.from_config(config)
    (tmp_path / "push.toml").write_text(run.to_toml())
    monkeypatch.chdir("/")
    again = bl.Run.from_toml(tmp_path / "push.toml")
    shorter = again.replace({"time.duration_s": 2.5e-4})
    assert again.manifest["physics"] == run.manifest["physics"]
    # an impulse of 1 N · 1e-4 s: all of it in the beads; linear pieces, so all but the corners is exact
    state = shorter.simulate()[-1]
    assert state.velocity_m_s.sum() * 1e-3 == pytest.approx(1e-4, rel=1e-3)


def test_a_run_of_a_recording_has_its_numbers_whatever_files_say_now(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(number: int) -> None:
        (tmp_path / "push.csv").write_text(f"time_s,value\n0,0\n1e-4,{number}\n3e-4,{number}\n")

    write(1)
    monkeypatch.chdir(tmp_path)
    bl.Run(BEADS, strikers={0: 5.0}, duration_s=1e-4, seed=1).record("first.mcap")
    push = {"csv": "push.csv", "interpolation": "cubic"}
    drives = [{"bead": 0, "force_n": {"sine": {"amplitude": 0.0, "frequency_hz": 1e3}}}, {"bead": 1, "force_n": push}]
    baths = [{"beads": 1, "temperature_k": push, "friction_per_s": 1.0}, {"beads": 2, "temperature_j": 1e-9, "friction_per_s": 1.0}]
    begun: dict[str, Any] = {"from": {"recording": "first.mcap", "step": 20}}
    runs = [
        bl.Run(BEADS, strikers={0: 1.0}, drives=drives, baths=baths, initial=begun, seed=1, duration_s=2e-4),
        bl.Run(BEADS, strikers={0: 1.0}, initial={**begun, "thermal": {"energy_j": 1e-6}}, duration_s=2e-4),
        bl.Run(BEADS, strikers={0: 1.0}, initial={**begun, "energy_per_bead_j": 1e-3}, seed=3, duration_s=2e-4),
    ]
    recordings = [(run, rec) for run in runs for rec in (run.record("run.mcap", force=True), run.simulate())]
    write(2)
    (tmp_path / "first.mcap").unlink()
    monkeypatch.chdir("/")
    for run, rec in recordings:
        again = bl.Run.from_recording(rec)
        changed = again.replace({"provenance.author": "J. Doe"})
        assert changed.manifest["physics"] == again.manifest["physics"] == run.manifest["physics"]
        assert bl.Run.from_recording(changed.simulate()).manifest["physics"] == run.manifest["physics"]
        (sha256,) = bl.sweep(again)["physics_sha256"]
        assert sha256 == bl.sweep(changed)["physics_sha256"][0]
    with pytest.raises(bl.ConfigError, match="^initial.from.step: found a state that has been read"):
        again.replace({"initial.from.step": 0})
    driven = bl.Run.from_recording(recordings[1][1]).starting_from(BEADS_AT_REST).manifest["physics"]["drives"]
    assert driven == runs[0].manifest["physics"]["drives"] and driven[1]["force_n"]["table"]["values"] == [0.0, 1.0, 1.0]
    # a text that names none stays as it is
    plain = bl.Run(BEADS, strikers={0: 1.0}, duration_s=1e-4).simulate()
    assert bl.Run.from_recording(plain).to_toml() == plain.toml


def test_the_state_of_a_recording_has_its_resonators(tmp_path: Path) -> None:
    resonators = {"mass_kg": 1e-3, "stiffness_n_per_m": 1e5}
    chain = bl.Chain(beads=6, mass_kg=1e-3, alpha=1.5, stiffness=1e7, resonators=resonators)
    rec = bl.Run(chain, strikers={0: 1.0}, duration_s=1e-4).record(tmp_path / "before.mcap")
    begun = {"from": {"recording": str(tmp_path / "before.mcap"), "step": 20}}
    first = bl.Run(chain, initial=begun, duration_s=1e-4).simulate()[0]
    for name in ("displacement_m", "velocity_m_s", "resonator_displacement_m", "resonator_velocity_m_s"):
        assert getattr(first, name).tolist() == getattr(rec[20], name).tolist() and any(getattr(first, name))


def test_one_of_two_values_for_the_same_is_not_ignored() -> None:
    law: dict[str, Any] = {"mass_kg": 1e-3, "alpha": 1.5, "stiffness": 1e7}
    for name, other, values in (
        ("mass_kg", "masses", {"mass_kg": [1e-3, 2e-3, 3e-3], "masses": {"taper": 0.5}}),
        ("stiffness", "stiffnesses", {"stiffness": [1e7, 2e7], "stiffnesses": "radii"}),
        ("left", "ends.left", {"left": "fixed", "ends": {"left": "free"}}),
        ("right_stiffness", "ends.right_stiffness", {"right": "fixed", "right_stiffness": 1e7, "ends": {"right_stiffness": 2e7}}),
    ):
        with pytest.raises(bl.ConfigError, match=f"^{name}: found it beside {other}; expected one of them") as raised:
            bl.Chain(3, **{**law, **values})
        assert raised.value.key == name
    chain = bl.Chain(3, **law, left="fixed", masses={"taper": 0.5}, ends={"right": "fixed", "left_stiffness": 2e7})
    ends = bl.Run(chain, strikers={0: 1.0}, duration_s=1e-4).manifest["physics"]["ends"]
    assert (ends["left"], ends["right"], ends["left_stiffness"]) == ("fixed", "fixed", 2e7)


def test_baths_give_the_heat_that_a_chain_has() -> None:
    chain = bl.Chain(beads=8, mass_kg=1.0, bonds={"linear": 1.0}, left="fixed", right="fixed")
    baths = [
        {"beads": 0, "temperature_j": 1.5, "friction_per_s": 0.5},
        {"beads": -1, "temperature_j": 0.5, "friction_per_s": 0.5},
    ]
    run = bl.Run(chain, baths=baths, seed=3, duration_s=50.0, dt_s=0.05)
    rec = run.simulate()
    state = rec[-1]
    assert state.heat_j.shape == (8,) and not state.heat_j[1:-1].any()
    assert state.total_j == pytest.approx(state.heat_j.sum(), rel=1e-6)
    assert np.array_equal(rec[500].heat_j, run.simulate()[500].heat_j)
    assert bl.Run(chain, strikers={0: 1.0}, duration_s=1.0).simulate()[-1].heat_j.size == 0
    with pytest.raises(bl.ConfigError, match=r"bath\[0\].beads"):
        bl.Run(chain, baths=[{**baths[0], "beads": 8}], duration_s=1.0)
