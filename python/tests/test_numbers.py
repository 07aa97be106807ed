"""Numbers as users give them: with units, whole, or neither."""

from __future__ import annotations

import datetime
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import beadline as bl
from beadline._numbers import name_and_unit, unit_of

BEADS: dict[str, Any] = {"mass_kg": 1e-3, "alpha": 1.5, "stiffness": 1e7}
STEEL = {"material": "steel", "radius_m": 4.76e-3}
PLAIN = bl.Chain(5, **BEADS)


def pint_of() -> Callable[[Any, str], Any]:
    pint = pytest.importorskip("pint")
    quantity: Callable[[Any, str], Any] = pint.UnitRegistry().Quantity
    return quantity


def astropy_of() -> Callable[[Any, str], Any]:
    units = pytest.importorskip("astropy.units")
    return lambda number, unit: number * units.Unit(unit)


class Short:
    """A quantity that has the symbol of its unit, as those of pint with the format ``~``."""

    def __init__(self, magnitude: float, units: str) -> None:
        self.magnitude, self.units = magnitude, units

    def __mul__(self, factor: float) -> Short:
        return Short(self.magnitude * factor, self.units)

    __rmul__ = __mul__


# each converts by itself: a warning would be one that a unit was dropped
@pytest.mark.extras
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", [pint_of, astropy_of])
def test_quantities_are_converted_to_the_unit_of_their_name(kind: Callable[[], Callable[[Any, str], Any]]) -> None:
    q = kind()
    chain = bl.Chain(
        5,
        mass_kg=q(1.0, "g"),
        alpha=1.5,
        stiffness=q(1e4, "kN / m**(3/2)"),
        impurities={2: q(600.0, "mg")},
        right="fixed",
        precompression_n=q(2.0, "mN"),
        viscous_n_s_per_m=q(5.0, "g/s"),
        on_site={"linear_n_per_m": q([1.0, 2.0, 3.0, 4.0, 5.0], "kN/m")},
    )
    force = {"sine": {"amplitude": q(3.0, "mN"), "frequency_hz": q(2.0, "kHz")}}
    run = bl.Run(
        chain,
        strikers={0: q(18.0, "km/h")},
        drives=[{"bead": 3, "force_n": force}],
        initial=(q(np.zeros(5), "m"), q(np.arange(5.0), "cm/s")),
        duration_s=q(0.1, "ms"),
        method="rk5",
    )
    physics, toml = run.manifest["physics"], run.to_toml()
    assert physics["bead_mass_kg"] == pytest.approx(1e-3, rel=1e-15)
    assert physics["stiffness"] == pytest.approx(1e7, rel=1e-15)
    assert physics["impurities"][0]["mass_kg"] == pytest.approx(6e-4, rel=1e-15)
    assert physics["load"]["precompression_n"] == pytest.approx(2e-3, rel=1e-15)
    assert physics["striker"]["velocity_m_s"] == pytest.approx(5.0, rel=1e-15)
    assert "amplitude = 0.003, frequency_hz = 2000.0" in toml and "viscous_n_s_per_m = 0.005" in toml
    assert "list = [1000.0, 2000.0, 3000.0, 4000.0, 5000.0]" in toml
    assert "velocities_m_s = [0.0, 0.01, 0.02, 0.03, 0.04]" in toml
    assert run.steps == round(1e-4 / run.dt_s)
    heavy = run.replace({"chain.impurities[0].mass_kg": q(2.0, "g")}).manifest["physics"]
    assert heavy["impurities"][0]["mass_kg"] == pytest.approx(2e-3, rel=1e-15)


