"""What is installed, and how it starts."""

import inspect
import json
import os
import pickle
import re
import signal
import socket
import subprocess
import sys
import tomllib
from pathlib import Path

import beadline as bl
import numpy as np
import pytest

REPOSITORY = Path(__file__).parents[2]


def python(code: str) -> str:
    """What an interpreter of its own prints."""
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.strip()


def short_run(**values: object) -> bl.Run:
    chain = bl.Chain(beads=20, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    return bl.Run(chain, strikers={0: 5.0}, duration_s=2e-4, **values)


def test_the_command_comes_with_the_package_and_has_its_version() -> None:
    asked = [sys.executable, "-m", "beadline", "--version"]
    assert subprocess.run(asked, check=True, capture_output=True, text=True).stdout.split()[1] == bl.__version__
    beside = Path(sys.executable).parent / "beadline"
    # not there where the package is used as it lies in the repository
    if beside.exists():
        said = subprocess.run([beside, "--version"], check=True, capture_output=True, text=True).stdout
        assert said.split()[1] == bl.__version__


def test_the_command_of_the_package_records_and_verifies(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "beadline"]
    subprocess.run([*command, "run", "--duration", "1e-4", "--name", "run"], cwd=tmp_path, check=True, capture_output=True)
    verified = subprocess.run([*command, "verify", "run.mcap", "--json"], cwd=tmp_path, check=True, capture_output=True)
    assert json.loads(verified.stdout)


def test_ctrl_c_ends_a_command_that_does_not_look_for_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        silent.settimeout(30)
        url = f"http://127.0.0.1:{silent.getsockname()[1]}/run.mcap"
        process = subprocess.Popen([sys.executable, "-m", "beadline", "info", url])
        connection, _ = silent.accept()
        with connection:
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=30) == -signal.SIGINT


def test_a_job_array_starts_the_command_of_the_package(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('[base]\npreset = "striker-3g"\n[grid]\nchain.alpha = [1.5, 2.0]\n')
    command = [sys.executable, "-m", "beadline", "sweep", "s.toml", "--out", "all", "--slurm"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    script = (tmp_path / "all" / "slurm" / "array.sh").read_text()
    assert f"'{os.path.abspath(sys.executable)}' '-m' 'beadline' sweep" in script


def test_numpy_is_loaded_when_it_is_needed() -> None:
    assert python("import beadline, sys; print('numpy' in sys.modules, 'beadline' in dir(beadline))").startswith("False")
    assert python("import beadline, sys; beadline.open; print('numpy' in sys.modules)") == "True"


def test_extras_are_not_loaded_by_the_core() -> None:
    code = (
        "import sys, beadline as bl; [getattr(bl, name) for name in bl.__all__];"
        "print(*{'pandas', 'polars', 'pyarrow', 'xarray', 'dask', 'zarr', 'h5py', 'matplotlib', 'anywidget', 'IPython'} & sys.modules.keys())"
    )
    assert python(code) == ""


@pytest.mark.parametrize("name", bl.__all__)
def test_every_public_name_says_what_it_is(name: str) -> None:
    thing = getattr(bl, name)
    if name == "__version__":
        return
    assert inspect.getdoc(thing), name
    if inspect.isclass(thing):
        for member, value in vars(thing).items():
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert inspect.getdoc(value), f"{name}.{member}"


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nothing"):
        getattr(bl, "nothing")
    assert set(bl.__all__) == set(dir(bl))


@pytest.mark.parametrize(
    ("module", "extra", "ask"),
    [
        ("pandas", "pandas", "rec.energies().to_pandas()"),
        ("polars", "polars", "rec.energies().to_polars()"),
        ("pyarrow", "arrow", "rec.energies().to_arrow()"),
        ("xarray", "xarray", "rec.to_xarray(every=10)"),
        ("h5py", "hdf5", "rec.to_hdf5('run.h5')"),
        ("zarr", "zarr", "rec.to_zarr('run.zarr')"),
        ("matplotlib", "plot", "rec.plot('velocity')"),
        ("anywidget", "widget", "rec.widget()"),
    ],
)
def test_a_missing_extra_is_asked_for_with_the_pip_line(
    module: str, extra: str, ask: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for loaded in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, loaded)
    # None is how Python marks a module that cannot be imported
    monkeypatch.setitem(sys.modules, module, None)
    rec = short_run().simulate(every=10)
    with pytest.raises(bl.MissingExtraError) as raised:
        eval(ask, {"rec": rec})
    assert f'pip install "beadline[{extra}]"' in str(raised.value)
    assert isinstance(raised.value, ImportError)


def test_errors_travel_between_processes_with_what_they_know() -> None:
    error = bl.RecordingError("damaged", path="a.mcap", byte=7, frame=3, remedy="copy it again")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is bl.RecordingError and str(again) == "damaged"
    assert (again.path, again.byte, again.frame, again.remedy) == ("a.mcap", 7, 3, "copy it again")


def test_recordings_travel_between_processes(tmp_path: Path) -> None:
    kept = short_run().simulate(every=10)
    for rec in (kept, kept.save(tmp_path / "run.mcap")):
        again = pickle.loads(pickle.dumps(rec))
        assert again.path == rec.path
        assert np.array_equal(again.velocity[::7], rec.velocity[::7])


def test_the_bench_prints_each_figure_beside_its_limit() -> None:
    bench = subprocess.run([sys.executable, "-m", "beadline.bench", "--quick"], capture_output=True, text=True)
    assert bench.returncode in (0, 3), bench.stderr
    lines = bench.stdout.splitlines()
    assert len(lines) == 5
    assert all(re.search(r"\d .*[≤≥] [\d,.]+ +(met|missed) ", line) for line in lines), bench.stdout
    assert (bench.returncode == 3) == any(" missed " in line for line in lines)


def test_the_package_is_built_of_what_the_command_is_built_of() -> None:
    def versions(lock: Path) -> dict[str, set[str]]:
        found: dict[str, set[str]] = {}
        for package in tomllib.loads(lock.read_text())["package"]:
            found.setdefault(package["name"], set()).add(package["version"])
        return found

    command, package = versions(REPOSITORY / "Cargo.lock"), versions(REPOSITORY / "python/Cargo.lock")
    differing = {name for name in package.keys() & command.keys() if not package[name] <= command[name]}
    assert not differing, "python/Cargo.lock: cargo update -p NAME --precise VERSION"
