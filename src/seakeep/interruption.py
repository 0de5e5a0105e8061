"""Ctrl-C that is never lost, and never cuts a file that is being read or written.

Python raises ``KeyboardInterrupt`` wherever the main thread happens to be. Raised in a finaliser or
a callback of a compiled library it is printed and forgotten, and the work goes on; raised in the
constructor of a file it leaves an object that complains when it is collected. A command therefore
remembers that it was asked to stop, and asks itself again at each report of progress.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

__all__ = ["check_interrupted", "interruptible", "uninterrupted"]


@dataclass
class _State:
    listening: bool = False
    asked: int = 0
    shields: int = 0


_STATE = _State()


@contextmanager
def interruptible() -> Iterator[None]:
    """Remember Ctrl-C while a command runs; no effect outside the main thread.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C, at once outside :func:`uninterrupted`; on a second one everywhere.
    """
    if _STATE.listening or threading.current_thread() is not threading.main_thread():
        yield
        return

    def note(number: int, frame: FrameType | None) -> None:
        _STATE.asked += 1
        if not _STATE.shields or _STATE.asked > 1:
            raise KeyboardInterrupt

    def tell(unraisable: sys.UnraisableHookArgs) -> None:
        if not _STATE.asked:
            told(unraisable)

    before, told = signal.getsignal(signal.SIGINT), sys.unraisablehook
    if before is not signal.default_int_handler:  # ignored, as under nohup, or an embedder's own
        yield
        return
    signal.signal(signal.SIGINT, note)
    sys.unraisablehook = tell
    _STATE.listening = True
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        sys.unraisablehook = told
        _STATE.listening, _STATE.asked, _STATE.shields = False, 0, 0


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let a file be finished before Ctrl-C is obeyed; for what takes a moment.

    Raises
    ------
    KeyboardInterrupt
        At the end, if Ctrl-C was pressed meanwhile.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _STATE.shields += 1
    try:
        yield
    finally:
        _STATE.shields -= 1
    check_interrupted()


def check_interrupted() -> None:
    """Stop if Ctrl-C was pressed and the interruption was lost or put off.

    Raises
    ------
    KeyboardInterrupt
        If so.
    """
    if _STATE.asked and not _STATE.shields:
        raise KeyboardInterrupt
