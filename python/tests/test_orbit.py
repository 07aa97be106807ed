"""Periodic orbits."""

from pathlib import Path

import numpy as np
import pytest

import beadline as bl


def ring(beads: int) -> bl.Chain:
    return bl.Chain(beads, mass_kg=1.0, bonds={"linear": 1.0, "cubic": 1.0}, left="periodic", right="periodic")


def test_an_orbit_of_a_chain_and_where_it_becomes_unstable(tmp_path: Path) -> None:
    found = bl.orbit(ring(16), tmp_path / "one", energy_j=0.16, mode={"number": 16, "displacement_m": 0.07})
    assert found.is_stable
    assert found.energy_j == pytest.approx(0.16, rel=1e-12)
    assert found.returns < 1e-12
    # the multipliers of a chain without losses have the product 1
    assert found.multipliers.shape == (32,)
    assert np.prod(found.multipliers) == pytest.approx(1.0, abs=1e-6)
    rec = found.recording
    assert np.abs(rec[-1].displacement_m - rec[0].displacement_m).max() < 1e-12
    with pytest.raises(ValueError, match="one orbit"):
        _ = found.branch
    with pytest.raises(bl.ConfigError, match="chain.bonds.quadratic: the configuration has no such key"):
        found.continue_("chain.bonds.quadratic", 0.3, tmp_path / "branch")
    branch = found.continue_("orbit.energy_j", 0.3, tmp_path / "branch")
    (change,) = branch.changes
    assert change["name"] == "real instability"
    assert change["parameter"] == pytest.approx(0.218181686716, rel=1e-9)
    assert not branch.is_stable
    assert branch.branch["orbit.energy_j"][-1] == 0.3
    # the end of a branch has the value of its key there: thresholds go as 1/cubic
    stiff = found.continue_("chain.bonds.cubic", 2.0, tmp_path / "stiff")
    further = stiff.continue_("orbit.energy_j", 0.08, tmp_path / "further")
    assert further.branch["period_s"][0] == pytest.approx(stiff.period_s, rel=1e-9)
    assert further.changes[0]["parameter"] == pytest.approx(0.218181686716 / 2, rel=1e-9)
    again = further.continue_("orbit.energy_j", 0.07, tmp_path / "again")
    assert again.branch["orbit.energy_j"][0] == pytest.approx(0.08, rel=1e-12)
    assert again.map({"chain.bonds.cubic": [2.0, 2.1], "orbit.energy_j": [0.07, 0.06]}, tmp_path / "map").column("energy_j").shape == (2, 2)


def test_a_driven_chain_follows_its_drive(tmp_path: Path) -> None:
    chain = bl.Chain(
        5,
        mass_kg=1.0,
        alpha=1.5,
        stiffness=1.0,
        left="fixed",
        right="fixed",
        precompression_n=1.0,
        on_site={"drag_n_s_per_m": 0.05},
    )
    drive = {"wall": "left", "displacement_m": {"sine": {"amplitude": 0.2, "frequency_hz": 0.3}}}
    run = bl.Run(chain, drives=[drive], strikers={0: 0.0}, duration_s=10.0)
    found = bl.orbit(run, tmp_path / "shaken")
    assert found.period_s == pytest.approx(1 / 0.3)
    # drag shrinks volumes by exp(−T·Σγ/m)
    assert abs(np.prod(found.multipliers)) == pytest.approx(np.exp(-0.25 / 0.3), rel=1e-8)
    # over two keys, line by line, each of them from this orbit on
    sine = "drive[0].displacement_m.sine"
    grid = {f"{sine}.frequency_hz": (0.298, 0.3, 0.302), f"{sine}.amplitude": np.linspace(0.1, 0.2, 2)}
    shown = found.map(grid, tmp_path / "map")
    assert shown.stability == {"stable": 6} and (shown.path / "map.png").exists()
    sizes = shown.column("largest_multiplier")
    assert sizes.shape == (3, 2)
    assert list(shown.table[f"{sine}.amplitude"]) == [0.1, 0.2] * 3
    assert sizes[1, 1] == pytest.approx(np.abs(found.multipliers).max(), rel=1e-6)
    with pytest.raises(bl.CommandValueError, match="allowed: two"):
        found.map({f"{sine}.amplitude": [0.1, 0.2]}, tmp_path / "line")
    with pytest.raises(bl.CommandError, match="another orbit file"):
        found.map(grid, tmp_path / "shaken")


def test_an_orbit_begins_at_a_state_of_a_file_beside_its_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    seed = bl.Run(ring(8), initial=([0.1, -0.1] * 4, [0.0] * 8), duration_s=1.0).record("seed.mcap")
    run = bl.Run(ring(8), initial={"from": {"recording": "seed.mcap", "step": 0}}, duration_s=1.0)
    monkeypatch.chdir("/")
    found = bl.orbit(run, tmp_path / "orbit", amplitude_m=0.1, period_s=3.0)
    assert found.energy_j == pytest.approx(seed[0].total_j, rel=1e-9)
    assert found.continue_("orbit.amplitude_m", 0.11, tmp_path / "branch").energy_j > found.energy_j


def test_an_orbit_that_is_not_there_says_why(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="run: found 3; expected a beadline.Run or a Chain"):
        bl.orbit(3, tmp_path / "no")  # type: ignore[arg-type]
    with pytest.raises(bl.CommandError, match="orbit.mode: found nothing"):
        bl.orbit(ring(8), tmp_path / "no", energy_j=1.0)
    with pytest.raises(bl.CommandError, match="a mode from 1 to 8"):
        bl.orbit(ring(8), tmp_path / "no", energy_j=1.0, mode={"number": 9, "displacement_m": 0.1})
    assert not (tmp_path / "no").exists()
