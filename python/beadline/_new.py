"""Files that are to be made."""

from __future__ import annotations

import os

from .errors import RecordingError


def check_not_source(path: str | os.PathLike[str], source: str | None) -> None:
    """Refuses the path of the recording that a file is made of.

    Raises:
        RecordingError: If it is that, by whatever name.
    """
    if source is not None and os.path.exists(path) and os.path.realpath(path) == os.path.realpath(source):
        raise RecordingError(f"{os.fspath(path)} is the source itself", path=source)


def check_directory(path: str | os.PathLike[str]) -> None:
    """Refuses a path that has no directory.

    Raises:
        FileNotFoundError: If it has none.
    """
    directory = os.path.dirname(path) or "."
    if not os.path.isdir(directory):
        raise FileNotFoundError(f"{os.fspath(path)}: its directory cannot be used: found no {directory}; make it, or choose another one")


def check_free(path: str | os.PathLike[str]) -> None:
    """Refuses a path that something has.

    Raises:
        FileExistsError: If something has it.
    """
    if os.path.lexists(path):
        raise FileExistsError(f"{os.fspath(path)} exists already; choose another name, or replace it with force=True")
