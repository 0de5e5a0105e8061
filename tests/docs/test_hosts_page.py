"""The page on other programs runs: its commands, its Python and its C, which print the same."""

import re
import shutil
import subprocess

import pytest
from pages import page, play

PAGE = page("howto/hosts.md")


def test_the_page_runs_and_its_c_prints_what_python_does(tutorial):
    for name in ("fmpy", "onnx", "onnxruntime"):
        pytest.importorskip(name)
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    play(PAGE)
    programs, shells = (
        re.findall(rf"^```{kind}\n(.*?)^```$", PAGE, re.M | re.S) for kind in ("c", "sh")
    )
    for name, program, shell in zip(("main.c", "follow.c"), programs, shells, strict=True):
        (tutorial / name).write_text(program, "utf-8")
        done = subprocess.run(shell, shell=True, check=True, capture_output=True, text=True)
        assert done.stdout in PAGE
