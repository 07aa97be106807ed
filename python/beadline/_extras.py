"""Packages that some functions need and that are not installed with this one."""

from __future__ import annotations

import importlib
from types import ModuleType

from .errors import MissingExtraError

# the extra that brings a package, where it has another name
_EXTRAS = {"anywidget": "widget", "h5py": "hdf5", "matplotlib": "plot", "pyarrow": "arrow"}


def need(module: str, extra: str | None = None) -> ModuleType:
    """The module, imported.

    Raises:
        MissingExtraError: If its package is not installed, with the ``pip`` line.
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != package:
            raise
    extra = extra or _EXTRAS.get(package, package)
    raise MissingExtraError(f'this needs {package}: pip install "beadline[{extra}]"')
