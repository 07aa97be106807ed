"""The command ``beadline``; also ``python -m beadline``."""

from __future__ import annotations

import sys

from ._native import command


def main() -> None:
    """Does what the arguments of this process say, and ends it."""
    command(["beadline", *sys.argv[1:]], [sys.executable, "-m", "beadline"])


if __name__ == "__main__":
    main()
