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
