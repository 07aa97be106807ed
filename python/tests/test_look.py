"""What is seen of recordings: figures, summaries in notebooks, datasets of xarray, and progress."""

from __future__ import annotations

import base64
import io
import os
import re
import sys
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.image
import numpy as np
import pytest

import beadline as bl
from beadline import _html, _progress
from beadline._map import diverging, map_of

matplotlib.use("Agg")

LOADED = bl.Chain(20, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed", right="fixed", precompression_n=5.0)


@pytest.fixture(scope="module")
def rec() -> bl.Recording:
    """A pulse that meets a light bead, in memory: steps 0 to 3449, of which each tenth is kept."""
    chain = bl.Chain(beads=60, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={30: 0.6e-3})
    return bl.Run(chain, strikers={0: 5.0}, duration_s=5e-3, name="small").simulate(every=10)


def test_the_colours_are_those_of_the_command() -> None:
    found = (255 * diverging(np.array([-1.0, 0.0, 1.0]))).round().astype(int).tolist()
    # docs/img/figures/velocity.png has them at the ends of its bar
    assert found == [[2, 70, 139], [255, 255, 255], [126, 36, 1]]


def test_a_map_has_axes_with_units(rec: bl.Recording) -> None:
    ax = rec.plot("overlap")
    bar = ax.figure.axes[1]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("contact", "time (ms)")
    assert bar.get_ylabel() == "overlap (µm)"
    assert ax.get_xlim() == (-0.5, 58.5)
    # time runs down, as in the figures of the command
    assert ax.get_ylim()[0] > ax.get_ylim()[1] == 0.0


def test_a_map_shows_the_values_of_the_recording(rec: bl.Recording) -> None:
    drawn = map_of(rec, rec.velocity, range(60), 600, 2000)
    assert np.array_equal(drawn.values, np.asarray(rec.velocity)[rec.recorded_steps])


def test_a_map_of_few_recorded_states_is_computed() -> None:
    chain = bl.Chain(beads=10, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    rec = bl.Run(chain, strikers={0: 5.0}, duration_s=1e-3).simulate(every=500)
    drawn = map_of(rec, rec.velocity, range(10), 600, 2000, fewest=300)
    assert drawn.values.shape == (600, 10)
    assert np.isfinite(drawn.values).all()


def test_a_pulse_between_two_pixels_is_not_lost(rec: bl.Recording) -> None:
    coarse = map_of(rec, rec.velocity, range(60), 100, 7)
    fine = map_of(rec, rec.velocity, range(60), 100, 60)
    assert coarse.values.shape == (100, 7)
    assert np.array_equal(np.abs(coarse.values).max(axis=1), np.abs(fine.values).max(axis=1))


def test_a_map_of_some_milliseconds_has_the_steps_between_recorded_ones(
    rec: bl.Recording,
) -> None:
    drawn = map_of(rec, rec.velocity, range(20, 40), 600, 2000, during_s=(2e-3, 2.1e-3), fewest=300)
    steps = np.arange(round(drawn.from_s / rec.dt_s), round(drawn.until_s / rec.dt_s) + 1)
    assert np.array_equal(drawn.values, np.asarray(rec.velocity[steps, 20:40]))


def test_a_map_has_the_steps_at_both_ends_of_a_time(rec: bl.Recording) -> None:
    for first in range(1, 120):
        during_s = first * rec.dt_s, (first + 5) * rec.dt_s
        for times_s in (during_s, tuple(float(f"{time_s:.13g}") for time_s in during_s)):
            assert len(map_of(rec, rec.velocity, range(60), 600, 2000, during_s=times_s, every=1).values) == 6, first


def test_a_time_without_a_state_is_refused(rec: bl.Recording) -> None:
    with pytest.raises(ValueError, match=r"during_s: found \(nan, 0.001\); expected a time"):
        rec.plot("velocity", during_s=(float("nan"), 1e-3))
    with pytest.raises(ValueError, match=r"during_s: found \(None, 1\); expected the first and the last time"):
        rec.plot("velocity", during_s=(None, 1))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="step: found none; expected one or more"):
        rec.plot("velocity", step=[])
    with pytest.raises(ValueError, match="limit: found -1.0; expected a number above 0"):
        rec.plot("velocity", step=5, limit=-1)
    with pytest.raises(ValueError, match=r"during_s: found \(1, 2\); expected a time"):
        rec.plot("velocity", during_s=(1, 2))


def test_a_profile_has_the_values_of_a_state(rec: bl.Recording) -> None:
    ax = rec.plot("velocity", step=[1005, 2005], beads=slice(10, 50))
    first, second = (line for line in ax.get_lines() if line.get_label().startswith("t = "))
    assert np.array_equal(first.get_ydata(), rec[1005].velocity_m_s[10:50])
    assert np.array_equal(second.get_ydata(), rec[2005].velocity_m_s[10:50])
    assert ax.get_ylabel() == "velocity (m/s)"


def test_a_loaded_chain_shows_what_is_there_at_rest() -> None:
    rec = bl.Run(LOADED, strikers={10: 0.1}, duration_s=5e-4).simulate(every=1)
    [bar] = rec.plot("overlap").figure.axes[1:]
    assert bar.get_ylabel() == "overlap beyond rest (µm)"
    labels = [line.get_label() for line in rec.plot("force", step=5).get_lines()]
    assert labels == ["force", "at rest"]


@pytest.mark.parametrize(("chain", "duration_s"), [(bl.Chain(20, mass_kg=1e-3, bonds={"linear": 1e5}), 3e-4), (LOADED, 2e-4)])
def test_contacts_that_are_pulled_are_shown_where_that_is_no_gap(chain: bl.Chain, duration_s: float) -> None:
    rec = bl.Run(chain, strikers={0: -1e-3}, duration_s=duration_s).simulate(every=1)
    image: Any = rec.plot("overlap").images[0]
    least, most = image.get_array().min(), image.get_array().max()
    assert (image.norm.vmin, image.norm.vmax) == (least, most) and -least > 1.2 * most > 0


def test_displacements_are_all_shown_unless_some_are_far_away() -> None:
    chain = bl.Chain(beads=5, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    rec = bl.Run(chain, strikers={0: 5.0}, duration_s=1.2e-3).simulate()
    [curve] = rec.plot("displacement", step=-1).get_lines()
    assert curve.axes.get_ylim()[1] > curve.get_ydata().max()
    rec = bl.preset("light-impurity").replace({"time.duration_s": 0.01}).simulate(every=1000)
    [note] = rec.plot("displacement", step=-1).texts
    assert note.get_text() == "3 beads beyond the frame, as far as −3060 µm"


def test_what_cannot_be_drawn_is_refused(rec: bl.Recording) -> None:
    with pytest.raises(ValueError, match="found 'speed'; expected one of velocity, "):
        rec.plot("speed")
    with pytest.raises(ValueError, match="found step and time_s"):
        rec.plot("velocity", step=1, time_s=0.001)
    with pytest.raises(ValueError, match="expected neighbours from 0 to 59"):
        rec.plot("velocity", beads=slice(60, 70))
    with pytest.raises(ValueError, match=r"beads: found 5; .* such as slice\(0, 60\)"):
        rec.plot("velocity", beads=5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="scale: found 'log10'; expected 'log' or 'linear'"):
        rec.plot("velocity", scale="log10")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="during_s: found beside step"):
        rec.plot("velocity", step=1, during_s=(0.0, 1e-3))
    with pytest.raises(ValueError, match="scale: found beside time_s"):
        rec.plot("velocity", time_s=1e-3, scale="log")
    with pytest.raises(ValueError, match="during_s: found 5; expected the first and the last time"):
        rec.plot("velocity", during_s=5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="beads: found slice"):
        rec.plot("velocity", beads=slice(0, 5, 0))
    with pytest.raises(TypeError, match="float"):
        rec.plot("velocity", step=10.5)  # type: ignore[arg-type]


def test_settings_of_matplotlib_stay_as_they_are(rec: bl.Recording) -> None:
    before = dict(matplotlib.rcParams)
    figure, ax = matplotlib.pyplot.subplots()
    assert rec.plot("displacement", ax=ax) is ax
    rec.plot("velocity", time_s=1e-3, ax=ax)
    assert dict(matplotlib.rcParams) == before


def test_a_summary_has_a_picture_and_says_what_there_is(rec: bl.Recording) -> None:
    page = rec._repr_html_()
    assert "60 beads, α = 1.5" in page
    [data] = re.findall(r"data:image/png;base64,([^\"]+)", page)
    image = matplotlib.image.imread(io.BytesIO(base64.b64decode(data)))
    assert image.shape == (180, 60, 4)
    # nothing is drawn where nothing moves: the last bead at first
    assert image[0, -1, 3] == 0.0


def test_a_summary_of_noise_is_as_small_as_others() -> None:
    chain = bl.Chain(beads=400, mass_kg=1e-3, alpha=1.5, stiffness=1e7, precompression_n=1.0, left="fixed", right="fixed")
    hot = bl.Run(chain, initial={"thermal": {"energy_j": 1e-9}}, seed=1, duration_s=2e-3).simulate(every=5)
    page = hot._repr_html_()
    assert "data:image/png" in page and len(page) < 30_000


def test_a_run_that_is_computed_at_once_has_a_map(rec: bl.Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    run = bl.Run.from_recording(rec)
    # on a busy machine, too
    monkeypatch.setattr(_html, "_SMALL_S", 60.0)
    [data] = re.findall(r"data:image/png;base64,([^\"]+)", run._repr_html_())
    assert matplotlib.image.imread(io.BytesIO(base64.b64decode(data))).shape == (180, 60, 4)
    monkeypatch.setattr(_html, "_SMALL_S", -1.0)
    # years of work, and frames that are too far apart to look at the clock
    apart = {"stream.publish_every_steps": 10**5, "stream.record_every_steps": 10**5}
    for long in (run, run.replace({"time.duration_s": 1e6}), run.replace(apart)):
        page = long._repr_html_()
        assert "60 beads" in page and "no map yet: run.simulate() and" in page


def test_runs_states_and_tables_show_themselves(rec: bl.Recording) -> None:
    run = bl.Run.from_recording(rec)
    assert "60 beads, α = 1.5" in run._repr_html_() and "bead 0 at 5 m/s" in run._repr_html_()
    state = rec[1000]
    assert f"bead {np.abs(state.velocity_m_s).argmax()}," in state._repr_html_() and "J kinetic" in state._repr_html_()


def test_a_picture_has_the_colours_of_its_palette() -> None:
    palette = np.array([[255, 0, 0, 255], [0, 0, 255, 51]], np.uint8)
    pixels = np.array([[0, 1, 1], [1, 0, 1]], np.uint8)
    image = matplotlib.image.imread(io.BytesIO(_html.png(pixels, palette)))
    assert np.array_equal((255 * image).round(), palette[pixels])


def test_a_summary_believes_nothing(rec: bl.Recording, tmp_path: Path) -> None:
    path = tmp_path / "<img src=x onerror=alert(1)>.mcap"
    page = rec.save(path)._repr_html_()
    assert "<img src=x" not in page
    assert "&lt;img src=x onerror=alert(1)&gt;.mcap" in page


def test_a_summary_of_what_is_damaged_or_gone_says_so(rec: bl.Recording, tmp_path: Path) -> None:
    path = tmp_path / "small.mcap"
    # several chunks, so that the first state can be read
    bl.Run.from_toml(str(rec.toml)).record(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    opened = bl.open(path)
    assert "no map: RecordingError: " in opened._repr_html_()
    gone = bl.open(path)
    path.unlink()
    page = gone._repr_html_()
    assert "60 beads" in page
    assert "no map: FileNotFoundError" in page


def test_a_dataset_has_coordinates_units_and_the_bits(rec: bl.Recording) -> None:
    data = rec.to_xarray(every=7)
    assert dict(data.sizes) == {
        "time": len(range(0, rec.last_step + 1, 7)),
        "bead": 60,
        "contact": 59,
    }
    assert data.velocity.attrs == {"units": "m/s", "long_name": "velocity"}
    assert data.time.attrs["units"] == "s"
    assert float(data.mass_kg.sel(bead=30)) == 0.6e-3
    assert np.array_equal(data.velocity.values, np.asarray(rec.velocity[::7]))
    one = rec.to_xarray().overlap.sel(contact=[3, 40]).isel(time=slice(5, 50, 3))
    assert np.array_equal(one.values, np.asarray(rec.overlap)[50:500:30][:, [3, 40]])


def test_a_dataset_reads_when_it_is_needed(rec: bl.Recording, tmp_path: Path) -> None:
    path = tmp_path / "small.mcap"
    data = rec.save(path).to_xarray()
    bead = data.velocity.sel(bead=5)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        bead.load()


def test_a_curve_of_a_dataset_is_labelled(rec: bl.Recording) -> None:
    [line] = rec.to_xarray().velocity.sel(bead=30).plot()
    assert line.axes.get_xlabel() == "time [s]"
    assert line.axes.get_ylabel() == "velocity [m/s]"


def test_what_is_not_installed_is_asked_for(
    rec: bl.Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package, call in (("matplotlib", rec.plot), ("xarray", rec.to_xarray)):
        for module in [name for name in sys.modules if name.partition(".")[0] == package]:
            monkeypatch.delitem(sys.modules, module)
        # Python takes this as: there is none
        monkeypatch.setitem(sys.modules, package, None)
        extra = {"matplotlib": "plot"}.get(package, package)
        line = f'this needs {package}: pip install "beadline[{extra}]"'
        with pytest.raises(bl.MissingExtraError, match=re.escape(line)):
            call()


def terminal(monkeypatch: pytest.MonkeyPatch) -> int:
    """A terminal as the standard error; what is written there can be read."""
    master, slave = os.openpty()
    monkeypatch.setattr(sys, "stderr", os.fdopen(slave, "w"))
    return master


def test_a_terminal_shows_how_far_it_is_and_is_clean_at_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    master = terminal(monkeypatch)
    monkeypatch.setattr(_progress, "_PATIENCE_S", 0.0)
    with _progress.Progress(2000, "small") as bar:
        bar.update(500)
    shown = ""
    while not shown.endswith(" \r"):
        shown += os.read(master, 10_000).decode()
    assert re.match(r"\rsmall: 500 of 2,000 steps, [\d,.]+/s, \d+ s left", shown)
    *_, line, blank, rest = shown.split("\r")
    assert blank == " " * len(line)
    assert rest == ""


def test_what_is_done_at_once_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    master = terminal(monkeypatch)
    monkeypatch.setattr(_progress, "_PATIENCE_S", 1000.0)
    with _progress.Progress(2000, "small") as bar:
        bar.update(500)
    print("end", file=sys.stderr, flush=True)
    assert os.read(master, 3) == b"end"


def test_progress_is_silent_elsewhere_unless_it_is_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(_progress, "_PATIENCE_S", 0.0)
    with _progress.Progress(2000, "small") as bar:
        bar.update(500)
    assert capsys.readouterr().err == ""
    with _progress.Progress(2000, "small", show=True) as bar:
        bar.update(500)
    assert "small: 500 of 2,000 steps" in capsys.readouterr().err
