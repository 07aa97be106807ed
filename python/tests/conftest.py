"""Every test has a bus of its own, in a short directory, because sockets lie in it."""

import hashlib
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

# whoever starts the tests in the background may have told them to ignore it, and so all that they start
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    root = Path(tempfile.mkdtemp(prefix="bl-", dir="/tmp")).resolve()
    monkeypatch.setenv("BEADLINE_ROOT", str(root))
    yield root
    # what is in shared memory outlives the directory; docs/FORMAT.md says how it is called
    if (secret := root / "secret").exists():
        prefix = "bl" + hashlib.sha256(bytes(root)).hexdigest()[:6] + secret.read_text()
        for segment in Path("/dev/shm").glob(f"{prefix}_*"):
            segment.unlink(missing_ok=True)
    shutil.rmtree(root, ignore_errors=True)
