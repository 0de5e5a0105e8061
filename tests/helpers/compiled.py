"""Sources in C, compiled and called."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

FLAGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared"]


def need_compiler():
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")


def library(folder):
    """Library of all sources of a folder."""
    need_compiler()
    files = sorted(path.name for path in folder.glob("*.c"))
    subprocess.run(["cc", *FLAGS, "-o", "all.so", *files, "-lm"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "all.so"))


def pointer(values):
    return np.ascontiguousarray(values, dtype=float).ctypes.data_as(ctypes.POINTER(ctypes.c_double))
