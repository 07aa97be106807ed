"""The command ``beadline`` in a process of its own, for work on whole files."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from .errors import CommandError, CommandValueError, RecordingError

Json = dict[str, Any]

# of this very package, wherever it was found, and whatever modules lie in the working directory
_PLACE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_PROGRAM = f"import sys; sys.path.insert(0, {_PLACE!r}); from beadline.__main__ import main; main()"
PROGRAM = (sys.executable, "-P", "-c", _PROGRAM)

# how long a command that was asked to stop may take to finish its files (s)
_PATIENCE_S = 10.0


# flags that have another name here than their own
_KEYS = {
    "every-step": "every_step=True",
    "every-steps": "every",
    "force": "force=True",
    "from": "from_s",
    "no-fill": "fill=False",
    "out": "path",
    "until": "until_s",
}


def run_command(
    arguments: Sequence[str], *, path: str | None = None, warn: bool = True, keys: Mapping[str, str] | None = None
) -> Json:
    """Runs ``beadline ARGUMENTS --json`` and gives what it prints. Ctrl-C ends it in order.

    If it finished, but something was lost or is not proven, its notices become a warning, if ``warn``.
    ``path`` is the recording that it reads: a fault of this file is a :class:`RecordingError`. ``keys`` are the arguments here
    that flags are made of.
    """
    command = [*PROGRAM, *arguments, "--json"]
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
    raise failure(said.splitlines(), code, path, {**_KEYS, **(keys or {})})


def failure(lines: list[str], code: int, path: str | None, keys: Mapping[str, str] = _KEYS) -> Exception:
    """The error message of a command that failed, as an exception."""
    try:
        told = json.loads(lines[-1])["error"]
        message = ": ".join([told["message"], *told["causes"]])
    except (IndexError, KeyError, TypeError, ValueError):
        message = lines[-1].removeprefix("beadline: ") if lines else f"the command ended with {code}"
    message, key = _in_words(message, keys)
    if path is not None and os.path.basename(path) in message and key is None:
        return RecordingError(message, path=path)
    if code == 2 and "exists already" in message:
        return FileExistsError(message)
    error = CommandValueError(message, key=key) if code == 2 else CommandError(message)
    error.exit_code = code
    return error


# how a command says which flag is wrong, and how that is said here
_WRONG = (
    (r"invalid value '(?P<found>.*?)' for '--(?P<flag>[a-z-]+).*?': (?P<why>.*)", "{key}: found {found}; {why}"),
    (r"invalid value '(?P<found>.*?)' for '--(?P<flag>[a-z-]+).*?' \[possible values: (?P<why>.*)\]", "{key}: found {found}; expected {why}"),
    (r"--(?P<flag>[a-z-]+) (?P<found>[^:]+|\w+:\S+): (?P<why>.*)", "{key}: found {found}; {why}"),
    (r"the argument '(?P<found>--[a-z-]+).*?' cannot be used with '--(?P<flag>[a-z-]+).*?'(?P<why>).*", "{key}: found it beside {found}; expected one of them"),
    (r"the following required arguments were not provided: --(?P<flag>[a-z-]+)(?P<found>)(?P<why>).*", "{key}: found none; expected one or more"),
)


def _in_words(message: str, keys: Mapping[str, str]) -> tuple[str, str | None]:
    """A command's message about its flags, in words of the arguments here; and the wrong argument."""
    message = message.partition(": For more information, try")[0]

    def key_of(flag: str) -> str:
        return keys.get(flag, flag.replace("-", "_"))

    wrong: str | None = None
    for pattern, words in _WRONG:
        if found := re.fullmatch(pattern, message, re.S):
            wrong = key_of(found["flag"])
            message = words.format(key=wrong, found=found["found"], why=found["why"])
            break
    # commands in quotes stay as they are typed
    return re.sub(r"`[^`]*`|--([a-z][a-z-]*)", lambda it: key_of(it[1]) if it[1] else it[0], message), wrong