@pytest.mark.extras
@pytest.mark.parametrize("kind", [pint_of, astropy_of])
def test_a_quantity_of_another_kind_is_refused_with_its_key(kind: Callable[[], Callable[[Any, str], Any]]) -> None:
    q = kind()
    for key, make in {
        "mass_kg": lambda: bl.Chain(5, mass_kg=q(1.0, "mm"), alpha=1.5, stiffness=1e7),
        "stiffness": lambda: bl.Chain(5, mass_kg=1e-3, alpha=1.5, stiffness=q(1e7, "N/m")),
        "chain.bonds.linear": lambda: bl.Chain(5, mass_kg=1e-3, bonds={"linear": q(1e4, "N/m")}),
        "impurities[2]": lambda: bl.Chain(5, **BEADS, impurities={2: q(1.0, "s")}),
        "alpha": lambda: bl.Chain(5, mass_kg=1e-3, alpha=q(1.5, "m"), stiffness=1e7),
        "duration_s": lambda: bl.Run(PLAIN, strikers={0: 5.0}, duration_s=q(1.0, "m")),
        "strikers[0]": lambda: bl.Run(PLAIN, strikers={0: q(5.0, "m")}, duration_s=1e-4),
    }.items():
        with pytest.raises(bl.ConfigError) as raised:
            make()
        assert raised.value.key is not None and key.endswith(raised.value.key.rpartition(".")[2])
        assert "found" in str(raised.value) and "expected a number" in str(raised.value), str(raised.value)


@pytest.mark.extras
def test_lists_grids_and_times_may_have_units() -> None:
    q = pint_of()
    masses = bl.Chain(3, mass_kg=[q(1.0, "g"), q(2.0, "g"), 3e-3], alpha=1.5, stiffness=1e7)
    rec = bl.Run(masses, strikers={0: 5.0}, duration_s=1e-4).simulate()
    assert rec.mass_kg == pytest.approx([1e-3, 2e-3, 3e-3], rel=1e-15)
    assert rec.at(time_s=q(50.0, "us")).step == rec.at(time_s=50e-6).step
    assert len(rec.energies(until_s=q(50.0, "us"))) == len(rec.energies(until_s=50e-6))
    run = bl.preset("band-gap")
    key = "drive[0].displacement_m.sine.frequency_hz"
    for turning in (q(378000.0, "rpm"), q(2 * np.pi * 6300.0, "rad/s"), q(6300.0, "turn/s"), q(6.3, "kHz"), q(6300.0, "1/s")):
        found = run.replace({key: turning}).manifest["physics"]["drives"][0]["displacement_m"]["sine"]["frequency_hz"]
        assert found == pytest.approx(6300.0, rel=1e-14), turning
    table = bl.sweep(bl.Run(PLAIN, strikers={0: 5.0}, duration_s=1e-4), {"striker.velocity_m_s": q([100.0, 200.0], "cm/s")})
    assert table["striker.velocity_m_s"].tolist() == [1.0, 2.0]


@pytest.mark.extras
@pytest.mark.parametrize("kind", [pint_of, astropy_of])
def test_quantities_that_are_in_the_unit_already_are_numbers_too(kind: Callable[[], Callable[[Any, str], Any]]) -> None:
    q = kind()
    # names of units as pint writes them when it is asked to, and astropy always
    for metre, second in ((q(4.76e-3, "m"), q(1e-4, "s")), (Short(4.76e-3, "m"), Short(1e-4, "s"))):
        chain = bl.Chain(5, spheres={"material": "steel", "radius_m": metre}, kuwabara_kono_s=second * 1e-3)
        plain = bl.Chain(5, spheres=STEEL, kuwabara_kono_s=1e-4 * 1e-3)
        run, other = (bl.Run(one, strikers={0: 5.0}, duration_s=1e-3) for one in (chain, plain))
        assert run.manifest["physics"] == other.manifest["physics"]
        assert run.replace({"time.duration_s": second}).manifest["physics"] == other.replace({"time.duration_s": 1e-4}).manifest["physics"]
        for grid in ({"time.duration_s": [second]}, {"time.duration_s": {"from": second, "to": 2 * second, "count": 2}}):
            assert bl.sweep(run, grid)["time.duration_s"][0] == 1e-4
        assert bl.sweep(run, cases=[{"time.duration_s": second}])["time.duration_s"].tolist() == [1e-4]


def test_an_array_of_one_number_is_a_number() -> None:
    run = bl.Run(PLAIN, strikers={0: 5.0}, duration_s=1e-3).replace({"time.duration_s": np.array(1e-4), "disorder": np.array([])})
    assert run.manifest["physics"] == bl.Run(PLAIN, strikers={0: 5.0}, duration_s=1e-4).manifest["physics"]


