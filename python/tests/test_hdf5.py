"""States as HDF5: the layout of H5MD, the doubles of the recording."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import beadline as bl
from beadline import _recording

pytestmark = pytest.mark.extras

CHAIN = bl.Chain(
    12,
    mass_kg=1e-3,
    alpha=1.5,
    stiffness=1e7,
    impurities={5: 0.6e-3},
    left="fixed",
    right="fixed",
    precompression_n=2.0,
)
RUN = bl.Run(CHAIN, strikers={0: 1.0}, duration_s=1e-3, dt_s=2e-6, name="stored")


@pytest.fixture
def rec(tmp_path: Path) -> bl.Recording:
    return RUN.record(tmp_path / "stored.mcap", every=40)


def check_h5md(file: Any, rec: bl.Recording) -> None:
    """What names the layout, the units and the run."""
    assert list(file["h5md"].attrs["version"]) == [1, 1] and list(file["h5md/modules/units"].attrs["version"]) == [1, 0]
    assert file["h5md/creator"].attrs["name"] == "beadline" and file["h5md/author"].attrs["name"] == "unknown"
    assert file["h5md/modules/units"].attrs["system"] == "SI"
    chain, parameters = file["particles/chain"], file["parameters"]
    assert chain["box"].attrs["dimension"] == 1 and list(chain["box"].attrs["boundary"]) == ["none"]
    units = {
        "particles/chain/position/value": "m",
        "particles/chain/velocity/value": "m s-1",
        "particles/chain/position/time": "s",
        "particles/chain/mass": "kg",
        "parameters/stiffness": "N m-1.5",
        "parameters/rest_overlap": "m",
    }
    assert {name: file[name].attrs["unit"] for name in units} == units
    assert all(file[name].dtype == np.float64 for name in units)
    assert chain["position/step"].dtype == chain["id"].dtype == np.int64
    assert chain["velocity/step"] == chain["position/step"] and chain["velocity/time"] == chain["position/time"]
    assert json.loads(parameters["manifest"].asstr()[0]) == rec.manifest
    physics = rec.manifest["physics"]
    for name in ("alpha", "dt_s", "step_count", "method"):
        assert parameters.attrs[name] == physics[name]


@pytest.mark.parametrize("block_bytes", [_recording._BLOCK_BYTES, 1000])
@pytest.mark.parametrize(
    ("flags", "steps", "beads"),
    [
        ({}, [*range(0, 500, 40), 500], slice(0, 12)),
        ({"every": 1}, range(501), slice(0, 12)),
        ({"every": 1, "from_s": 0.99e-4, "until_s": 2.01e-4, "beads": slice(4, 7)}, range(50, 101), slice(4, 7)),
        ({"every": 7, "from_s": 2.99e-4, "beads": slice(-1, None)}, range(154, 501, 7), slice(11, 12)),
        ({"until_s": 1e-4}, [0, 40], slice(0, 12)),
    ],
)
def test_a_file_of_h5md_has_the_states_of_the_recording(
    flags: dict[str, Any],
    steps: Any,
    beads: slice,
    block_bytes: int,
    rec: bl.Recording,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import h5py

    monkeypatch.setattr(_recording, "_BLOCK_BYTES", block_bytes)
    rec.to_hdf5(tmp_path / "run.h5", **flags)
    steps, contacts = np.array(steps), slice(beads.start, beads.stop - 1)
    with h5py.File(tmp_path / "run.h5", "r") as file:
        check_h5md(file, rec)
        chain, parameters = file["particles/chain"], file["parameters"]
        for found, expected in (
            (chain["position/step"], steps),
            (chain["position/time"], steps * rec.dt_s),
            (chain["position/value"], np.asarray(rec.displacement[steps, beads])[:, :, None]),
            (chain["velocity/value"], np.asarray(rec.velocity[steps, beads])[:, :, None]),
            (chain["id"], np.arange(beads.start, beads.stop)),
            (chain["mass"], rec.mass_kg[beads]),
            (parameters["stiffness"], rec.stiffness[contacts]),
            (parameters["rest_overlap"], rec.rest_overlap_m[contacts]),
        ):
            assert found.shape == expected.shape and found[:].tobytes() == expected.astype(found.dtype).tobytes(), found.name


def test_stiffnesses_have_the_unit_of_their_exponents(tmp_path: Path) -> None:
    import h5py

    law: dict[str, Any] = {"alpha": 1.5, "stiffness": 1e7}
    for laws, unit, alpha in (
        ({**law, "alphas": 2.0}, "N m-2", 2.0),
        ({**law, "alphas": [1.5, 2.0]}, "N m-alpha", None),
        ({"bonds": {"linear": 1e4}}, None, None),
    ):
        rec = bl.Run(bl.Chain(3, mass_kg=1e-3, **laws), strikers={0: 1.0}, duration_s=1e-4).simulate()
        rec.to_hdf5(tmp_path / "run.h5", force=True)
        with h5py.File(tmp_path / "run.h5", "r") as file:
            parameters = file["parameters"]
            assert parameters.attrs.get("alpha") == alpha and ("stiffness" in parameters) == (unit is not None)
            assert unit is None or parameters["stiffness"].attrs["unit"] == unit
        data = rec.to_xarray()
        assert data.attrs.get("alpha") == alpha and ("stiffness" in data.coords) == (unit is not None)


def test_the_author_is_that_of_the_run(tmp_path: Path) -> None:
    import h5py

    # beyond U+FFFF, which JSON escapes as TOML cannot
    RUN.replace({"provenance.author": "𠮷田 花子"}).simulate().to_hdf5(tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "r") as file:
        assert file["h5md/author"].attrs["name"] == "𠮷田 花子"


def test_what_cannot_be_stored_is_refused_and_leaves_nothing(rec: bl.Recording, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(ValueError, match="no state there; every=1 recomputes"):
        rec.to_hdf5(path, from_s=1.003e-4, until_s=1.015e-4)
    with pytest.raises(ValueError, match="no state there; it has 0 s to"):
        rec.to_hdf5(path, from_s=1.0)
    for beads in (slice(3, 3), slice(0, 8, 2)):
        with pytest.raises(ValueError, match="^beads: found slice.*the 12 beads"):
            rec.to_hdf5(path, beads=beads)
    assert list(tmp_path.iterdir()) == [tmp_path / "stored.mcap"]
    path.write_text("mine")
    with pytest.raises(FileExistsError, match="run.h5 exists already; .* force=True"):
        rec.to_hdf5(path)
    assert path.read_text() == "mine"
    rec.to_hdf5(path, force=True)
    assert path.read_bytes().startswith(b"\x89HDF") and not (tmp_path / "run.h5.partial").exists()


def test_the_recording_itself_is_never_replaced(rec: bl.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "stored.mcap"
    whole = path.read_bytes()
    (tmp_path / "link.h5").symlink_to(path)
    monkeypatch.chdir(tmp_path)
    for name in (str(path), "stored.mcap", "link.h5"):
        for force in (False, True):
            with pytest.raises(bl.RecordingError, match=f"{name} is the source itself$"):
                rec.to_hdf5(name, force=force)
    # nor is one that is still written, whose name that of a file under way would be
    path.rename("growing.mcap.partial")
    with pytest.raises(bl.RecordingError, match="growing.mcap.partial is the source itself$"):
        bl.open("growing.mcap").to_hdf5("growing.mcap", force=True)
    assert Path("growing.mcap.partial").read_bytes() == whole


def test_an_interrupt_leaves_nothing(rec: bl.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(self: bl.Recording, steps: Any) -> Any:
        yield np.array([0], np.uint64), rec._states.gather_states(np.array([0], np.uint64))
        raise KeyboardInterrupt

    monkeypatch.setattr(bl.Recording, "_blocks", interrupted)
    with pytest.raises(KeyboardInterrupt):
        rec.to_hdf5(tmp_path / "run.h5")
    assert list(tmp_path.iterdir()) == [tmp_path / "stored.mcap"]


def test_memory_does_not_grow_with_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # NumPy's arrays are counted, those of the extension module, too, as soon as they are arrays
    monkeypatch.setattr(_recording, "_BLOCK_BYTES", 1_000_000)
    peaks = []
    for times in (1, 10):
        rec = RUN.replace({"time.duration_s": times * 1e-2}).simulate(every=100)
        tracemalloc.start()
        rec.to_hdf5(tmp_path / f"{times}.h5", every=1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (tmp_path / "10.h5").stat().st_size > 8_000_000
    assert peaks[1] < peaks[0] + 1_000_000
