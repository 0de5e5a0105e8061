"""Ctrl-C is obeyed once, and never lost."""

import signal

import pytest

from seakeep.cli.console import progress_bar
from seakeep.interruption import check_interrupted, interruptible, uninterrupted

pytestmark = pytest.mark.usefixtures("ctrl_c")


class Swallows:
    """Python prints what a finaliser raises, and goes on."""

    def __del__(self):
        press()


def press():
    signal.raise_signal(signal.SIGINT)


def reached_by(work):
    """What a piece of work noted before it was interrupted."""
    reached = []
    with pytest.raises(KeyboardInterrupt):
        work(reached.append)
    return reached


def test_ctrl_c_stops_at_once():
    def work(note):
        with interruptible():
            press()
            note("after it")

    assert reached_by(work) == []


def test_one_that_python_swallowed_is_obeyed_at_the_next_report_of_progress(capfd):
    def work(note):
        with interruptible(), progress_bar("Study") as tell:
            Swallows()
            note("after the finaliser")
            tell(1, 2, "next")
            note("after the report")

    assert reached_by(work) == ["after the finaliser"]
    assert "Traceback" not in capfd.readouterr().err


def test_a_file_is_finished_first():
    def work(note):
        with interruptible():
            with uninterrupted():
                press()
                note("the file")
            note("after the file")

    assert reached_by(work) == ["the file"]


def test_a_second_one_does_not_wait():
    def work(note):
        with interruptible(), uninterrupted():
            press()
            note("first")
            press()
            note("second")

    assert reached_by(work) == ["first"]


def test_afterwards_all_is_as_it_was():
    before = signal.getsignal(signal.SIGINT)

    def work(note):
        with interruptible():
            press()

    assert reached_by(work) == []
    assert signal.getsignal(signal.SIGINT) is before
    check_interrupted()


def test_an_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruptible():
            press()
            check_interrupted()
    finally:
        signal.signal(signal.SIGINT, before)