def test_times_of_python_and_arrays_of_ours_have_units_too() -> None:
    run = bl.Run(PLAIN, strikers={0: 5.0}, duration_s=datetime.timedelta(microseconds=100))  # type: ignore[arg-type]
    assert run.manifest["physics"] == bl.Run(PLAIN, strikers={0: 5.0}, duration_s=1e-4).manifest["physics"]
    with pytest.raises(bl.ConfigError, match="duration_s: found .* in timedelta64"):
        bl.Run(PLAIN, strikers={0: 5.0}, duration_s=np.timedelta64(1, "ms"))  # type: ignore[arg-type]
    rec = run.simulate(every=1)
    again = bl.Run(PLAIN, initial=(rec.displacement[-1], rec.velocity[-1]), duration_s=1e-5)
    assert again.simulate()[0].velocity_m_s.tolist() == rec[-1].velocity_m_s.tolist()
    with pytest.raises(bl.ConfigError, match=r"displacements_m: found .* in m/s; expected .* multiple of m"):
        bl.Run(PLAIN, initial=(rec.velocity[-1], rec.velocity[-1]), duration_s=1e-5)


@pytest.mark.parametrize(
    "beside", [{"mass_kg": 5.0}, {"stiffness": 1e7}, {"mass_kg": [5.0, 5.0]}, {"stiffness": [1e7]}, {"mass_kg": 4.2e-3, "alpha": 1.5}]
)
def test_spheres_have_no_other_mass_or_stiffness(beside: dict[str, Any]) -> None:
    with pytest.raises(bl.ConfigError, match="spheres"):
        bl.Run(bl.Chain(2, spheres=STEEL, **beside), strikers={0: 1.0}, duration_s=1e-4)


def test_spheres_of_a_run_are_changed_by_their_radius() -> None:
    run = bl.Run(bl.Chain(2, spheres=STEEL), strikers={0: 1.0}, duration_s=1e-4)
    twice = run.replace({"chain.spheres.radius_m": 2 * 4.76e-3}).manifest["physics"]
    assert twice["bead_mass_kg"] == pytest.approx(8 * run.manifest["physics"]["bead_mass_kg"], rel=1e-12)


def test_what_is_no_number_is_told_with_its_key() -> None:
    for key, make in {
        "beads": lambda: bl.Chain(float("inf"), **BEADS),  # type: ignore[arg-type]
        "mass_kg": lambda: bl.Chain(5, mass_kg="heavy", alpha=1.5, stiffness=1e7),  # type: ignore[arg-type]
        "alpha": lambda: bl.Chain(5, mass_kg=1e-3, alpha="x", stiffness=1e7),  # type: ignore[arg-type]
        "impurities[2]": lambda: bl.Chain(5, **BEADS, impurities={2: None}),  # type: ignore[dict-item]
        "initial": lambda: bl.Run(PLAIN, initial=(np.zeros(5), np.zeros(5), np.zeros(5)), duration_s=1e-4),  # type: ignore[arg-type]
        "drives": lambda: bl.Run(PLAIN, drives=5, duration_s=1e-4),  # type: ignore[arg-type]
        "disorder[0]": lambda: bl.Chain(5, **BEADS, disorder=["masses"]),  # type: ignore[list-item]
        "on_site": lambda: bl.Chain(5, **BEADS, on_site=3),  # type: ignore[arg-type]
    }.items():
        with pytest.raises(bl.ConfigError) as raised:
            make()
        assert raised.value.key == key and str(raised.value).startswith(f"{key}: found "), str(raised.value)
    with pytest.raises(bl.ConfigError, match="found {'masses'}; expected a number, a text"):
        bl.Run.from_config({"chain": {"beads": {"masses"}}})


