"""Files that are to be made."""

from __future__ import annotations

import os


def check_free(path: str | os.PathLike[str]) -> None:
    """Refuses a path that something has.

    Raises:
        FileExistsError: If something has it.
    """
    if os.path.lexists(path):
        raise FileExistsError(f"{os.fspath(path)} exists already; choose another name, or replace it with force=True")
