"""Recordings in the data models of others: xarray, dask, Zarr, Parquet, Arrow; and parts of them by time and bead."""

from __future__ import annotations

import json
import pickle
import random
import tracemalloc
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import beadline as bl

pytestmark = pytest.mark.extras

# the value of a state that a field has in its row
OF_STATES = {
    "displacement": "displacement_m",
    "velocity": "velocity_m_s",
    "overlap": "overlap_m",
    "force": "force_n",
    "resonator_displacement": "resonator_displacement_m",
    "resonator_velocity": "resonator_velocity_m_s",
    "dissipated": "dissipated_j",
    "drive_work": "drive_work_j",
    "drive_displacement": "drive_displacement_m",
    "bath_heat": "heat_j",
}


def any_run(seed: int) -> bl.Run:
    """A run of any kind: ends, laws, loads, dampings, resonators, drives, baths and methods by chance."""
    pick = random.Random(seed)
    while True:
        beads, ends = pick.choice([2, 3, 7, 20]), pick.choice(["free", "fixed", "periodic"])
        law: dict[str, Any] = pick.choice(
            [
                {"alpha": 1.5, "stiffness": 1e7},
                {"alpha": 1.5, "stiffness": 1e7, "masses": {"pattern_kg": [1e-3, 2e-3]}, "mass_kg": None},
                {"bonds": {"linear": 1e3, "quadratic": 0.25, "cubic": 0.0}},
            ]
        )
        damping: dict[str, Any] = pick.choice(
            [{}, {"viscous_n_s_per_m": 1e-3}, {"on_site": {"linear_n_per_m": 10.0, "drag_n_s_per_m": 1e-3}}]
        )
        inside = pick.choice([{}, {"resonators": {"mass_kg": 1e-3, "stiffness_n_per_m": 1e4}}])
        load = pick.choice([{}, {"precompression_n": 1.0}, {"gravity_m_s2": 9.81}])
        of_force = {"bead": beads - 1, "force_n": {"sine": {"amplitude": 1e-3, "frequency_hz": 1e3}}}
        drives = pick.choice([[], [of_force], [{"wall": "left", "velocity_m_s": 0.1}, of_force]])
        baths = pick.choice([[], [{"beads": "..2", "temperature_j": 1e-9, "friction_per_s": 1e3}]])
        method = pick.choice([None, "gear5", "rk5", "velocity-verlet"])
        try:
            chain = bl.Chain(beads, **{"mass_kg": 1e-3, **law, **damping, **inside, **load}, left=ends, right=ends)
            return bl.Run(
                chain, strikers={0: 1.0}, drives=drives, baths=baths, method=method, duration_s=2e-4, dt_s=1e-6, name="any"
            )
        except bl.ConfigError:
            # not all of these go together
            continue


