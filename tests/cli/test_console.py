"""What a terminal shows while a command works: the bar, its counts, and notes beside it."""

import os
import re
import struct
import subprocess
import sys

import pytest

fcntl = pytest.importorskip("fcntl")  # terminals of this kind are those of Unix
pty, termios = pytest.importorskip("pty"), pytest.importorskip("termios")

WORK = """
import time
from seakeep.cli.console import messages, progress_bar, tell_warnings
from seakeep.errors import warn

with tell_warnings(), progress_bar("Preparing") as progress:
    for done in (1, 2, 3):
        progress(done, 1234, "clocks and waves of a run whose name takes all of a narrow terminal")
        time.sleep(0.3)  # a bar is drawn ten times a second
        if done == 2:
            warn("something to know")
            messages().print("Wrote a file")
"""


def shown(columns):
    """What a program writes to a terminal of so many columns."""
    own, other = pty.openpty()
    fcntl.ioctl(other, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    terminal = {"TERM": "xterm-256color", "PYTHONWARNINGS": "default"}
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES")} | terminal
    command = [sys.executable, "-c", WORK]
    work = subprocess.Popen(command, stdin=other, stdout=other, stderr=other, env=environment)
    os.close(other)
    written = b""
    try:
        while part := os.read(own, 65536):
            written += part
    except OSError:  # the other end is closed
        pass
    finally:
        os.close(own)
    assert work.wait() == 0, written
    return written.decode()


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_a_bar_shows_counts_and_time_whole_and_notes_stand_on_lines_of_their_own(columns):
    written = shown(columns)
    plain = re.sub(r"\x1b\[[0-9;?]*m", "", written)
    frames = [part for part in re.split(r"\r?\x1b\[2K|\r?\n", plain) if "/1234" in part]
    assert frames
    for frame in frames:
        assert re.search(r"^Preparing ━*[╸╺]?━* +[123]/1234 (-:--:--|\d+:\d\d:\d\d) clocks", frame)
        assert frame.count("━") >= 15
        assert len(frame.rstrip()) <= columns
    for words in ("Note: something to know", "Wrote a file"):
        assert re.search(rf"(\r\x1b\[2K|\n){words}\r?\n", plain)
