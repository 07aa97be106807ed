"""A recording in a cell of a notebook: the page that ``share`` writes, which Python and the pointer move."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import anywidget
import traitlets

from ._numbers import count, in_si

if TYPE_CHECKING:
    from ._recording import Recording

# quantities of the page
_FIELDS = ("velocity", "displacement", "overlap", "energy", "contacts", "force")


class Widget(anywidget.AnyWidget):
    """A recording in a notebook, with every step in it.

    Attributes:
        step: The step of the cursor.
        bead: The chosen bead; None: that of the page.
        field: The quantity that is shown.
        window_s: The first and the last time in view (s); None: all of them.
        height_px: Its height (pixels).
    """

    _esm = Path(__file__).with_name("widget.js")
    _page = traitlets.Unicode().tag(sync=True)
    # unlike Any it refuses None
    step: traitlets.TraitType[Any, Any] = traitlets.TraitType().tag(sync=True)
    bead = traitlets.Any(None).tag(sync=True)
    field = traitlets.Enum(_FIELDS, "velocity").tag(sync=True)
    window_s = traitlets.Any(None).tag(sync=True)
    height_px = traitlets.Int(640, min=1).tag(sync=True)

    def __init__(self, rec: Recording, page: str, height_px: int) -> None:
        self._rec = rec
        super().__init__(_page=page, step=rec.last_step, height_px=count("height_px", height_px))

    @traitlets.validate("step")
    def _check_step(self, proposal: Any) -> int:
        return self._within("step", proposal["value"], self._rec.first_step, self._rec.last_step)

    @traitlets.validate("bead")
    def _check_bead(self, proposal: Any) -> int | None:
        found = proposal["value"]
        return None if found is None else self._within("bead", found, 0, self._rec.beads - 1)

    @traitlets.validate("window_s")
    def _check_window(self, proposal: Any) -> list[float] | None:
        found = in_si("window_s", proposal["value"])
        if found is None:
            return None
        begin_s, end_s = self._rec.first_step * self._rec.dt_s, self._rec.last_step * self._rec.dt_s
        try:
            first_s, last_s = map(float, found)
        except (TypeError, ValueError):
            first_s = last_s = 0.0
        if not first_s < last_s or last_s <= begin_s or first_s >= end_s:
            expected = f"two times from {begin_s:g} s to {end_s:g} s, such as ({begin_s:g}, {end_s:g}), or None"
            raise traitlets.TraitError(f"window_s: found {found!r}; expected {expected}")
        return [first_s, last_s]

    def _within(self, key: str, found: Any, first: int, last: int) -> int:
        try:
            number = count(key, found, first)
        except ValueError as error:
            raise traitlets.TraitError(str(error)) from None
        if number > last:
            raise traitlets.TraitError(f"{key}: found {found}; expected {first} to {last}")
        return number
