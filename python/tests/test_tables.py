"""What analyses, proofs and pages make of a recording."""

from __future__ import annotations

import csv
import os
import pickle
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from analyses import analyses, key

import beadline as bl
from beadline import _files, _table

CHAIN = bl.Chain(beads=120, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={40: 0.6e-3})
RUN = bl.Run(CHAIN, strikers={0: 5.0}, duration_s=8e-3, name="short")


@pytest.fixture(scope="module")
def rec(tmp_path_factory: pytest.TempPathFactory) -> bl.Recording:
    return RUN.record(tmp_path_factory.mktemp("short") / "short.mcap", every=20)


def command(*arguments: object) -> None:
    program = [sys.executable, "-m", "beadline"]
    subprocess.run([*program, *map(str, arguments)], check=True, capture_output=True)


def written(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def has_bits(table: _table.Table, texts: dict[str, list[str]]) -> bool:
    """Whether a table has the values of the text, to the bit."""
    assert list(table) == list(texts)
    for name, cells in texts.items():
        column = table[name]
        if column.dtype.kind == "U":
            assert column.tolist() == cells, name
        else:
            doubles = np.array([float(cell or "nan") for cell in cells])
            assert column.astype(np.float64).tobytes() == doubles.tobytes(), name
    return True


def test_energies_are_those_of_the_command(rec: bl.Recording, tmp_path: Path) -> None:
    energies = rec.energies(split=30)
    command("energies", rec.path, "--split", 30, "--out", tmp_path / "e.csv")
    assert has_bits(energies, written(tmp_path / "e.csv"))
    assert len(energies) == len(rec.recorded_steps)
    assert energies["step"].dtype == np.int64
    # the striker: m v²/2
    assert energies["total_j"][0] == 0.5 * 1e-3 * 5.0**2
    assert np.abs(energies["total_j"] / energies["total_j"][0] - 1).max() < 1e-6


def test_the_summary_has_the_reflected_energy_of_the_table(rec: bl.Recording) -> None:
    energies = rec.energies()
    reflection = energies.summary["results"]["reflection"]["energies"]
    at = energies["frame"].tolist().index(reflection["at"]["frame"])
    assert energies["left_j"][at] == reflection["reflected_j"]


def test_a_run_in_memory_has_the_same_results(rec: bl.Recording) -> None:
    in_memory = RUN.simulate(every=20).energies()
    in_file = rec.energies()
    assert all(in_memory[name].tobytes() == in_file[name].tobytes() for name in in_file)


def test_every_step_of_a_part_can_be_analysed(rec: bl.Recording) -> None:
    part = rec.energies(every_step=True, from_s=2e-3, until_s=2.1e-3, jobs=1)
    assert np.diff(part["step"]).tolist() == [1] * (len(part) - 1)
    assert 2e-3 <= part["time_s"][0] and part["time_s"][-1] <= 2.1e-3


def test_the_motion_of_the_impurity_has_events(rec: bl.Recording, tmp_path: Path) -> None:
    motion = rec.impurity()
    paths = [tmp_path / "motion.csv", tmp_path / "events.csv"]
    command("impurity", rec.path, "--out", paths[0], "--events", paths[1])
    assert has_bits(motion, written(paths[0])) and has_bits(motion.events, written(paths[1]))
    assert motion["v_40_m_s"].tobytes() == rec.velocity[motion["step"], 40].tobytes()
    assert motion.events["event"][:2].tolist() == ["left-closes", "right-closes"]
    assert "v_7_m_s" in rec.impurity(bead=[7, 9])


def test_contacts_are_counted_and_missing_ones_are_nan(rec: bl.Recording) -> None:
    contacts = rec.contacts(tolerance_m=0.0)
    counts = np.sum([contacts[f"{kind}_count"] for kind in ("compressed", "touching", "open")], axis=0)
    assert set(counts.tolist()) == {119}
    first = contacts["first_compressed_contact"]
    assert np.isnan(first[0]) and first[1] == 0.0


def test_pulses_have_tracks(rec: bl.Recording) -> None:
    pulses = rec.pulses(threshold=0.01)
    assert pulses["direction"][0] == "forward"
    # a pulse has a row for each bead that it passes
    tracks = pulses.positions["pulse"].tolist()
    assert [tracks.count(pulse) for pulse in pulses["pulse"].tolist()] == pulses["bead_count"].tolist()


def test_the_deformation_of_several_contacts_is_one_table(rec: bl.Recording) -> None:
    deformation = rec.deformation([60, 90], every_step=True)
    assert sorted(set(deformation["contact"].tolist())) == [60, 90]
    peak_m = deformation.summary["results"]["contacts"][0]["first_pulse"]["overlap_peak_m"]
    is_of_60: npt.NDArray[np.bool_] = np.equal(deformation["contact"], 60)
    # the peak lies between two steps
    assert deformation[is_of_60]["overlap_m"].max() == pytest.approx(peak_m, rel=1e-3)


@pytest.fixture(scope="module")
def pressed() -> bl.Recording:
    chain = bl.Chain(
        beads=20, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed", right="fixed", precompression_n=10.0
    )
    return bl.Run(chain, strikers={0: 0.01}, duration_s=2e-3, name="pressed").simulate(every=1)


def test_energy_spreads_from_one_bead(pressed: bl.Recording) -> None:
    spreading = pressed.spreading(until_s=1e-4)
    assert spreading["participation_beads"][0] == 1.0 < spreading["participation_beads"][-1]
    assert spreading["second_moment_beads2"][0] == 0.0


def test_forces_have_peaks(pressed: bl.Recording) -> None:
    forces = pressed.forces(["contact:7", "wall:right"], threshold_n=0.01)
    assert forces["force_contact_7_n"].tobytes() == np.asarray(pressed.force[:, 7]).tobytes()
    assert forces["force_wall_right_n"][200] == pressed[200].wall_force_n[1]
    assert set(forces.peaks["place"].tolist()) <= {"contact:7", "wall:right"} and len(forces.peaks) > 0


def test_spectra_of_places_of_pairs_and_of_all_beads(pressed: bl.Recording) -> None:
    spectrum = pressed.spectrum("bead:10", window="none", max_frequency_hz=1e4)
    assert list(spectrum) == ["frequency_hz", "psd_bead_10_m2_s2_hz"]
    pair = pressed.spectrum(transmission=[("bead:3", "bead:10")], window="none")
    assert "gain_bead_3_bead_10" in pair
    assert list(pressed.spectrum(map=True, beads=slice(2, 18)))[:2] == ["frequency_hz", "q_rad_per_bead"]
    assert list(pressed.spectrum("bead:10", spectrogram=True))[:2] == ["frequency_hz", "time_s"]


def test_modes_are_those_of_the_tangent_springs(pressed: bl.Recording) -> None:
    modes = pressed.modes()
    # dF/dδ = 1.5·k·√δ at 10 N; equal beads between walls: 2·√(K/m)·sin(π·n/(2·(N + 1)))
    slope = 1.5 * 1e7 * np.sqrt(pressed.rest_overlap_m[0])
    omega = 2 * np.sqrt(slope / 1e-3) * np.sin(np.pi * modes["mode"] / 42)
    assert modes["frequency_hz"] == pytest.approx(omega / (2 * np.pi), rel=1e-9)
    assert list(pressed.modes(shapes=True, mode=[1, 3])) == ["bead", "u_mode_1", "u_mode_3"]
    energy = pressed.modes(energy=True, mode=2, until_s=1e-4)["energy_mode_2_j"]
    assert energy.max() == pytest.approx(energy.min(), rel=1e-3)


def test_a_whole_recording_is_proven(rec: bl.Recording) -> None:
    verdict = _files.verify(rec)
    assert verdict and verdict.verdict == "proven" and verdict.report["steps_recomputed"] == RUN.steps
    assert _files.verify(RUN.simulate(every=50), jobs=1)


def test_what_is_missing_of_a_recording_is_told(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    # a state of each step fills several chunks
    states = len(RUN.record(path, every=1).recorded_steps)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    cut = bl.open(path)
    with pytest.warns(RuntimeWarning, match="not finished, or is damaged"):
        energies = cut.energies()
    assert 0 < len(energies) < states
    assert not _files.verify(cut)


def test_a_file_that_is_no_recording_any_more_is_an_error_of_that_file(tmp_path: Path) -> None:
    path = tmp_path / "gone.mcap"
    rec = RUN.record(path, every=100)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(bl.RecordingError, match="not a Beadline recording") as caught:
        rec.energies()
    assert caught.value.path == str(path)


# a value of each kind that an option takes
VALUES = {
    "nothing": True,
    "number": 0.5,
    "whole": 1,
    "PLACE": "bead:3",
    "PLACE,PLACE": [("bead:3", "bead:4")],
    "A..B": slice(1, 4),
    "SAMPLES": 8,
    "BANDS": "2",
    "K": "2",
}


def test_every_option_of_every_analysis_reaches_the_command(pressed: bl.Recording, tmp_path: Path) -> None:
    rec = pressed.save(tmp_path / "pressed.mcap")
    part: list[tuple[str, object]] = [("from_s", 1e-5), ("until_s", 1e-3), ("every_step", True), ("jobs", 1)]
    for analysis in analyses():
        ask = getattr(rec, analysis["name"].replace("-", "_"))
        options = [(key(one), one["words"][0][0] if one["takes"] == "word" else VALUES[one["takes"]]) for one in analysis["settings"]]
        needed = {key(one): VALUES[one["takes"]] for one in analysis["settings"] if one["required_unless"] is not None}
        for name, value in [*options, *(part if analysis["name"] == "energies" else [])]:
            try:
                ask(**{**needed, name: value})
            except bl.CommandError as error:
                # it may be refused by an analysis, but not as unknown
                assert "unexpected argument" not in str(error), f"{analysis['name']}({name}={value!r}): {error}"


def test_an_impossible_option_is_an_error_of_the_command(rec: bl.Recording) -> None:
    with pytest.raises(bl.CommandError, match="^split: found 500; the chain has beads 0 to 119$") as caught:
        rec.energies(split=500)
    assert (caught.value.exit_code, caught.value.key) == (2, "split") and isinstance(caught.value, ValueError)
    for said, ask in {
        "split: found -1; expected a whole number, 0 or more": lambda: rec.energies(split=-1),
        "from_s: found nan; expected a simulated time in seconds, 0 or more": lambda: rec.energies(from_s=float("nan")),
        "from_s: found 2; expected a time before until_s 1": lambda: rec.energies(from_s=2, until_s=1),
        "jobs: found 0; expected a number of threads from 1 to 1024": lambda: rec.energies(jobs=0),
        "contact: found none; expected one or more": lambda: rec.deformation([]),
        "bead: found none; expected one or more": lambda: rec.impurity(bead=[]),
        "at: found bed:9; expected bead:N, contact:N, wall:left or wall:right": lambda: rec.forces("bed:9"),
        "window: found x; expected hann, none": lambda: rec.spectrum("bead:3", window="x"),  # type: ignore[arg-type]
        "transmission: found ['bead:3']; expected pairs": lambda: rec.spectrum(transmission=["bead:3"]),  # type: ignore[list-item]
        "beads: found 5; expected neighbours": lambda: rec.spectrum(map=True, beads=5),  # type: ignore[arg-type]
        "tolerance_m: found -1.0; expected a number, 0 or more": lambda: rec.contacts(tolerance_m=-1.0),
    }.items():
        with pytest.raises(ValueError) as raised:
            ask()
        assert str(raised.value).startswith(said), str(raised.value)


def test_a_page_does_not_replace_another(rec: bl.Recording, tmp_path: Path) -> None:
    page = tmp_path / "x.html"
    told = _files.share(rec, page)
    assert told["path"] == str(page) and told["bytes"] == page.stat().st_size
    with pytest.raises(FileExistsError, match=r"x\.html exists already"):
        _files.share(RUN.simulate(), page)
    assert _files.share(RUN.simulate(), page, every=100, force=True)["every_steps"] == 100


@pytest.mark.extras
def test_tables_become_those_of_others(rec: bl.Recording) -> None:
    events = rec.impurity().events
    rows = events.to_numpy()
    assert rows.dtype.names == ("time_s", "bead", "event", "u_m") and rows[0]["bead"] == 40
    for frame in (events.to_pandas(), events.to_polars(), events.to_arrow()):
        assert frame.shape == (len(events), 4)
        assert [str(word) for word in frame["event"]] == events["event"].tolist()
    assert list(dict(events)) == list(events)


def test_what_a_table_does_not_have_is_told(rec: bl.Recording) -> None:
    table = rec.contacts()
    with pytest.raises(KeyError, match="there is no column 'open'; there are: frame, "):
        table["open"]
    with pytest.raises(TypeError, match=r"found table\[3\]; expected the name of a column, a slice"):
        table[3]  # type: ignore[call-overload]


def test_tables_show_themselves_and_travel(rec: bl.Recording) -> None:
    motion = rec.impurity()
    assert repr(motion).startswith(f"<Motion of {len(motion)} rows: frame, step, time_s")
    page = motion._repr_html_()
    assert page.count("<tr>") == 12 and "<th>v_40_m_s</th>" in page
    again = pickle.loads(pickle.dumps(motion))
    assert again.events["u_m"].tobytes() == motion.events["u_m"].tobytes()
    assert len(motion[:3]) == 3 and len(motion[[5, 1]]) == 2
    with pytest.raises(KeyError, match="there are: frame, step"):
        motion["speed"]


INTERRUPTED = """
import os, signal, sys, threading, time
from pathlib import Path
import beadline as bl
from beadline import _files
rec = bl.preset("light-impurity").record(sys.argv[1], every=1000)
interrupted_s = []
def interrupt():
    while not list(Path(os.environ["TMPDIR"]).glob("beadline-*/out.csv.partial")):
        time.sleep(0.005)
    interrupted_s.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt, daemon=True).start()
try:
    rec.energies(every_step=True, jobs=1)
except KeyboardInterrupt:
    children = Path("/proc/self/task", str(os.getpid()), "children").read_text()
    print(time.monotonic() - interrupted_s[0], children)
"""


def test_ctrl_c_leaves_no_process_and_no_file(tmp_path: Path) -> None:
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    script = [sys.executable, "-c", INTERRUPTED, str(tmp_path / "long.mcap")]
    done = subprocess.run(script, env=environment, capture_output=True, text=True, check=True)
    took_s, *children = done.stdout.split()
    # 0.2 s, and what a busy machine adds
    assert float(took_s) < 2.0 and children == []
    assert list(temporary.iterdir()) == []


@pytest.mark.extras
def test_frames_of_others_take_a_table_as_it_is(rec: bl.Recording) -> None:
    pd, pl, pa = (pytest.importorskip(name) for name in ("pandas", "polars", "pyarrow"))
    events = rec.impurity().events
    for table in (events, events[:1], events[:0]):
        for frame in (pd.DataFrame(table), pl.DataFrame(table), pa.table(table), pa.table(pa.RecordBatchReader.from_stream(table))):
            names = frame.column_names if isinstance(frame, pa.Table) else list(frame.columns)
            assert names == list(table) and frame.shape == (len(table), 4)
            for name in ("time_s", "bead"):
                assert np.array_equal(np.asarray(frame[name]), table[name])
    rows = np.asarray(events)
    assert rows.dtype.names == tuple(events) and rows["u_m"].tobytes() == events["u_m"].tobytes()


def test_a_table_is_a_mapping_of_columns_with_units(rec: bl.Recording, tmp_path: Path) -> None:
    energies = rec.energies()
    assert isinstance(energies, Mapping) and len(energies.keys()) == len(list(energies)) == len(dict(energies))
    assert energies.units["time_s"] == "s" and energies.units["total_j"] == "J" and energies.units["step"] == ""
    assert rec.impurity().units["v_40_m_s"] == "m/s"
    part = energies[["time_s", "total_j"]].head(3)
    assert list(part) == ["time_s", "total_j"] and len(part) == 3 and part == part and part != energies
    part["lost_j"] = part["total_j"][0] - part["total_j"]
    assert part[part["lost_j"] >= 0.0].units["lost_j"] == "J" and len(part[[]]) == 0
    with pytest.raises(ValueError, match="few: found the shape .* each of 3 rows"):
        part["few"] = [1.0]
    path = tmp_path / "part.csv"
    rec.contacts().to_csv(path)
    assert has_bits(_table.read_csv(path), {name: list(map(_cell, column)) for name, column in rec.contacts().items()})
    with pytest.raises(FileExistsError, match="force=True"):
        part.to_csv(path)
    part.to_csv(path, force=True)
    assert _table.read_csv(path)["total_j"].tobytes() == part["total_j"].tobytes() and len(list(tmp_path.iterdir())) == 1


def _cell(value: object) -> str:
    return "" if value != value else str(value)


@pytest.mark.extras
def test_a_table_draws_columns_of_one_unit(rec: bl.Recording) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    energies = rec.energies()
    ax = energies.plot(["kinetic_j", "potential_j"])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "J")
    assert [line.get_label() for line in ax.get_lines()] == ["kinetic", "potential"]
    assert energies.plot("total_j", x="step").get_ylabel() == "total (J)"
    with pytest.raises(ValueError, match="y: found J, s; expected columns of numbers of one unit"):
        energies.plot(["total_j", "time_s"], x="step")
    assert len(energies.plot().get_lines()) > 3
