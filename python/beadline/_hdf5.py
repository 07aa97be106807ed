"""HDF5 in the layout of H5MD 1.1 (doi:10.1016/j.cpc.2014.01.018), for everything that reads molecular dynamics."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from . import __version__
from ._extras import need
from ._new import check_free, check_not_source

if TYPE_CHECKING:
    from ._native import Doubles, Numbers
    from ._recording import Recording

# of a chunk of a dataset, unless a single state has more
_CHUNK_BYTES = 1 << 20
# of a chunk of a dataset with one value for each state
_CHUNK_STATES = 1 << 13


def write(rec: Recording, path: str | os.PathLike[str], steps: range | Numbers, places: range, force: bool) -> None:
    """Writes these steps and neighbouring beads of a recording. The file has its name when it is whole."""
    h5py = need("h5py")
    path = os.fspath(path)
    partial = f"{path}.partial"
    for name in (path, partial):
        check_not_source(name, rec.path)
        if not force:
            check_free(name)
    # HDF5 locks it: whoever else writes it is an error, and keeps the file
    file = h5py.File(partial, "w")
    try:
        with file:
            _describe_run(file, rec, places)
            _write_states(file.create_group("particles/chain"), rec, steps, places)
        with open(partial, "rb") as whole:
            os.fsync(whole.fileno())
        if not force:
            check_free(path)
        os.replace(partial, path)
    except BaseException:
        with suppress(FileNotFoundError):
            os.remove(partial)
        raise


def _describe_run(file: Any, rec: Recording, places: range) -> None:
    """The groups ``h5md``, which names the layout, and ``parameters``: the manifest, and its values that are looked up most."""
    file.create_group("h5md").attrs["version"] = np.array([1, 1], np.int32)
    # the layout asks for one
    file.create_group("h5md/author").attrs["name"] = rec.manifest["provenance"].get("author", "unknown")
    file.create_group("h5md/creator").attrs.update(name="beadline", version=__version__)
    file.create_group("h5md/modules/units").attrs.update(version=np.array([1, 0], np.int32), system="SI")

    parameters, physics = file.create_group("parameters"), rec.manifest["physics"]
    parameters["manifest"] = [rec._manifest.json]
    facts = {"alpha": rec.alpha, **{name: physics[name] for name in ("dt_s", "step_count", "method")}}
    parameters.attrs.update({name: value for name, value in facts.items() if value == value})
    contacts = slice(places.start, places.stop - 1)
    if "bonds" not in physics:
        power = np.format_float_positional(rec.alpha, trim="-") if "alpha" in parameters.attrs else "alpha"
        _of_unit(parameters, "stiffness", f"N m-{power}", rec.stiffness[contacts])
    _of_unit(parameters, "rest_overlap", "m", rec.rest_overlap_m[contacts])


def _write_states(chain: Any, rec: Recording, steps: range | Numbers, places: range) -> None:
    """The group of the beads: what does not change, and a row with each state."""
    chain.create_group("box").attrs.update(dimension=np.int32(1), boundary=["none"])
    chain["id"] = np.arange(places.start, places.stop)
    _of_unit(chain, "mass", "kg", rec.mass_kg[places.start : places.stop])

    states, beads = len(steps), len(places)
    scalars: dict[str, Any] = {"shape": (states,), "maxshape": (None,), "chunks": (_CHUNK_STATES,)}
    rows = min(max(_CHUNK_BYTES // (8 * beads), 1), _CHUNK_STATES)
    vectors: dict[str, Any] = {"shape": (states, beads, 1), "maxshape": (None, beads, 1), "chunks": (rows, beads, 1)}
    step = chain.create_dataset("position/step", dtype=np.int64, **scalars)
    time_s = _of_unit(chain, "position/time", "s", **scalars)
    position = _of_unit(chain, "position/value", "m", **vectors)
    velocity = _of_unit(chain, "velocity/value", "m s-1", **vectors)
    chain["velocity/step"], chain["velocity/time"] = step, time_s
    begin = 0
    for block, doubles in rec._blocks(steps):
        end = begin + len(block)
        step[begin:end], time_s[begin:end] = block, block * rec.dt_s
        position[begin:end, :, 0] = doubles[:, places.start : places.stop]
        velocity[begin:end, :, 0] = doubles[:, rec.beads + places.start : rec.beads + places.stop]
        begin = end


def _of_unit(group: Any, name: str, unit: str, values: Doubles | None = None, **shape: Any) -> Any:
    """A dataset of doubles."""
    dataset = group.create_dataset(name, data=values, dtype=np.float64, **shape)
    dataset.attrs["unit"] = unit
    return dataset
