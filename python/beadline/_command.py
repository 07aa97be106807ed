"""The command ``beadline`` in a process of its own: what works on whole files is asked of it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from .errors import CommandError, RecordingError

Json = dict[str, Any]

# of this very package, wherever it was found, and whatever modules lie in the working directory
_PLACE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_PROGRAM = f"import sys; sys.path.insert(0, {_PLACE!r}); from beadline.__main__ import main; main()"

# how long a command that was asked to stop may take to finish its files (s)
_PATIENCE_S = 10.0


def run_command(arguments: Sequence[str], *, path: str | None = None, warn: bool = True) -> Json:
    """Runs ``beadline ARGUMENTS --json`` and gives what it prints. Ctrl-C ends it in order.

    If it finished, but something was lost or is not proven, its notices become a warning, if ``warn``.
    ``path`` is the recording that it reads: what is wrong with that is a :class:`RecordingError`.
    """
    command = [sys.executable, "-P", "-c", _PROGRAM, *arguments, "--json"]
    # communicate() waits 0.25 s more when it is interrupted, and a file needs nobody who reads it meanwhile
    with tempfile.TemporaryFile() as notices:
        # in a session of its own, so that a Ctrl-C reaches it once, from here
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=notices,
            start_new_session=True,
        )
        with process:
            assert process.stdout is not None
            try:
                out = process.stdout.read()
                code = process.wait()
            except BaseException:
                process.send_signal(signal.SIGINT)
                try:
                    with suppress(subprocess.TimeoutExpired):
                        process.wait(_PATIENCE_S)
                finally:
                    process.kill()
                raise
        notices.seek(0)
        said = notices.read().decode(errors="replace").strip()
    if code == 0 or (code == 3 and out.strip()):
        found: Json = json.loads(out) if out.strip() else {}
        if code == 3 and warn and said:
            warnings.warn(said.replace("beadline: ", ""), RuntimeWarning, stacklevel=5)
        return found
    raise _failure(said.splitlines(), code, path)


def _failure(lines: list[str], code: int, path: str | None) -> CommandError | RecordingError:
    try:
        told = json.loads(lines[-1])["error"]
        message = ": ".join([told["message"], *told["causes"]])
    except (IndexError, KeyError, TypeError, ValueError):
        message = lines[-1] if lines else f"the command ended with {code}"
    message = message.replace("--force", "force=True").removesuffix(": For more information, try '--help'.")
    if path is not None and os.path.basename(path) in message:
        return RecordingError(message, path=path)
    error = CommandError(message)
    error.exit_code = code
    return error
