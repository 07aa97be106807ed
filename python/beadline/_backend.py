"""Recordings for ``xarray.open_dataset``, which finds this module by the entry point ``xarray.backends``."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import xarray as xr
from xarray.backends import BackendEntrypoint

# of each of our files: magic, the opcode of the header, 8 bytes of its length, and its profile, a text
_MAGIC, _PROFILE = b"\x89MCAP0\r\n\x01", b"\x08\0\0\0beadline"


class BeadlineBackend(BackendEntrypoint):
    """Opens recordings as ``rec.to_xarray()`` gives them."""

    description = "Recordings of Beadline (.mcap)"
    url = "https://github.com/beadline/beadline/blob/main/docs/python/3-analyses.md"

    def open_dataset(
        self,
        filename_or_obj: Any,
        *,
        drop_variables: str | Iterable[str] | None = None,
        every: int | None = None,
        fields: Iterable[str] | None = None,
    ) -> xr.Dataset:
        """A recording as ``rec.to_xarray(every, fields)``, without variables that are to be dropped."""
        from ._recording import open as open_recording

        if not isinstance(filename_or_obj, str | os.PathLike):
            raise TypeError(f"found {type(filename_or_obj).__name__}; expected the path or URL of a recording")
        rec = open_recording(filename_or_obj)
        dropped = [drop_variables] if isinstance(drop_variables, str) else list(drop_variables or ())
        data = rec.to_xarray(every, None if fields is None else list(fields)).drop_vars(dropped, errors="ignore")
        data.set_close(rec.close)
        return data

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        """True of an ``.mcap`` whose header names Beadline, of such a URL, and of such a file that is not there."""
        if not isinstance(filename_or_obj, str | os.PathLike):
            return False
        path = os.fspath(filename_or_obj)
        if not path.removesuffix(".partial").endswith(".mcap"):
            return False
        try:
            with open(path, "rb") as file:
                head = file.read(len(_MAGIC) + 8 + len(_PROFILE))
        except OSError:
            # a URL, or no file, of which the error is ours
            return True
        return head.startswith(_MAGIC) and head.endswith(_PROFILE)