@pytest.fixture
def rec(tmp_path: Path) -> bl.Recording:
    """A driven and damped chain: 1001 steps, of which each 20th is in the file."""
    chain = bl.Chain(12, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed", right="fixed", viscous_n_s_per_m=1e-3)
    run = bl.Run(chain, strikers={5: 1.0}, drives=[{"wall": "left", "velocity_m_s": 0.1}], duration_s=1e-3, dt_s=1e-6)
    return run.record(tmp_path / "run.mcap", every=20)


@pytest.mark.parametrize("seed", [*range(12), 40])
def test_a_dataset_of_any_run_has_the_values_of_its_states(seed: int, tmp_path: Path) -> None:
    import xarray as xr

    rec = any_run(seed).record(tmp_path / "any.mcap", every=7)
    steps = rec.recorded_steps.tolist()
    with xr.open_dataset(rec.path, fields=list(rec.to_xarray()) + ["force"]) as data:
        assert data.step.values.tolist() == steps
        # what the run has, and nothing else
        has = {name for name, value in OF_STATES.items() if getattr(rec[0], value).size}
        assert set(data) == has
        for name in has:
            expected = np.array([getattr(state, OF_STATES[name]) for state in rec.states()])
            found = data[name].values
            assert found.shape == expected.shape and found.tobytes() == expected.tobytes(), name
            array = getattr(rec, name)
            assert data[name].dims == ("time", array.place) and data[name].attrs["units"] == array.unit
            # not in the file, and not in their order
            some = rec.to_xarray(every=1, fields=[name])[name].sel(step=[13, 5, 199])
            assert some.values.tobytes() == np.array([getattr(rec[s], OF_STATES[name]) for s in (13, 5, 199)]).tobytes()
        rec.to_zarr(tmp_path / "any.zarr", fields=sorted(has))
        with xr.open_zarr(tmp_path / "any.zarr", consolidated=False) as again:
            xr.testing.assert_identical(again.load(), data.reset_index("step").load())
    for name in OF_STATES.keys() - has:
        with pytest.raises(AttributeError, match=f"^the run has no .*, so no {name}"):
            getattr(rec, name)


def test_xarray_opens_a_recording_by_its_name(rec: bl.Recording, tmp_path: Path) -> None:
    import xarray as xr

    assert "beadline" in xr.backends.list_engines()
    with xr.open_dataset(tmp_path / "run.mcap") as data:
        assert data.attrs["beads"] == 12 and data.attrs["dt_s"] == rec.dt_s and data.attrs["method"] == "rk5"
        assert json.loads(data.attrs["manifest"]) == rec.manifest
        assert data.velocity.attrs == {"units": "m/s", "long_name": "velocity"}
        assert float(data.velocity.sel(time=2.04e-4, bead=3, method="nearest")) == rec[200].velocity_m_s[3]
    with xr.open_dataset(tmp_path / "run.mcap", every=5, fields=["force"], drop_variables="stiffness") as data:
        assert list(data) == ["force"] and data.sizes["time"] == 201 and "stiffness" not in data.coords
    with xr.open_mfdataset([tmp_path / "run.mcap"]) as data:
        assert data.velocity.shape == (51, 12)


def test_files_of_others_are_left_to_others(tmp_path: Path) -> None:
    import xarray as xr

    (tmp_path / "other.mcap").write_bytes(b"\x89MCAP0\r\n\x01" + bytes(8) + b"\4\0\0\0ros2" + bytes(40))
    with pytest.raises(ValueError, match="did not find a match"):
        xr.open_dataset(tmp_path / "other.mcap")
    with pytest.raises(FileNotFoundError, match="none.mcap"):
        xr.open_dataset(tmp_path / "none.mcap")
    with pytest.raises(bl.RecordingError):
        xr.open_dataset(tmp_path / "other.mcap", engine="beadline")


def test_a_damaged_recording_says_so(rec: bl.Recording, tmp_path: Path) -> None:
    import xarray as xr

    (tmp_path / "cut.mcap").write_bytes((tmp_path / "run.mcap").read_bytes()[:60])
    with pytest.raises(bl.RecordingError):
        xr.open_dataset(tmp_path / "cut.mcap")


def test_a_graph_of_dask_reads_the_chunks_that_are_asked_for(rec: bl.Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    import xarray as xr

    data = xr.open_dataset(rec.path, every=1, chunks={"time": 100})
    read: list[tuple[int, int]] = []
    gather = bl.Recording._gather

    def told(self: bl.Recording, name: Any, steps: Any, places: Any) -> Any:
        read.append((len(steps), len(places)))
        return gather(self, name, steps, places)

    monkeypatch.setattr(bl.Recording, "_gather", told)
    assert data.velocity.chunks == ((*[100] * 10, 1), (12,))
    fastest = abs(data.velocity).max()
    assert not read
    # a bead, at some steps of one chunk
    part = data.velocity[150:160, 3].compute()
    assert read == [(10, 1)] and np.array_equal(part, rec.velocity[150:160, 3])
    assert float(fastest.compute(scheduler="threads")) == np.abs(rec.velocity).max()
    # to another process
    again = pickle.loads(pickle.dumps(data.dissipated))
    assert np.array_equal(again.values, np.asarray(rec.dissipated))


def test_chunks_of_a_large_recording_are_round(rec: bl.Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    import xarray as xr

    from beadline import _xarray

    # 400 rows of 12 doubles
    monkeypatch.setattr(_xarray, "_BLOCK_BYTES", 8 * 12 * 400)
    own = xr.open_dataset(rec.path, every=1, chunks={})
    assert own.velocity.chunks == ((*[100] * 10, 1), (12,))
    with warnings.catch_warnings():
        # of chunks that others separate
        warnings.simplefilter("error")
        assert xr.open_dataset(rec.path, every=1, chunks={"time": 500}).velocity.chunks[0] == (500, 500, 1)


def test_a_part_by_time_and_bead_is_a_table(rec: bl.Recording) -> None:
    table = rec.sel(time_s=[3.004e-4, 1e-5], bead=[4, 2])
    assert list(table) == ["step", "time_s", "bead", "displacement_m", "velocity_m_s"]
    assert table["step"].tolist() == [300, 300, 10, 10] and table["bead"].tolist() == [4, 2, 4, 2]
    assert table["velocity_m_s"].tolist() == [rec[s].velocity_m_s[b] for s in (300, 10) for b in (4, 2)]
    assert table["displacement_m"].tolist() == [rec[s].displacement_m[b] for s in (300, 10) for b in (4, 2)]
    assert len(rec.sel(time_s=1e-4)) == 12 and len(rec.sel(bead=3)) == 51
    # recorded steps, with both ends, or any
    assert rec.sel(time_s=slice(0.99e-4, 1.41e-4), bead=-1)["step"].tolist() == [100, 120, 140]
    assert rec.sel(time_s=slice(9.89e-4, None), bead=slice(3, 4), every=5)["step"].tolist() == [990, 995, 1000]
    assert rec.sel(time_s=1.09e-4, bead=0, every=20)["step"].tolist() == [100]


def test_a_part_of_a_recording_that_cannot_be_recomputed_has_recorded_steps(
    rec: bl.Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bl.Recording, "recomputes", False)
    assert rec.sel(time_s=[1.09e-4, 1.11e-4], bead=0)["step"].tolist() == [100, 120]
    assert rec.sel(time_s=1.09e-4, bead=0)["velocity_m_s"][0] == rec[100].velocity_m_s[0]
    assert rec.to_xarray().sizes["time"] == 51


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"time_s": 2e-3}, "time_s: found 0.002; the recording has 0 s to 0.001 s"),
        ({"time_s": [0.0, float("nan")]}, "time_s: found nan; the recording has"),
        ({"time_s": "noon"}, "time_s: found 'noon'; expected numbers"),
        ({"time_s": slice(1.01e-4, 1.02e-4)}, "time_s: found .* no state there; every=1 recomputes"),
        ({"time_s": slice("noon", None)}, "time_s: found 'noon'; expected a number"),
        ({"time_s": slice(float("nan"), 1.0)}, "time_s: found nan, 1.0; "),
        ({"time_s": []}, r"time_s: found \[\]; expected a time"),
        ({"time_s": [[0.0], [1e-4]]}, "time_s: found .*; expected a time"),
        ({"time_s": slice(0, 1, 2)}, "every=… takes fewer steps"),
        ({"bead": 12}, "bead: found 12; expected beads from 0 to 11"),
        ({"bead": [1.5]}, r"bead: found \[1.5\]; expected beads"),
        ({"bead": slice(12, 20)}, "bead: found slice.*expected beads"),
        ({"bead": [[1], [2]]}, "bead: found .*; expected beads"),
        ({"bead": True}, "bead: found True; expected beads"),
        ({"bead": "first"}, "bead: found 'first'; expected beads"),
        ({"every": 0}, "every: found 0; expected 1 or more"),
    ],
)
def test_a_part_that_is_not_there_is_refused(rec: bl.Recording, part: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        rec.sel(**part)


def test_zarr_has_the_part_that_is_asked_for(rec: bl.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import xarray as xr

    from beadline import _xarray

    # chunks of 20 rows, three at a time
    monkeypatch.setattr(_xarray, "_CHUNK_BYTES", 800)
    monkeypatch.setattr(_xarray, "_BLOCK_BYTES", 8 * 60 * (5 + 5 + 4 + 5 + 2 + 1))
    rec.to_zarr(tmp_path / "part.zarr", from_s=1e-4, until_s=9.2e-4, beads=slice(4, 9), every=9)
    with xr.open_zarr(tmp_path / "part.zarr", consolidated=False) as part:
        steps = part.step.values
        assert steps.tolist() == list(range(108, 921, 9)) and part.bead.values.tolist() == list(range(4, 9))
        assert part.contact.values.tolist() == list(range(4, 8)) and part.time.attrs["units"] == "s"
        assert part.velocity.values.tobytes() == np.asarray(rec.velocity[steps, 4:9]).tobytes()
        assert part.overlap.values.tobytes() == np.asarray(rec.overlap[steps, 4:8]).tobytes()
        assert part.drive_work.values.tobytes() == np.asarray(rec.drive_work[steps]).tobytes()


def test_an_existing_zarr_is_kept(rec: bl.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.zarr"
    (path / "mine").mkdir(parents=True)
    for force, advice in ((False, "force=True"), (True, "force=True replaces Zarr groups only")):
        with pytest.raises(FileExistsError, match=f"run.zarr exists already.* {advice}"):
            rec.to_zarr(path, force=force)
    rec.to_zarr(tmp_path / "own.zarr", fields=["velocity"])
    with pytest.raises(FileExistsError, match="own.zarr exists already; .* force=True"):
        rec.to_zarr(tmp_path / "own.zarr")
    rec.to_zarr(tmp_path / "own.zarr", fields=["force"], force=True)
    assert not (tmp_path / "own.zarr/velocity").exists() and (tmp_path / "own.zarr/force").exists()
    with pytest.raises(FileNotFoundError, match="new.zarr: its directory cannot be used"):
        rec.to_zarr(tmp_path / "none/new.zarr")
    with pytest.raises(ValueError, match="fields: found 'speed'; expected some of displacement, velocity, "):
        rec.to_zarr(tmp_path / "new.zarr", fields=["speed"])

    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(bl.Recording, "_gather", interrupted)
    with pytest.raises(KeyboardInterrupt):
        rec.to_zarr(tmp_path / "new.zarr")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["own.zarr", "run.mcap", "run.zarr"]


def test_zarr_takes_memory_that_does_not_grow_with_the_recording(
    rec: bl.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from beadline import _recording, _xarray

    monkeypatch.setattr(_recording, "_BLOCK_BYTES", 500_000)
    monkeypatch.setattr(_xarray, "_CHUNK_BYTES", 250_000)
    monkeypatch.setattr(_xarray, "_BLOCK_BYTES", 500_000)
    peaks = []
    for times in (1, 1, 5):
        long = bl.Run.from_recording(rec).replace({"time.duration_s": times * 2e-3}).simulate(every=100)
        tracemalloc.start()
        long.to_zarr(tmp_path / f"{len(peaks)}.zarr", every=1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # 10,000 rows of 49 doubles are 3.9 MB; the first time modules are imported
    assert peaks[2] < peaks[1] + 1_000_000, peaks


def test_parquet_is_that_of_the_command(rec: bl.Recording, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    rec.to_parquet(tmp_path / "run.parquet", from_s=0.99e-4, beads=slice(2, 5))
    table = pq.read_table(tmp_path / "run.parquet")
    assert table["step"].to_pylist() == list(range(100, 1001, 20))
    found = table["velocity_m_s"].combine_chunks().flatten().to_numpy().reshape(len(table), -1)
    assert found.tobytes() == np.asarray(rec.velocity[100::20, 2:5]).tobytes()
    with pytest.raises(FileExistsError, match="run.parquet"):
        rec.to_parquet(tmp_path / "run.parquet")
    rec.to_parquet(tmp_path / "run.parquet", force=True)
    assert pq.read_table(tmp_path / "run.parquet").num_rows == 51


def test_arrow_takes_columns_of_a_table_without_a_copy(rec: bl.Recording) -> None:
    import pyarrow as pa

    table = rec.energies()
    taken = pa.RecordBatchReader.from_stream(table).read_all()
    assert taken.column_names == list(table)
    for name in ("step", "time_s", "total_j"):
        [chunk] = taken[name].chunks
        assert chunk.buffers()[1].address == table[name].ctypes.data, name
