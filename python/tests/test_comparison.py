"""Two recordings beside each other, whatever their chains and time steps."""

from __future__ import annotations

import json
import urllib.request
from typing import Any

import numpy as np
import pytest
from test_xarray import any_run

import beadline as bl

CHAIN = {"mass_kg": 1e-3, "alpha": 1.5, "stiffness": 1e7}


def struck(beads: int = 20, dt_s: float = 1e-6, duration_s: float = 1e-3, **chain: Any) -> bl.Run:
    return bl.Run(bl.Chain(beads, **CHAIN, **chain), strikers={0: 5.0}, duration_s=duration_s, dt_s=dt_s)


def cubic(rec: bl.Recording, time_s: float) -> list[np.ndarray[Any, Any]]:
    """Displacement and velocity of the cubic with those of the two steps around a time, as a system of equations."""
    before = min(int(time_s / rec.dt_s), rec.last_step - 1)
    one, other = rec[before], rec[before + 1]
    # c0 + c1·x + c2·x² + c3·x³ and its slope, at x = 0 and 1
    rows = [[1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 1, 1], [0, 1, 2, 3]]
    sides = [one.displacement_m, rec.dt_s * one.velocity_m_s, other.displacement_m, rec.dt_s * other.velocity_m_s]
    c, x = np.linalg.solve(np.array(rows, float), np.array(sides)), time_s / rec.dt_s - before
    return [c[0] + c[1] * x + c[2] * x**2 + c[3] * x**3, (c[1] + 2 * c[2] * x + 3 * c[3] * x**2) / rec.dt_s]


@pytest.mark.parametrize("seed", range(8))
def test_any_two_runs_differ_by_what_their_states_say(seed: int) -> None:
    run = any_run(seed)
    a, same = run.simulate(every=7), run.replace({"time.duration_s": 1.5e-4}).simulate(every=13)
    difference = bl.compare(a, same).difference
    assert (difference.first_step, difference.last_step) == (0, same.last_step)
    # the steps of one run are those of the other, to the bit
    assert not np.any(difference.displacement) and not np.any(difference.velocity)
    b = run.replace({"time.dt_s": 0.7e-6}).simulate(every=11)
    difference = bl.compare(a, b).difference
    steps = [0, 3, 14, 77, difference.last_step]
    for row, (name, attribute) in enumerate((("displacement", "displacement_m"), ("velocity", "velocity_m_s"))):
        found = getattr(difference, name)[steps]
        for step, values in zip(steps, np.asarray(found), strict=True):
            own, others = getattr(a[step], attribute), cubic(b, step * a.dt_s)[row]
            # rounding of sums, whose largest terms the solved system has as well
            close = 1e-12 * max(np.abs(b.displacement).max() / b.dt_s if row else 0.0, np.abs(others).max(), 1e-30)
            np.testing.assert_allclose(values, own - others, rtol=0, atol=close)


def test_the_norms_are_those_of_the_states() -> None:
    comparison = bl.compare(struck(), struck(impurities={10: 0.6e-3}))
    a, b = comparison.a, comparison.b
    norms = comparison.norms(every=50)
    assert norms["step"].tolist() == [*range(0, 1001, 50)]
    for step, *found in zip(norms["step"], *(norms[name] for name in list(norms)[2:]), strict=True):
        du, dv = a[step].displacement_m - b[step].displacement_m, a[step].velocity_m_s - b[step].velocity_m_s
        expected = [value for d in (du, dv) for value in (np.sqrt(np.mean(d**2)), np.abs(d).max())]
        np.testing.assert_allclose(found, expected, rtol=1e-14)
    # the impurity has no other force before the pulse comes, and then another velocity
    apart_s = comparison.apart_from_s(every=1)
    assert apart_s is not None
    dv = np.abs(np.asarray(comparison.difference.velocity)).max(axis=1)
    # the tolerance is 1e-4 of v0 = 5 m/s; displacements differ later
    assert apart_s == np.argmax(dv > 5e-4) * a.dt_s
    assert comparison.apart_from_s(tolerance=10.0) is None and bl.compare(a, a).apart_from_s() is None


