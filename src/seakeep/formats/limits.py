"""HDF5 files of others: walked by a process that may die, and judged by what they declare."""

from __future__ import annotations

import atexit
import contextlib
import functools
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import h5py

from seakeep.errors import DataError
from seakeep.sizes import check_declared

__all__ = ["open_hdf5"]

PATIENCE = 30.0
"""Seconds that a walk through a file may take; a thousand sets take less than one."""

_WALK = """
import json, sys
import h5py

def look(name, item):
    list(item.attrs.items())
    if isinstance(item, h5py.Dataset) and item.size:
        item.id.get_storage_size()
        item[(0,) * item.ndim] if item.dtype.kind in "fiub" else item[()]

for line in sys.stdin:
    try:
        with h5py.File(json.loads(line), "r") as file:
            look("", file)
            file.visititems(look)
    except Exception:
        pass
    print("walked", flush=True)
"""
_LOCK = threading.Lock()


@contextlib.contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file that may be damaged.

    One flipped byte in two thousand brings HDF5 to a crash or to a loop that Ctrl-C does not end.
    Another process therefore walks through the structure first, and is killed after
    :data:`PATIENCE`.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    h5py.File
        The file, open to be read.

    Raises
    ------
    DataError
        If HDF5 does not come back from it, or a set declares far more values than it stores.
    """
    if not _is_walked(path):
        raise DataError(
            f"{path} is damaged: HDF5 crashes on it, or has not come to its end after "
            f"{PATIENCE:g} s. Copy or download it again."
        )
    with h5py.File(path, "r") as file:
        check_declared(path, file, "Save what was measured alone.")
        yield file


def _is_walked(path: Path) -> bool:
    with _LOCK:
        process = _walker(os.getpid())
        assert process.stdin is not None
        assert process.stdout is not None
        timer = threading.Timer(PATIENCE, process.kill)
        timer.start()
        try:
            process.stdin.write(json.dumps(os.fspath(path.absolute())) + "\n")
            process.stdin.flush()
            answer = process.stdout.readline()
        except OSError:
            answer = ""
        finally:
            timer.cancel()
        if not answer:
            _end(process, os.getpid())
            _walker.cache_clear()
        return bool(answer)


@functools.cache
def _walker(parent: int) -> subprocess.Popen[str]:
    """Process that walks, and ends with its input; a fork, which shares the pipes, has its own."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", _WALK],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        encoding="utf-8",  # whatever PYTHONIOENCODING says of other output
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
        start_new_session=True,  # Ctrl-C is not for it
    )
    atexit.register(_end, process, parent)
    return process


def _end(process: subprocess.Popen[str], parent: int) -> None:
    if os.getpid() == parent:  # not that of a fork
        process.kill()
        process.communicate()
