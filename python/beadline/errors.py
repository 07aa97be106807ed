"""Exceptions of the package. Every exception that is not one of Python's own is a :class:`BeadlineError`."""

from __future__ import annotations


class BeadlineError(Exception):
    """Something went wrong in Beadline.

    Unknown attributes are ``None``.

    Attributes:
        path: The file.
        byte: Place of the damage, from the start of the file.
        step, frame, bead: Place of the wrong value.
        key: Key of a configuration.
        line: Its line.
        remedy: A remedy.
    """

    def __init__(
        self,
        message: str,
        *,
        path: str | None = None,
        byte: int | None = None,
        step: int | None = None,
        frame: int | None = None,
        bead: int | None = None,
        key: str | None = None,
        line: int | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(message)
        self.path = path
        self.byte = byte
        self.step = step
        self.frame = frame
        self.bead = bead
        self.key = key
        self.line = line
        self.remedy = remedy
        if remedy is not None and remedy not in message:
            self.add_note(remedy)

    def __reduce__(self) -> tuple[object, ...]:
        # exceptions travel between processes without their keywords
        return _again, (type(self), str(self), self.__dict__)


def _again(kind: type[BeadlineError], message: str, about: dict[str, object]) -> BeadlineError:
    error = kind(message)
    error.__dict__.update(about)
    return error


class ConfigError(BeadlineError, ValueError):
    """An impossible run: ``key`` names the value, the message has the allowed values."""


class RunError(BeadlineError):
    """A run that could not go on: its values are no longer finite."""


class RecordingError(BeadlineError, ValueError):
    """A file that is no recording, is damaged, or does not hold what was asked for."""


class LiveError(BeadlineError):
    """A live run that cannot be attached to, or published."""


class LostError(LiveError):
    """Frames of a live run were lost, or may have been: the run failed, was killed, or dropped this consumer."""


class CommandError(BeadlineError):
    """A command of Beadline's failed.

    Attributes:
        exit_code: 1 failed, 2 bad input or a file in the way, 3 finished with something lost.
    """

    exit_code: int | None = None


class CommandValueError(CommandError, ValueError):
    """A command of Beadline's got an impossible argument: ``key`` names it, the message has the expected values."""


class MissingExtraError(BeadlineError, ImportError):
    """A needed package is not installed; the message has the ``pip`` line."""
