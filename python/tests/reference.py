"""Writes docs/python/reference.md: every public name, from its signature and docstring.

python python/tests/reference.py
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import beadline

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python" / "reference.md"

CHAPTERS = {
    "Runs": ["Chain", "Run", "simulate", "Simulation", "preset", "presets"],
    "Recordings": ["open", "Recording", "State", "FieldArray", "Verdict", "View", "compare", "Comparison", "Difference"],
    "Tables": ["Table", "Motion", "Pulses", "Forces"],
    "Orbits": ["orbit", "Orbit", "OrbitMap"],
    "Sweeps": ["sweep"],
    "Live runs": [
        "attach",
        "Live",
        "Frame",
        "attach_async",
        "AsyncLive",
        "analysis",
        "Analysis",
        "consumer",
        "Consumer",
        "live_runs",
        "LiveRun",
        "LiveConsumer",
    ],
    "Errors": [
        "BeadlineError",
        "CommandError",
        "CommandValueError",
        "ConfigError",
        "LiveError",
        "LostError",
        "MissingExtraError",
        "RecordingError",
        "RunError",
    ],
}

# other classes are made by functions and methods
MADE_BY_USERS = ("Chain", "Run", "Table")

BEGIN = """# Reference

`import beadline as bl`. Units are SI and part of names: `_m`, `_s`, `_kg`, `_n`, `_j`, `_m_s`. N is the number of beads. Beads and contacts
are numbered from 0; contact `i` joins beads `i` and `i + 1`. Arrays are of float64 unless they say otherwise. [NOTATION](../NOTATION.md) has
every word.

This page is made of the docstrings, by `python python/tests/reference.py`.
"""


def reference() -> str:
    """The page."""
    parts = [BEGIN, contents()]
    for chapter, names in CHAPTERS.items():
        parts.append(f"## {chapter}\n")
        for name in names:
            parts += filter(None, entry(name, getattr(beadline, name)))
    return "\n".join(parts)


def contents() -> str:
    """A line for each chapter, with links to its names."""
    seen: list[str] = []

    def link(name: str) -> str:
        anchor = re.sub(r"[^\w-]", "", heading(name).lower())
        seen.append(anchor)
        # as GitHub tells headings from each other that differ in capitals only
        return f"[{name}](#{anchor}{f'-{seen.count(anchor) - 1}' if anchor in seen[:-1] else ''})"

    return "\n".join(
        f"- {chapter}: {', '.join(map(link, names))}" for chapter, names in CHAPTERS.items()
    ) + "\n"


def heading(name: str) -> str:
    """A name, of an error with what it is."""
    thing = getattr(beadline, name)
    is_error = inspect.isclass(thing) and issubclass(thing, Exception)
    return name + (f"({', '.join(base.__name__ for base in thing.__bases__)})" if is_error else "")


def entry(name: str, thing: Any) -> Iterator[str]:
    """A function, or a class with its members."""
    is_error = inspect.isclass(thing) and issubclass(thing, Exception)
    yield f"### {heading(name)}\n"
    if not is_error:
        yield signature(name, thing)
    yield prose(thing)
    members = dict(public(thing)) if inspect.isclass(thing) and not is_error else {}
    attributes = {at: member for at, member in members.items() if is_attribute(member)}
    if attributes:
        rows = [f"| `{at}` | {' '.join(prose(it).split())} |" for at, it in attributes.items()]
        yield "\n".join(["| attribute | |", "|---|---|", *rows, ""])
    for at, member in members.items():
        if at not in attributes:
            yield f"#### {name}.{at}\n"
            yield signature(at, member)
            yield prose(member)


def public(kind: type) -> Iterator[tuple[str, Any]]:
    """The members that a class has of itself, or of a class that is not on this page, which are not private."""
    hidden = [one for one in kind.__mro__[1:] if one.__module__.startswith("beadline.") and not hasattr(beadline, one.__name__)]
    own = [item for one in (kind, *hidden) for item in vars(one).items()]
    if kind.__module__ == "beadline":
        # those of Rust come in any order
        own.sort(key=lambda item: item[0])
    for name, member in own:
        is_ours = is_attribute(member) or callable(getattr(member, "__func__", member))
        if is_ours and not name.startswith("_"):
            yield name, member


def is_attribute(member: object) -> bool:
    return isinstance(member, property | cached_property) or inspect.isdatadescriptor(member)


def signature(name: str, thing: Any) -> str:
    """How it is called; nothing if only this package calls it."""
    if inspect.isclass(thing) and name not in MADE_BY_USERS:
        return ""
    try:
        found = inspect.signature(getattr(thing, "__func__", thing))
    except (TypeError, ValueError):
        return ""
    # methods that are functions of other modules call themselves ``rec``
    arguments = [one for at, one in found.parameters.items() if at not in ("self", "cls", "rec")]
    found = found.replace(parameters=arguments)
    # annotations are texts
    text = name + re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(found)).removesuffix(" -> None")
    if len(text) > 100:
        inner, end = text[len(name) + 1 :].rsplit(")", 1)
        inner = re.sub(r", (?=\*|/|\w+: |\w+=)", ",\n    ", inner)
        text = f"{name}(\n    {inner},\n){end}"
    return f"```text\n{text}\n```\n"


def prose(thing: Any) -> str:
    """A docstring as Markdown."""
    lines: list[str] = []
    is_list = False
    for line in inspect.cleandoc(inspect.getdoc(thing) or "").splitlines():
        if re.fullmatch(r"(Args|Attributes|Raises):", line):
            is_list = True
            lines += [f"{line.removesuffix(':')}:", ""]
        elif is_list and (found := re.match(r"    (\S[^:]*): (.*)", line)):
            names = ", ".join(f"`{name}`" for name in found[1].split(", "))
            lines.append(f"- {names}: {found[2]}")
        else:
            is_list = is_list and (line.startswith("    ") or not line)
            lines.append(f"  {line.strip()}" if is_list and line else line)
    text = "\n".join(lines).strip() + "\n"
    text = re.sub(r":mod:(`[^`]+`)", r"\1", text)
    text = re.sub(r":\w+:`(?:~?\w+\.)*(\w+)`", r"`\1`", text)
    text = text.replace("``", "`")
    # examples, up to an empty line
    return re.sub(r"(?ms)^>>> .*?(?=\n\n|\n\Z)", r"```text\n\g<0>\n```", text)


if __name__ == "__main__":
    PAGE.write_text(reference(), encoding="utf-8")
