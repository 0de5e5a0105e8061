"""Pages whose commands and blocks are run, and what these print against what the page shows."""

import contextlib
import io
import re
import shlex
import warnings

from places import ROOT

from seakeep import SeakeepWarning
from seakeep.cli import main

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def shown(text):
    """Lines with single blanks, without rules and empty lines."""
    lines = (" ".join(re.sub("[─━]", "", line).split()) for line in text.splitlines())
    return [line for line in lines if line]


def alike(expected, found):
    """The same words, and numbers equal to one unit of the last printed place.

    The unit covers other linear algebra libraries: it moves the third decimal of an NRMSE only
    where that was about to round the other way.
    """
    if NUMBER.sub("#", expected) != NUMBER.sub("#", found):
        return False
    for one, other in zip(NUMBER.findall(expected), NUMBER.findall(found), strict=True):
        decimals = len(one.partition(".")[2])
        if abs(float(one) - float(other)) > 1.01 * 10.0**-decimals * (decimals > 0):
            return False
    return True


def check(expected, printed):
    found = shown(printed)
    for line in shown(expected):
        if line != "…":
            assert any(alike(line, each) for each in found), f"{line!r} is not in {found}"


def run_console(block):
    out = io.StringIO()
    for line in block.splitlines():
        words = shlex.split(line.removeprefix("$ "))
        assert words[0] == "seakeep"
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            status = main(words[1:])
        assert (status != 0) == ("Error:" in out.getvalue()), out.getvalue()
    return out.getvalue()


def page(name):
    """Text of a page of the documentation."""
    return (ROOT / "docs" / name).read_text("utf-8")


def play(page):
    """Run the console and Python blocks of a page; a text block after one must show its output."""
    printed, names = "", {}
    for kind, content in re.findall(r"^```(\w+)\n(.*?)^```$", page, flags=re.M | re.S):
        if kind == "console":
            printed = run_console(content)
        elif kind == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out), warnings.catch_warnings():
                warnings.simplefilter("ignore", SeakeepWarning)  # of an unstable model
                exec(content, names)  # the page is ours
            printed = out.getvalue()
        elif printed and kind == "text":
            check(content, printed)
            printed = ""
