"""Runs a command on a terminal of its own, as its foreground job, and says afterwards how it left the terminal.

    python on_a_terminal.py COMMAND ARGUMENT…

What comes on stdin are the keys; the command's stdout goes to stdout. The last line on stderr is JSON: `exit` of the
command (negative: the signal that killed it), `restored`: whether the terminal has the modes that it had
before, `suspended`: the same for each time that the command was suspended, which is continued at once, and
`screen`: all that was written on it.
"""

import json
import os
import select
import signal
import struct
import sys
import termios
from fcntl import ioctl

COLUMNS, LINES = int(os.environ.get("TERMINAL_COLUMNS", "100")), 24


def main(command):
    controller, terminal = os.openpty()
    ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, COLUMNS, 0, 0))
    before = termios.tcgetattr(terminal)
    child = os.fork()
    if child == 0:
        os.setsid()
        # the first terminal that the leader of a session opens is its own
        own = os.open(os.ttyname(terminal), os.O_RDWR)
        os.dup2(own, 0)
        os.dup2(own, 2)
        os.execvp(command[0], command)
    screen, suspended, keys = bytearray(), [], sys.stdin.fileno()
    watched = [controller, keys]
    ended = None
    while True:
        if ended is None:
            changed, status = os.waitpid(child, os.WNOHANG | os.WUNTRACED)
            if changed and os.WIFSTOPPED(status):
                suspended.append(termios.tcgetattr(terminal) == before)
                os.kill(child, signal.SIGCONT)
            elif changed:
                ended = status
        ready, _, _ = select.select(watched, [], [], 0.02)
        if keys in ready:
            pressed = os.read(keys, 64)
            if pressed:
                os.write(controller, pressed)
            else:
                watched.remove(keys)
        if controller in ready:
            screen += os.read(controller, 65536)
        elif ended is not None:
            break
    after = termios.tcgetattr(terminal)
    result = {
        "exit": os.waitstatus_to_exitcode(ended),
        "restored": after == before,
        "suspended": suspended,
        "screen": screen.decode(errors="replace"),
    }
    print("\n" + json.dumps(result), file=sys.stderr)


main(sys.argv[1:])
