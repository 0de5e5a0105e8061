"""A call on bad input, in a process of its own with limits of time and memory."""

from __future__ import annotations

import contextlib
import io
import os
import resource
import shutil
import signal
import tempfile
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

SECONDS = 20
"""Of the processor; a case on a campaign of a minute takes one or two."""
PATIENCE = 90
"""Seconds of the clock, for what waits and for a busy machine."""
MEMORY = 3 * 2**30
"""Bytes beyond what the imports take; a campaign of a minute takes 50 MiB."""


def command(*arguments: object) -> None:
    """Run a command, which may refuse; a fault of ours raises an AssertionError."""
    from seakeep.cli import main

    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main([str(each) for each in arguments])
    words = said.getvalue()
    assert status in (0, 1, 2), status
    assert "This is a fault of seakeep" not in words, words[-2000:]
    assert "Traceback" not in words, words[-2000:]


def fall(call: Callable[[], object], ground: Path) -> str:
    """How a call falls in a copy of a folder; empty where it is answered."""
    folder = Path(tempfile.mkdtemp(prefix="attack-"))
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # threads of others, which stand still
        child = os.fork()
    if child == 0:
        os.close(reading)
        _run(call, ground, folder, writing)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        words = pipe.read().decode("utf-8", "replace")
    _, status = os.waitpid(child, 0)
    shutil.rmtree(folder, ignore_errors=True)
    return f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else words


def _run(call: Callable[[], object], ground: Path, folder: Path, writing: int) -> None:
    """Run a call in the child, and end there."""
    words = ""
    try:
        os.environ["HOME"] = os.environ["TMPDIR"] = tempfile.tempdir = str(folder)
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(null, stream)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(PATIENCE)
        used = resource.getrusage(resource.RUSAGE_SELF).ru_utime
        resource.setrlimit(resource.RLIMIT_CPU, (int(used) + SECONDS,) * 2)
        room = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (room + MEMORY,) * 2)
        shutil.copytree(ground, folder / "g")
        os.chdir(folder / "g")
        from seakeep.errors import SeakeepError

        with warnings.catch_warnings(), contextlib.suppress(SeakeepError):
            warnings.simplefilter("ignore")
            call()
    except BaseException:
        words = traceback.format_exc()
    finally:
        os.write(writing, words.encode("utf-8", "replace")[-60_000:])
        os._exit(0)
