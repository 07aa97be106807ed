"""Opens recordings whose manifests somebody has changed with the package `beadline`.

    python check_manifests.py LIST.json

LIST.json has pairs of a path and whether the command refuses its manifest. Each is read or refused with an error of the package; a panic is none.
Exit code 0 if all is so.
"""

import json
import sys
from pathlib import Path

import beadline as bl


def said(path: str) -> BaseException | None:
    """The error with which a file is refused; none if it is read."""
    try:
        recording = bl.open(path)
        recording.mass_kg
        if recording.velocity.shape[1] <= 200:
            recording.velocity[0]
    except BaseException as error:  # noqa: BLE001 a panic is no Exception
        return error
    return None


wrong = []
pairs = json.loads(Path(sys.argv[1]).read_text())
for path, is_refused in pairs:
    error = said(path)
    if error is not None and not isinstance(error, (bl.BeadlineError, OSError, ValueError, IndexError)):
        wrong.append(f"{path}: {type(error).__name__}: {error}")
    elif error is None and is_refused:
        wrong.append(f"{path}: the command refuses it, the package does not")
print(len(pairs), "files")
sys.exit("\n".join(wrong) or None)
