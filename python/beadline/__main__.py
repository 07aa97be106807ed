"""The command ``beadline``; also ``python -m beadline``."""

from __future__ import annotations

import signal
import sys

from ._native import command


def main() -> None:
    """Does what the arguments of this process say, and ends it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Python's handler only asks an interpreter, which does not come back: Ctrl-C ends what does not look for it
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    command(["beadline", *sys.argv[1:]], [sys.executable, "-m", "beadline"])


if __name__ == "__main__":
    main()
