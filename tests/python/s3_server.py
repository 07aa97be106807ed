"""An S3 server (moto) on a free port of the loopback, which it says in its output; it ends when its stdin does."""

import os
import sys
import threading

from moto.server import main


def end_with_stdin():
    sys.stdin.buffer.read()
    os._exit(0)


threading.Thread(target=end_with_stdin, daemon=True).start()
main(["-p", "0"])