def test_keys_that_differ_are_named() -> None:
    a, b = struck(impurities={3: 2e-3, 5: 3e-3}), struck(impurities={3: 1e-3}, duration_s=5e-4)
    comparison = bl.compare(a, b)
    assert comparison.changes == {
        "impurities[0].mass_kg": (2e-3, 1e-3),
        "impurities[1]": ({"bead": 5, "mass_kg": 3e-3}, None),
        "step_count": (1000, 500),
    }
    assert "0.002 in a, 0.001 in b" in comparison._repr_html_()
    assert bl.compare(comparison.a, comparison.a).changes == {}


def test_there_is_no_difference_of_other_beads_or_times() -> None:
    small, large = struck(), struck(30)
    with pytest.raises(ValueError, match="found 20 and 30 beads; expected as many"):
        _ = bl.compare(small, large).difference
    assert "found 20 and 30 beads" in bl.compare(small, large)._repr_html_()
    with pytest.raises(TypeError, match="a: found int; expected a Recording"):
        bl.compare(3, small)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="tolerance: found 0; expected a number above 0"):
        bl.compare(small, small).apart_from_s(tolerance=0)
    with pytest.raises(ValueError, match="field: found 'force'; expected 'velocity' or 'displacement'"):
        bl.compare(small, small).plot("force")


@pytest.mark.extras
def test_both_maps_and_their_difference_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "Agg")
    comparison = bl.compare(struck(), struck(dt_s=0.7e-6, impurities={10: 0.6e-3}))
    axes = comparison.plot(during_s=(2e-4, 8e-4))
    a, b, difference = (ax.images[0] for ax in axes)
    assert [ax.get_title("left") for ax in axes] == ["a: run", "b: run", "a − b"]
    assert (a.norm.vmin, a.norm.vmax) == (b.norm.vmin, b.norm.vmax) != (difference.norm.vmin, difference.norm.vmax)
    assert axes[0].get_ylim() == axes[2].get_ylim()
    assert "data:image/png" in comparison._repr_html_()


def test_the_page_has_both() -> None:
    with bl.compare(struck(), struck(30)).view(open=False) as page:
        with urllib.request.urlopen(f"{page.url}list") as answer:
            listing = json.load(answer)
    assert listing["kind"] == "pair" and len(listing["entries"]) == 2


@pytest.mark.extras
def test_a_widget_has_the_page_and_refuses_wrong_values() -> None:
    import traitlets

    widget = struck().simulate().widget(height_px=300)
    seen: list[Any] = []
    widget.observe(lambda change: seen.append(change["new"]), ["step", "bead", "field", "window_s"])
    widget.step, widget.bead, widget.field, widget.window_s = np.int64(500), 3, "force", (2e-4, 4e-4)
    assert seen == [500, 3, "force", [2e-4, 4e-4]]
    state = widget.get_state()
    assert "page_js.start()" in state["_page"] and state["step"] == 500 and state["height_px"] == 300
    for name, value, words in [
        ("step", 1001, "step: found 1001; expected 0 to 1000"),
        ("step", -1, "step: found -1; expected 0 or more"),
        ("step", None, "step: found None; expected a whole number"),
        ("height_px", -5, "height_px"),
        ("bead", 1.5, "bead: found 1.5; expected a whole number"),
        ("field", "speed", "'velocity', 'displacement'"),
        ("window_s", (4e-4, 2e-4), r"window_s: found \(0.0004, 0.0002\); expected two times from 0 s to 0.001 s"),
        ("window_s", 3, "window_s: found 3; expected two times"),
    ]:
        with pytest.raises(traitlets.TraitError, match=words):
            setattr(widget, name, value)
    widget.bead = widget.window_s = None
    assert (widget.step, widget.bead, widget.window_s) == (500, None, None)
