"""The package and the examples of its documentation under two type checkers."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PYTHON = Path(__file__).parents[1]
PAGES = sorted((PYTHON.parent / "docs/python").glob("*.md"))
MYPY = ("mypy", "--strict")
PYRIGHT = ("pyright", "--pythonpath", sys.executable)


def finds_nothing(checker: tuple[str, ...], *arguments: str, cwd: Path = PYTHON) -> None:
    found = {name: str(PYTHON) for name in ("MYPYPATH", "PYTHONPATH")}
    said = subprocess.run(
        [sys.executable, "-m", *checker, *arguments], cwd=cwd, env=os.environ | found, capture_output=True, text=True
    )
    assert said.returncode == 0, said.stdout + said.stderr


def test_mypy_finds_nothing_in_the_package() -> None:
    finds_nothing(MYPY, "beadline")


def test_pyright_finds_nothing_in_the_package() -> None:
    finds_nothing(PYRIGHT)


# Dask's client has no types
@pytest.mark.parametrize("checker", [(*MYPY, "--untyped-calls-exclude=distributed"), PYRIGHT], ids=["mypy", "pyright"])
def test_checkers_find_nothing_in_the_examples_of_the_pages(checker: tuple[str, ...], tmp_path: Path) -> None:
    assert PAGES
    for page in PAGES:
        blocks: list[str] = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.M | re.S)
        (tmp_path / f"{page.stem.replace('-', '_')}_page.py").write_text("\n".join(blocks))
    # as in a user's directory: of what other packages leave untyped, pyright says nothing there
    finds_nothing(checker, ".", cwd=tmp_path)


WRONG = """import beadline as bl
import numpy as np

def of(rec: bl.Recording, table: bl.Table) -> None:
    number: float = rec.velocity[3, 4]
    part: bl.FieldArray = rec.velocity[::10, 4]
    column: bl.Table = table[["time_s"]][:10]
    some = rec.velocity[rec.time_s > 0.1, 5], rec.velocity[[1, 2]], rec.force[..., None], rec.velocity[np.int64(3)]
    print(number, part, column, some)
    rec.velocity["speed"]  # wrong
    rec.velocity[1.5]  # wrong
    rec.velocity[3, "a"]  # wrong
    rec["velocity"]  # wrong
    table[1.5]  # wrong
    rec.velocity[3, 4].shape  # wrong
"""


def test_a_wrong_index_is_found_by_the_checker(tmp_path: Path) -> None:
    (tmp_path / "wrong.py").write_text(WRONG)
    command = [sys.executable, "-m", *MYPY, "wrong.py"]
    environment = os.environ | {"MYPYPATH": str(PYTHON), "PYTHONPATH": str(PYTHON)}
    said = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True).stdout
    found = {int(line) for line in re.findall(r"^wrong\.py:(\d+): error", said, re.M)}
    assert found == {number for number, line in enumerate(WRONG.splitlines(), 1) if line.endswith("# wrong")}, said
