"""The pages of docs/python are true: their code runs, and prints what they say."""

from __future__ import annotations

import contextlib
import doctest
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from analyses import MODULE as METHODS
from analyses import module as methods
from reference import CHAPTERS, PAGE, reference

import beadline

DOCS = Path(__file__).resolve().parents[2] / "docs" / "python"
PAGES = sorted(path for path in DOCS.glob("[1-9]-*.md"))

# ends what a block prints
END = "\x1e"

# of a page, on a busy machine
WATCHDOG_S = 120.0


def blocks(page: Path) -> Iterator[tuple[str, int, list[str]]]:
    """The fenced blocks of a page: what they are, their first line (from 0), and their lines."""
    kind, first, lines = None, 0, list[str]()
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines()):
        if not line.startswith("```"):
            lines.append(line)
        elif kind is None:
            kind, first, lines = line[3:], number + 1, []
        else:
            yield kind, first, lines
            kind = None


def program(page: Path) -> tuple[str, list[str | None]]:
    """A page as a program that has its lines where the page has them, and what each block prints."""
    lines = [""] * len(page.read_text(encoding="utf-8").splitlines())
    printed: list[str | None] = []
    for kind, first, block in blocks(page):
        if kind == "text":
            printed[-1] = "\n".join(block)
        elif kind == "python":
            lines[first : first + len(block)] = block
            lines[first + len(block)] = f"print({END!r}, flush=True)"
            printed.append(None)
        elif kind == "sh terminal":
            # in the background, as in another terminal
            command = f"Popen({chr(10).join(block)!r}, shell=True, stdout=DEVNULL)"
            lines[first] = f"from subprocess import DEVNULL, Popen; {command}"
        else:
            assert kind in ("sh install", "toml"), f"{page.name}: a block of {kind!r}"
    return "\n".join(lines), printed


@pytest.fixture
def environment(tmp_path: Path) -> Iterator[dict[str, str]]:
    """An environment of its own, in which the command is the one of this package."""
    command = tmp_path / "bin" / "beadline"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m beadline "$@"\n')
    command.chmod(0o755)
    package = str(Path(beadline.__file__).resolve().parents[1])
    # as in an activated environment
    path = f"{command.parent}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    # names of sockets have no room for more
    with tempfile.TemporaryDirectory(prefix="bl-", dir="/tmp") as root:
        own = {"PATH": path, "BEADLINE_ROOT": root, "MPLBACKEND": "Agg", "PYTHONPATH": package}
        yield {**os.environ, **own, "IPYTHONDIR": str(tmp_path / "ipython")}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_does_what_it_says(page: Path, tmp_path: Path, environment: dict[str, str]) -> None:
    text, expected = program(page)
    (tmp_path / "page.py").write_text(text, encoding="utf-8")
    # files, since what runs in the background keeps a pipe open
    with open(tmp_path / "out", "w+") as out_file, open(tmp_path / "said", "w+") as said_file:
        process = subprocess.Popen(
            [sys.executable, "page.py"],
            cwd=tmp_path,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=out_file,
            stderr=said_file,
            start_new_session=True,
        )
        try:
            process.wait(timeout=WATCHDOG_S)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    out, said = ((tmp_path / name).read_text(encoding="utf-8") for name in ("out", "said"))
    assert process.returncode == 0, f"{page.name}:\n{said}"
    found = [part.strip("\n") for part in out.split(END)][:-1]
    assert len(found) == len(expected)
    checker = doctest.OutputChecker()
    for want, got in zip(expected, found, strict=True):
        if want is not None:
            want = want.replace("…", "...") + "\n"
            assert checker.check_output(want, got + "\n", doctest.ELLIPSIS), f"{want}\nbut:\n{got}"


def test_the_index_names_every_page() -> None:
    index = (DOCS / "README.md").read_text(encoding="utf-8")
    assert [page.name for page in PAGES] == re.findall(r"\]\(([1-9]-[a-z-]+\.md)\)", index)


def test_the_reference_is_that_of_this_package() -> None:
    public = set(beadline.__all__) - {"__version__"}
    assert {name for names in CHAPTERS.values() for name in names} == public
    is_current = PAGE.read_text(encoding="utf-8") == reference()
    assert is_current, "write it again: python python/tests/reference.py"


def test_the_notebook_runs(tmp_path: Path, environment: dict[str, str]) -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    manager = pytest.importorskip("jupyter_client").AsyncKernelManager()
    # the Python of this test, rather than one that is installed for notebooks
    manager.kernel_spec.argv[0] = sys.executable
    notebook = nbformat.read(DOCS / "newcomer.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "it is kept without outputs"
    client = nbclient.NotebookClient(
        notebook, km=manager, timeout=WATCHDOG_S, resources={"metadata": {"path": str(tmp_path)}}
    )
    # figures go into the cells
    inline = "module://matplotlib_inline.backend_inline"
    client.execute(env={**environment, "MPLBACKEND": inline})
    shown = [
        output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])
    ]
    assert sum("image/png" in data for data in shown) >= 6
    assert any("data:image/png" in data.get("text/html", "") for data in shown)


def test_the_methods_of_analyses_are_those_of_the_list() -> None:
    is_current = METHODS.read_text(encoding="utf-8") == methods()
    assert is_current, "write them again: python python/tests/analyses.py"
