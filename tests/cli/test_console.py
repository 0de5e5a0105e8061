"""What a terminal shows while a command works: the bar, its counts, and notes beside it."""

import os
import re
import subprocess
import sys

import pytest

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


@pytest.mark.parametrize("columns", [60, 120])
def test_a_bar_shows_counts_and_time_whole_and_notes_stand_on_lines_of_their_own(columns):
    terminal = {"TERM": "xterm-256color", "FORCE_COLOR": "1", "COLUMNS": str(columns)}
    work = [sys.executable, "-W", "default", "-c", WORK]
    done = subprocess.run(work, capture_output=True, check=True, env=os.environ | terminal)
    plain = re.sub(r"\x1b\[[0-9;?]*m", "", done.stderr.decode())
    frames = [part for part in re.split(r"\r?\x1b\[2K|\r?\n", plain) if "/1234" in part]
    assert frames
    for frame in frames:
        assert re.search(r"^Preparing ━*[╸╺]?━* +[123]/1234 (-:--:--|\d+:\d\d:\d\d) clocks", frame)
        assert frame.count("━") >= 15
        assert len(frame.rstrip()) <= columns
    for words in ("Note: something to know", "Wrote a file"):
        assert re.search(rf"(\r\x1b\[2K|\n){words}\r?\n", plain)