def test_nan_is_found_rather_than_missing() -> None:
    for key in ("mass_kg", "alpha", "stiffness"):
        with pytest.raises(bl.ConfigError, match="found nan"):
            bl.Run(bl.Chain(5, **{**BEADS, key: float("nan")}), strikers={0: 5.0}, duration_s=1e-4)
    with pytest.raises(bl.ConfigError, match="duration_s: found NaN"):
        bl.Run(PLAIN, strikers={0: 5.0}, duration_s=float("nan"))


def test_counts_are_whole_and_fit() -> None:
    run = bl.Run(PLAIN, strikers={0: 5.0}, duration_s=1e-4)
    rec = run.simulate(every=10.0)  # type: ignore[arg-type]
    for name, ask in {
        "every": lambda: run.simulate(every=2**70),
        "on_frame_every": lambda: run.simulate(on_frame=print, on_frame_every=0),
        "steps": lambda: run.start().step(-1),
        "most_bytes": lambda: next(rec.velocity.blocks(-5)),
        "jobs": lambda: bl.sweep(run, {"chain.alpha": [1.5]}, jobs=0),
        "rows": lambda: rec.energies().head(-1),
        "timeout_s": lambda: bl.attach("x", timeout_s=-1.0),
        "time_s": lambda: rec.at(time_s="noon"),  # type: ignore[arg-type]
    }.items():
        with pytest.raises(ValueError, match=f"^{name}: found "):
            ask()
    for every in (0, 2.5):
        for ask in (
            rec.to_xarray,
            lambda every: list(rec.states(every=every)),
            lambda every: rec.share("x.html", every=every),
            lambda every: rec.to_hdf5("x.h5", every=every),
            lambda every: rec.to_parquet("x.parquet", every=every),
            lambda every: rec.to_zarr("x.zarr", every=every),
            lambda every: rec.sel(bead=0, every=every),
        ):
            with pytest.raises(ValueError, match=f"^every: found {every}; expected "):
                ask(every=every)  # type: ignore[operator]


def test_units_are_those_that_names_end_with() -> None:
    for name, unit in {
        "mass_kg": "kg",
        "chain.impurities[0].mass_kg": "kg",
        "v_40_m_s": "m/s",
        "gravity_m_s2": "m/s**2",
        "viscous_n_s_per_m": "N*s/m",
        "cubic_n_per_m3": "N/m**3",
        "momentum_n_s": "N*s",
        "density_kg_m3": "kg/m**3",
        "psd_bead_10_m2_s2_hz": "m**2/s**2/Hz",
        "steepness_per_m": "1/m",
        "speed_beads_per_s": "beads/s",
        "speed_beads_s": "beads/s",
        "momentum_kg_m_s": "kg*m/s",
        "momentum_kg2_m2_s2": "kg**2*m**2/s**2",
        "mean_current_w": "W",
        "autocorrelation_w2": "W**2",
        "temperature_k": "K",
        "phase_rad": "rad",
        "deformation.impulse_n_s@5": "N*s",
        "forces.peak_n@wall:left": "N",
        "impurity.first@5": None,
        "split_bead": None,
        "first_compressed_contact": None,
        "step": None,
    }.items():
        assert unit_of(name) == unit, name


def test_a_place_stays_in_words() -> None:
    assert name_and_unit("deformation.impulse_n_s@5") == ("impulse@5", "N*s")
    assert name_and_unit("impurity.first@5") == ("first@5", None)


def test_a_long_run_is_told_of_and_one_of_years_is_refused() -> None:
    chain = bl.Chain(1000, **BEADS)
    # 3e8 steps of some µs
    long = bl.Run(chain, strikers={0: 5.0}, duration_s=300.0, dt_s=1e-6)
    ended = {"on_frame": lambda state: True, "every": 10**8}
    with pytest.warns(RuntimeWarning, match=r"this takes at least .*; yes=True begins without"):
        long.simulate(**ended)  # type: ignore[arg-type]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert long.simulate(yes=True, **ended).last_step == 0  # type: ignore[arg-type]
    absurd = long.replace({"time.duration_s": 1e9})
    with pytest.raises(ValueError, match="years, which looks like a mistake"):
        absurd.simulate(every=10**14)
    with pytest.raises(MemoryError, match="keep fewer with every="):
        absurd.simulate(every=1)
