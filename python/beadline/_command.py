"""The command ``beadline`` in a process of its own: what works on whole files is asked of it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from .errors import CommandError, RecordingError

Json = dict[str, Any]

# how long a command that was asked to stop may take to finish its files (s)
_PATIENCE_S = 10.0


def run_command(arguments: Sequence[str | os.PathLike[str]], *, lossy: bool = False) -> Json:
    """Runs ``beadline ARGUMENTS --json`` and gives what it prints. Ctrl-C ends it in order.

    With ``lossy`` exit code 3 is no error: something was lost, or is not proven, and the answer says what.
    """
    command = [sys.executable, "-m", "beadline", *(os.fspath(argument) for argument in arguments), "--json"]
    # in a session of its own, so that a Ctrl-C reaches it once, from here
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    try:
        out, said = process.communicate()
    except BaseException:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=_PATIENCE_S)
        finally:
            process.kill()
        raise
    code = process.returncode
    if code == 0 or (code == 3 and lossy and out.strip()):
        return _as_json(out)
    raise _failure(said.decode(errors="replace"), code)


def _as_json(out: bytes) -> Json:
    found: Json = json.loads(out) if out.strip() else {}
    return found


def _failure(said: str, code: int) -> CommandError | RecordingError:
    lines = said.strip().splitlines()
    try:
        told = json.loads(lines[-1])["error"]
        message = ": ".join([told["message"], *told["causes"]])
    except (IndexError, KeyError, TypeError, ValueError):
        message = lines[-1] if lines else f"the command ended with {code}"
    error = CommandError(message)
    error.exit_code = code
    return error
