"""Progress of work: a line in a terminal, a bar in a notebook, nothing elsewhere."""

from __future__ import annotations

import html
import shutil
import sys
import time
from types import TracebackType
from typing import Any

# what is done sooner than this shows nothing (s)
_PATIENCE_S = 0.5

# between two looks of a person (s)
_BETWEEN_S = 0.2


class Progress:
    """Shows the finished part of ``total``, and the time for the rest; gone when it ends.

    ``show`` is whether to show it at all; ``None``: in terminals and notebooks. ``unit`` is what is
    counted.
    """

    def __init__(
        self, total: int, what: str, show: bool | None = None, unit: str = "steps"
    ) -> None:
        self._total, self._what, self._unit = total, what, unit
        self._in_notebook = _is_notebook()
        self._is_shown = show if show is not None else self._in_notebook or sys.stderr.isatty()
        self._begin_s = time.monotonic()
        self._next_s = self._begin_s + _PATIENCE_S
        self._cell: Any = None
        self._width = 0

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._write("")

    def update(self, done: int) -> None:
        """``done`` of the total are done now."""
        now_s = time.monotonic()
        if not self._is_shown or now_s < self._next_s:
            return
        self._next_s = now_s + _BETWEEN_S
        rate = done / (now_s - self._begin_s)
        decimals = 0 if rate >= 100 else 1
        left = f", {duration((self._total - done) / rate)} left" if done else ""
        text = (
            f"{self._what}: {done:,} of {self._total:,} {self._unit}, {rate:,.{decimals}f}/s{left}"
        )
        self._write(self._bar(done, text) if self._in_notebook else text)

    def _bar(self, done: int, text: str) -> str:
        bar = f'<progress value="{done}" max="{max(self._total, 1)}"></progress>'
        return f"{bar} <small>{html.escape(text)}</small>"

    def _write(self, text: str) -> None:
        if self._in_notebook:
            display: Any = sys.modules["IPython"].display
            if self._cell is not None:
                self._cell.update(display.HTML(text))
            elif text:
                self._cell = display.display(display.HTML(text), display_id=True)
            return
        # spaces cover the line before, since not every terminal knows a code for that
        text = text[: shutil.get_terminal_size().columns - 1]
        if text or self._width:
            print(
                f"\r{text.ljust(self._width)}",
                end="" if text else "\r",
                file=sys.stderr,
                flush=True,
            )
            self._width = len(text)


def _is_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell: Any = ipython.get_ipython() if ipython else None
    return hasattr(shell, "kernel")


def duration(duration_s: float) -> str:
    """A rough time, as people say it."""
    days = duration_s / 86400
    if days > 3:
        return f"{days:,.0f} days" if days < 1000 else f"{days / 365.25:,.0f} years"
    minutes, seconds = divmod(round(duration_s), 60)
    hours, minutes = divmod(minutes, 60)
    return (
        f"{hours} h {minutes} min"
        if hours
        else f"{minutes} min {seconds} s"
        if minutes
        else f"{seconds} s"
    )
