"""Runs the commands of a page of the guide, as a reader would, with the `beadline` that stands first in PATH.

    python3 run_page.py docs/guide/1-first-run.md ["beadline demo"]

In an empty directory. Blocks named `sh` have to succeed, `sh fails` have to end with an error; `sh install` is left out, and blocks that have
the words which are given.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

page = Path(sys.argv[1]).read_text(encoding="utf-8")
blocks = re.findall(r"^```(sh[^\n]*)\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)
run = 0
with tempfile.TemporaryDirectory() as place:
    for kind, code in blocks:
        if kind not in ("sh", "sh fails") or any(words in code for words in sys.argv[2:]):
            continue
        code = f"set -euo pipefail\n{code}"
        environment = os.environ | {"HOME": place}
        ended = subprocess.run(["bash", "-c", code], cwd=place, env=environment, capture_output=True, text=True)
        if (ended.returncode == 0) != (kind == "sh"):
            sys.exit(f"{code}\nended with {ended.returncode}:\n{ended.stdout}{ended.stderr}")
        run += 1
print(f"{sys.argv[1]}: {run} blocks of commands end as they should")
